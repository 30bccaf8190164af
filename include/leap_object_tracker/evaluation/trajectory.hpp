#pragma once

#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"

namespace leap_object_tracker {

struct StampedPose {
  Stamp stamp;
  Pose camera_from_object = Pose::Identity();
  /// As PoseEstimate::covariance: (x, y, z [m], rotation about x, y, z [rad]) along the camera's
  /// axes.
  std::optional<Matrix6d> covariance;
};

/// Poses in the order of their stamps.
using Trajectory = std::vector<StampedPose>;

/// Reads lines `stamp tx ty tz qx qy qz qw` ([s], [m]); `#` begins a comment.
/// @throw std::runtime_error naming the file and the line: not readable, not eight finite numbers,
/// a quaternion that is not of unit length, stamps that do not increase.
Trajectory readTum(const std::string& path);

/// Writes what readTum reads, stamps to the nanosecond. @throw std::runtime_error naming the file.
void writeTum(const std::string& path, const Trajectory& trajectory);

/// Adds covariances from lines `stamp,c00,c01,...,c55`: the upper triangle, row by row, 21 values.
/// Lines that do not begin with a number or `-` are headings. Poses without a line stay without
/// covariance.
/// @throw std::runtime_error naming the file and the line: not readable, not 22 finite numbers, or
/// no stamp in common with the trajectory.
void readCovariances(const std::string& path, Trajectory& trajectory);

/// Writes what readCovariances reads, for the poses that have a covariance.
/// @throw std::runtime_error naming the file.
void writeCovariances(const std::string& path, const Trajectory& trajectory);

/// The pose at a time: between the two neighbours, if they are no farther apart than `longest_gap`,
/// else that of a stamp within `tolerance`.
std::optional<Pose> poseAt(const Trajectory& trajectory, Stamp stamp,
                           std::chrono::nanoseconds tolerance,
                           std::chrono::nanoseconds longest_gap);

}  // namespace leap_object_tracker
