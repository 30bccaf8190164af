#include "leap_object_tracker/geometry/pose.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {

Eigen::Matrix3d rotationFromVector(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle < 1e-12) {
    Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
    rotation(0, 1) = -rotation_vector.z();
    rotation(0, 2) = rotation_vector.y();
    rotation(1, 0) = rotation_vector.z();
    rotation(1, 2) = -rotation_vector.x();
    rotation(2, 0) = -rotation_vector.y();
    rotation(2, 1) = rotation_vector.x();
    return rotation;
  }
  return Eigen::AngleAxisd(angle, rotation_vector / angle).toRotationMatrix();
}

Eigen::Vector3d vectorFromRotation(const Eigen::Matrix3d& rotation) {
  Eigen::Quaterniond quaternion(rotation);
  if (quaternion.w() < 0) quaternion.coeffs() *= -1.0;
  const double sine = quaternion.vec().norm();
  if (sine < 1e-12) return 2.0 * quaternion.vec();
  return quaternion.vec() * (2.0 * std::atan2(sine, quaternion.w()) / sine);
}

Pose moved(const Pose& pose, const Twist& body_twist) {
  Pose result = pose;
  result.translation() += pose.linear() * body_twist.head<3>();
  result.linear() = pose.linear() * rotationFromVector(body_twist.tail<3>());
  return result;
}

Twist twistBetween(const Pose& from, const Pose& to) {
  Twist twist;
  twist.head<3>() = from.linear().transpose() * (to.translation() - from.translation());
  twist.tail<3>() = vectorFromRotation(from.linear().transpose() * to.linear());
  return twist;
}

double angleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return vectorFromRotation(a.transpose() * b).norm();
}

Pose normalized(const Pose& pose) {
  Pose result = pose;
  result.linear() = Eigen::Quaterniond(pose.linear()).normalized().toRotationMatrix();
  return result;
}

}  // namespace leap_object_tracker
