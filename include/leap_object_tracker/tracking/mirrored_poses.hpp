#pragma once

#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/pose.hpp"

namespace leap_object_tracker {

/// A plane face that looks nearly along the line of sight has nearly the same image when its normal
/// is mirrored at that line (Schweighofer and Pinz, Robust pose estimation from a planar target,
/// PAMI 2006, sec. 3), and so has a round body when its axis is mirrored at the image plane: a
/// refinement that begins at one of the two seldom finds the other.
class MirroredPoses {
 public:
  explicit MirroredPoses(const ObjectModel& object);

  /// The mirrored poses of a pose, camera_from_object like it: one for each large plane face that
  /// is turned away from the line of sight by a few degrees and up to 40, and one for a free axis
  /// that leaves the image plane by as much.
  std::vector<Pose> of(const Pose& camera_from_object) const;

 private:
  struct Face {
    Eigen::Vector3d normal = Eigen::Vector3d::Zero();  ///< unit vector, outwards
    Eigen::Vector3d centre = Eigen::Vector3d::Zero();  ///< [m]
    double area = 0;                                   ///< [m^2]
  };
  std::vector<Face> faces_;
  Symmetry symmetry_;
};

}  // namespace leap_object_tracker
