#include "leap_object_tracker/tracking/pose_belief.hpp"

#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kStartSpeed = 0.3;       // [m/s]
constexpr double kStartTurn = 2.0;        // [rad/s]
constexpr double kLargestRotation = 0.6;  // [rad] an orientation is never taken for less known
constexpr double kLargestPosition = 0.1;  // [m]

}  // namespace

PoseBelief beliefAt(const Pose& pose, double position_sigma, double rotation_sigma) {
  PoseBelief belief;
  belief.pose = pose;
  belief.covariance.setZero();
  belief.covariance.diagonal() << Eigen::Vector3d::Constant(position_sigma * position_sigma),
      Eigen::Vector3d::Constant(rotation_sigma * rotation_sigma),
      Eigen::Vector3d::Constant(kStartSpeed * kStartSpeed),
      Eigen::Vector3d::Constant(kStartTurn * kStartTurn);
  return belief;
}

void PoseBelief::predict(const MotionParams& motion, double dt, const Pose& camera_motion) {
  if (!camera_motion.isApprox(Pose::Identity(), 1e-12)) {
    pose = normalized(camera_motion * pose);
    Matrix12d turn = Matrix12d::Zero();
    for (int block = 0; block < 4; ++block)
      turn.block<3, 3>(3 * block, 3 * block) = camera_motion.linear();
    velocity = turn.topLeftCorner<6, 6>() * velocity;
    covariance = turn * covariance * turn.transpose();
  }
  pose = normalized(movedInCamera(pose, velocity * dt));
  const double kept = std::exp(-motion.velocity_damping * dt);
  velocity *= kept;
  Matrix12d step = Matrix12d::Identity();
  step.topRightCorner<6, 6>() = dt * Matrix6d::Identity();
  step.bottomRightCorner<6, 6>() = kept * Matrix6d::Identity();
  Twist acceleration;
  acceleration << Eigen::Vector3d::Constant(motion.linear_acceleration),
      Eigen::Vector3d::Constant(motion.angular_acceleration);
  Eigen::Matrix<double, 12, 6> input;
  input << 0.5 * dt * dt * Matrix6d::Identity(), dt * Matrix6d::Identity();
  covariance = (step * covariance * step.transpose() +
                input * acceleration.cwiseAbs2().asDiagonal() * input.transpose())
                   .eval();

  // Directions that no image binds (the spin of a cylinder) stay within sensible bounds.
  Twist bound;
  bound << Eigen::Vector3d::Constant(kLargestPosition), Eigen::Vector3d::Constant(kLargestRotation);
  const Matrix6d known = poseCovariance();
  const Matrix6d gain = known * (known + Matrix6d(bound.cwiseAbs2().asDiagonal())).inverse();
  Eigen::Matrix<double, 12, 6> cross = covariance.leftCols<6>();
  covariance -= cross * known.ldlt().solve(gain * cross.transpose());
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
}

void PoseBelief::widen(const Matrix6d& pose_covariance) {
  covariance.topLeftCorner<6, 6>() += pose_covariance;
}

void PoseBelief::update(const Pose& refined, const Matrix6d& image_information) {
  const Matrix6d known = poseCovariance();
  const Twist shift = cameraTwistBetween(pose, refined);
  const Matrix6d known_inverse = known.inverse();
  const Matrix6d posterior = (known_inverse + image_information).inverse();
  // Regression of pose and velocity on the pose (Rauch-Tung-Striebel's gain).
  const Eigen::Matrix<double, 12, 6> gain = covariance.leftCols<6>() * known_inverse;
  velocity += gain.bottomRows<6>() * shift;
  covariance += gain * (posterior - known) * gain.transpose();
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  pose = refined;
}

}  // namespace leap_object_tracker
