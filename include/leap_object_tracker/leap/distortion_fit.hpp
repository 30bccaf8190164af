#pragma once

#include "leap_object_tracker/geometry/stereo_camera.hpp"

namespace leap_object_tracker {

struct DistortionFit {
  CameraCalibration camera;  ///< kRationalPolynomial
  double rms = 0;            ///< [px] over the image
  double largest = 0;        ///< [px]
};

/// Which of a camera's numbers a fit may change.
enum class FitFreedom {
  kAll,         ///< focal lengths, principal point and distortion
  kRadialPart,  ///< k1 to k6
};

/// The rational polynomial of OpenCV and ROS that comes closest to `camera` over its image
/// (Levenberg and Marquardt over a grid of pixels). What remains of a Leap's map is its tangential
/// part, which acts in the other direction.
DistortionFit fitRationalPolynomial(const CameraCalibration& camera, FitFreedom freedom);

}  // namespace leap_object_tracker
