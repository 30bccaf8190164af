#pragma once

#include <deque>

#include "leap_object_tracker/leap/frame_metadata.hpp"
#include "leap_object_tracker/leap/leap_protocol.hpp"

namespace leap_object_tracker {

/// Remembers what was sent, to tell which settings a frame was exposed with: the frame itself
/// carries only the lower bits of exposure and gain.
class ControlHistory {
 public:
  void sent(const LeapControls& controls);
  /// The latest settings that match; the latest ones if none does.
  LeapControls ofFrame(const FrameMetadata& metadata) const;

 private:
  std::deque<LeapControls> sent_;
};

}  // namespace leap_object_tracker
