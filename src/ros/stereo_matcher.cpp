#include "stereo_matcher.hpp"

#include <algorithm>

namespace leap_object_tracker {

std::optional<StereoMessages> StereoMatcher::add(const ros::Time& stamp,
                                                 const StereoMessages& part) {
  auto entry = std::find_if(waiting_.begin(), waiting_.end(),
                            [&](const Waiting& other) { return other.stamp == stamp; });
  if (entry == waiting_.end()) {
    if (waiting_.size() == kMostWaiting) waiting_.pop_front();
    waiting_.push_back({stamp, {}});
    entry = waiting_.end() - 1;
  }
  StereoMessages& messages = entry->messages;
  if (part.left) messages.left = part.left;
  if (part.right) messages.right = part.right;
  if (part.left_info) messages.left_info = part.left_info;
  if (part.right_info) messages.right_info = part.right_info;
  if (!complete(messages)) return std::nullopt;
  const StereoMessages whole = messages;
  waiting_.erase(waiting_.begin(), entry + 1);
  return whole;
}

bool StereoMatcher::complete(const StereoMessages& messages) const {
  const bool left = messages.left && messages.left_info;
  const bool right = messages.right && messages.right_info;
  return (left || eyes_ == Eyes::kRight) && (right || eyes_ == Eyes::kLeft);
}

}  // namespace leap_object_tracker
