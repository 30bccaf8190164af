#include "leap_object_tracker/leap/control_history.hpp"

namespace leap_object_tracker {
namespace {

constexpr std::size_t kRemembered = 16;

}  // namespace

void ControlHistory::sent(const LeapControls& controls) {
  sent_.push_back(controls);
  if (sent_.size() > kRemembered) sent_.pop_front();
}

LeapControls ControlHistory::ofFrame(const FrameMetadata& metadata) const {
  for (auto controls = sent_.rbegin(); controls != sent_.rend(); ++controls)
    if (controls->exposure_us % 512 == metadata.exposure_bits &&
        controls->analog_gain % 32 == metadata.gain_bits)
      return *controls;
  return sent_.empty() ? LeapControls() : sent_.back();
}

}  // namespace leap_object_tracker
