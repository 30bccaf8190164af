#include "pair_queue.hpp"

namespace leap_object_tracker {

void PairQueue::push(const StereoMessages& pair) {
  pairs_.push_back(pair);
  if (pairs_.size() > kMost) dropAllButNewest();
}

std::optional<StereoMessages> PairQueue::next() {
  if (pairs_.empty()) return std::nullopt;
  late_in_a_row_ = pairs_.size() > 1 ? late_in_a_row_ + 1 : 0;
  if (late_in_a_row_ > kPatience) dropAllButNewest();
  const StereoMessages pair = pairs_.front();
  pairs_.pop_front();
  return pair;
}

void PairQueue::dropAllButNewest() {
  dropped_ += static_cast<std::uint32_t>(pairs_.size() - 1);
  pairs_.erase(pairs_.begin(), pairs_.end() - 1);
}

}  // namespace leap_object_tracker
