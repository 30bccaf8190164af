#include "leap_object_tracker/simulation/motion_script.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

double sweepOffset(const MotionScript::Sweep& sweep, double time) {
  const double middle = (sweep.low + sweep.high) / 2, half = (sweep.high - sweep.low) / 2;
  if (!(half > 0)) return 0;
  return middle + half * std::sin(2 * M_PI * time / sweep.period + std::asin(-middle / half));
}

/// -1 to 1. The second sine is 1.7 times as fast, so that the whole does not repeat soon.
double wobbleShare(const MotionScript::Wobble& wobble, int direction, double time) {
  const auto i = static_cast<std::size_t>(2 * direction);
  const double rate = 2 * M_PI / wobble.period;
  return 0.62 * std::sin(rate * time + wobble.phases[i]) +
         0.38 * std::sin(1.7 * rate * time + wobble.phases[i + 1]);
}

MotionScript::Keyframe keyframeAt(const std::vector<MotionScript::Keyframe>& keyframes,
                                  double time) {
  if (time <= keyframes.front().time) return keyframes.front();
  if (time >= keyframes.back().time) return keyframes.back();
  const auto after = std::upper_bound(
      keyframes.begin(), keyframes.end(), time,
      [](double t, const MotionScript::Keyframe& keyframe) { return t < keyframe.time; });
  const auto before = after - 1;
  const double share = (time - before->time) / (after->time - before->time);
  // Minimum jerk (Flash and Hogan 1985).
  const double s = share * share * share * (10 + share * (-15 + 6 * share));
  return {time, before->offset + s * (after->offset - before->offset),
          before->turn.slerp(s, after->turn)};
}

}  // namespace

Pose MotionScript::at(double time) const {
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();
  Eigen::Matrix3d turn = rotationFromVector(spin * time);
  if (!keyframes.empty()) {
    const Keyframe keyframe = keyframeAt(keyframes, time);
    offset += keyframe.offset;
    turn = turn * keyframe.turn.toRotationMatrix();
  }
  for (const auto& sweep : sweeps) offset[sweep.axis] += sweepOffset(sweep, time);
  for (const auto& wobble : wobbles) {
    Eigen::Vector3d angles;
    for (int i = 0; i < 3; ++i) {
      offset[i] += wobble.amplitude[i] * wobbleShare(wobble, i, time);
      angles[i] = wobble.angular_amplitude[i] * wobbleShare(wobble, i + 3, time);
    }
    turn = turn * rotationFromVector(angles);
  }
  Pose parent_from_body = rest;
  parent_from_body.translation() += offset;
  parent_from_body.linear() = turn * rest.linear();
  return parent_from_body;
}

}  // namespace leap_object_tracker
