#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"

namespace leap_object_tracker {

/// How a body moves: a rest pose and, on top of it, any of the motions below. Turns are about the
/// body's own origin; offsets are along the axes of the parent.
struct MotionScript {
  /// To and fro along one axis of the parent, starting at the rest pose towards `high`.
  struct Sweep {
    int axis = 0;       ///< 0 x, 1 y, 2 z
    double low = 0;     ///< [m] from the rest pose, at most 0
    double high = 0;    ///< [m] from the rest pose, at least 0
    double period = 4;  ///< [s]
  };
  /// Sum of two sines with random phases in each of the six directions, never beyond the amplitude.
  struct Wobble {
    Eigen::Vector3d amplitude = Eigen::Vector3d::Zero();          ///< [m]
    Eigen::Vector3d angular_amplitude = Eigen::Vector3d::Zero();  ///< [rad] about x, y, z
    double period = 3;                                            ///< [s] of the slower sine
    std::array<double, 12> phases{};                              ///< [rad]
  };
  /// A pose relative to the rest pose; between two of them the body starts and stops softly.
  struct Keyframe {
    double time = 0;                                   ///< [s]
    Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< [m]
    Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  };

  Pose rest = Pose::Identity();
  std::vector<Sweep> sweeps;
  std::vector<Wobble> wobbles;
  std::vector<Keyframe> keyframes;
  Eigen::Vector3d spin = Eigen::Vector3d::Zero();  ///< [rad/s] about axes of the parent

  bool moves() const {
    return !sweeps.empty() || !wobbles.empty() || keyframes.size() > 1 || spin.norm() > 0;
  }
  /// parent_from_body at a time [s].
  Pose at(double time) const;
};

}  // namespace leap_object_tracker
