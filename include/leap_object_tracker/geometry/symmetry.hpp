#pragma once

#include <Eigen/Dense>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"

namespace leap_object_tracker {

/// Rotations about the origin of the object that its shape does not show.
struct Symmetry {
  /// One axis in the object frame and how many equal turns it has; 0 for any angle.
  struct Axis {
    Eigen::Vector3d direction;
    int order = 1;
  };

  /// The finite part: always holds the identity.
  std::vector<Eigen::Matrix3d> rotations{Eigen::Matrix3d::Identity()};
  /// Unit vector of the axis of free spin; zero if there is none.
  Eigen::Vector3d free_axis = Eigen::Vector3d::Zero();

  bool hasFreeAxis() const { return free_axis.squaredNorm() > 0.5; }
  bool trivial() const { return rotations.size() == 1 && !hasFreeAxis(); }
};

/// The group that the axes span: products of the finite ones; at most one free axis.
/// @throw std::invalid_argument for a zero axis, a negative order, two free axes, or a group of
/// more than 120 elements (axes that do not fit each other).
Symmetry symmetryFromAxes(const std::vector<Symmetry::Axis>& axes);

/// Such as "none", "24 turns" or "any turn about (0, 0, 1)".
std::string describe(const Symmetry& symmetry);

/// The pose among the equivalents of `pose` whose orientation is nearest to `reference`.
Pose nearestEquivalent(const Pose& pose, const Pose& reference, const Symmetry& symmetry);

/// Angle [rad] from one orientation to the nearest equivalent of the other.
double angleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b, const Symmetry& symmetry);

}  // namespace leap_object_tracker
