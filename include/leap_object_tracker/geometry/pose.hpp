#pragma once

#include <Eigen/Dense>
#include <chrono>

namespace leap_object_tracker {

/// A rigid transform, named `a_from_b`: takes points of frame b into frame a. Translation in [m].
using Pose = Eigen::Isometry3d;

/// A small motion: translation [m] in rows 0-2, rotation vector [rad] in rows 3-5.
using Twist = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Time of an exposure, on the clock of the host.
using Stamp = std::chrono::time_point<std::chrono::system_clock, std::chrono::nanoseconds>;

inline double seconds(std::chrono::nanoseconds duration) {
  return std::chrono::duration<double>(duration).count();
}
inline double seconds(Stamp stamp) { return seconds(stamp.time_since_epoch()); }
inline Stamp stampFromSeconds(double since_epoch) {
  return Stamp(std::chrono::nanoseconds(static_cast<std::int64_t>(since_epoch * 1e9)));
}

/// Rotation by |rotation_vector| [rad] about its direction (Rodrigues).
Eigen::Matrix3d rotationFromVector(const Eigen::Vector3d& rotation_vector);

/// Inverse of rotationFromVector, of length 0 to pi [rad].
Eigen::Vector3d vectorFromRotation(const Eigen::Matrix3d& rotation);

/// `pose` moved by a twist of its own body frame: translation added along the body's axes, rotation
/// multiplied from the right (the manifold R^3 x SO(3); no coupling of the two).
Pose moved(const Pose& pose, const Twist& body_twist);

/// The twist with moved(from, twist) == to.
Twist twistBetween(const Pose& from, const Pose& to);

/// Angle between two orientations [rad].
double angleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b);

/// Puts the rotation back on SO(3) after many products.
Pose normalized(const Pose& pose);

}  // namespace leap_object_tracker
