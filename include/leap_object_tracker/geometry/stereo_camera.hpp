#pragma once

#include <Eigen/Dense>
#include <opencv2/core.hpp>
#include <vector>

namespace leap_object_tracker {

/// How a raw pixel leaves the pinhole model. The first four are those of sensor_msgs/CameraInfo and
/// OpenCV (coefficients act from ray to pixel).
enum class DistortionModel {
  kNone,
  kPlumbBob,            ///< k1 k2 p1 p2 k3
  kRationalPolynomial,  ///< k1 k2 p1 p2 k3 k4 k5 k6
  kEquidistant,         ///< k1 k2 k3 k4 (fisheye)
  kLeapInverse,         ///< k1..k6 p1 p2 of the Leap's memory, which act from pixel to ray
};

/// One eye: how rays become raw pixels, and how the eye is turned into the rectified pair.
struct CameraCalibration {
  cv::Size size;          ///< [px]
  double fx = 0, fy = 0;  ///< [px]
  double cx = 0, cy = 0;  ///< [px], pixel centres at integers
  DistortionModel distortion_model = DistortionModel::kNone;
  std::vector<double> distortion;  ///< in the order of the model
  Eigen::Matrix3d rectified_from_raw = Eigen::Matrix3d::Identity();
};

/// Both eyes and what lies between them.
struct StereoCalibration {
  CameraCalibration left;
  CameraCalibration right;
  double baseline = 0;  ///< [m], the right eye sits at +x of the left one in the rectified frame
};

/// The ideal camera pair that a rectified frame was taken with. Both eyes share all but their
/// place.
struct RectifiedStereoCamera {
  double focal_length = 0;  ///< [px], the same in x and y
  double center_u = 0;      ///< [px]
  double center_v = 0;      ///< [px]
  double baseline = 0;      ///< [m], the right eye sits at +x of the left one
  cv::Size size;            ///< [px]

  /// Left pixel of a point [m] in the left rectified frame; z must be positive.
  Eigen::Vector2d leftPixel(const Eigen::Vector3d& point_in_camera) const {
    const double scale = focal_length / point_in_camera.z();
    return {center_u + scale * point_in_camera.x(), center_v + scale * point_in_camera.y()};
  }
  /// Right pixel of a point [m] in the left rectified frame; z must be positive.
  Eigen::Vector2d rightPixel(const Eigen::Vector3d& point_in_camera) const {
    return leftPixel(point_in_camera - Eigen::Vector3d(baseline, 0, 0));
  }
};

/// Direction in the eye's raw frame (z = 1) that a raw pixel sees.
/// @return not finite where the model has no answer.
Eigen::Vector2d rayFromPixel(const CameraCalibration& camera, const Eigen::Vector2d& pixel);

/// Raw pixel of a direction (x/z, y/z) in the eye's raw frame.
/// @return not finite where the model has no answer (outside the lens).
Eigen::Vector2d pixelFromRay(const CameraCalibration& camera, const Eigen::Vector2d& ray);

}  // namespace leap_object_tracker
