#pragma once

#include <optional>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/symmetry.hpp"

namespace leap_object_tracker {

/// A short piece of a visible line of the object, in its frame.
struct LineElement {
  Eigen::Vector3d position;  ///< [m]
  Eigen::Vector3d tangent;   ///< unit vector along the line
  double length = 0;         ///< [m]
};

/// What can be measured of a line. Raw pixels: where rows are binned, a vertical error is twice as
/// large an angle.
struct EdgeNoise {
  double sigma = 0.3;             ///< [raw px] across the line
  double correlation_length = 3;  ///< [raw px] along the line, per independent measurement
};

/// Fisher information of one image about (x, y, z [m], rotation about x, y, z of the camera through
/// the object's origin [rad]): each independent piece of a line measures its place across itself.
/// @param eye 0 left, 1 right
/// @param camera_from_object left rectified frame from object
Matrix6d lineInformation(const StereoCalibration& calibration, int eye,
                         const Pose& camera_from_object, const std::vector<LineElement>& lines,
                         const EdgeNoise& noise = {});

/// Standard deviations that no unbiased estimator goes below (Cramer and Rao).
struct PoseBound {
  double position = 0;     ///< [m] root of the sum over three axes
  double orientation = 0;  ///< [rad] the same, without the free axis of a symmetric object
};

/// @return nothing if the information leaves a direction open, other than the free axis.
std::optional<PoseBound> boundFrom(const Matrix6d& information, const Pose& camera_from_object,
                                   const Symmetry& symmetry);

}  // namespace leap_object_tracker
