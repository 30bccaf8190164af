#pragma once

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// The mode of the posterior as a Gaussian over pose and velocity: camera twists about `pose` and
/// `velocity`, in this order, 12 x 12.
struct PoseBelief {
  using Matrix12d = Eigen::Matrix<double, 12, 12>;

  Pose pose = Pose::Identity();
  Twist velocity = Twist::Zero();  ///< [m/s, rad/s] camera twist per second
  Matrix12d covariance = Matrix12d::Identity();

  Matrix6d poseCovariance() const { return covariance.topLeftCorner<6, 6>(); }
  Matrix6d velocityCovariance() const { return covariance.bottomRightCorner<6, 6>(); }

  /// Constant velocity with white acceleration (Bar-Shalom et al. 2001, section 6.3.2), held
  /// constant over the step, as the particles move.
  void predict(const MotionParams& motion, double dt, const Pose& camera_motion);

  /// Adds an error of the pose that has nothing to do with the velocity.
  void widen(const Matrix6d& pose_covariance);

  /// Takes the pose that maximises the posterior of image and prediction, and the information that
  /// the image alone gave. The velocity follows through its correlation with the pose.
  void update(const Pose& refined, const Matrix6d& image_information);
};

/// A belief that starts at rest.
PoseBelief beliefAt(const Pose& pose, double position_sigma, double rotation_sigma);

}  // namespace leap_object_tracker
