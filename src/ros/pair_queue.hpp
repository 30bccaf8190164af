#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>

#include "stereo_matcher.hpp"

namespace leap_object_tracker {

/// Pairs that wait for their listener. One that is late once, because the machine was busy for a
/// moment, catches up and loses none; one that stays late gets the newest, so that the age of what
/// it sees cannot grow.
class PairQueue {
 public:
  void push(const StereoMessages& pair);
  /// The pair to work on now; nothing if none waits.
  std::optional<StereoMessages> next();
  bool empty() const { return pairs_.empty(); }
  /// Pairs that gave way to newer ones.
  std::uint32_t dropped() const { return dropped_; }

 private:
  static constexpr std::size_t kMost = 3;  ///< pairs that a moment may last
  static constexpr int kPatience = 4;      ///< pairs in a row that others wait behind

  void dropAllButNewest();

  std::deque<StereoMessages> pairs_;
  int late_in_a_row_ = 0;
  std::uint32_t dropped_ = 0;
};

}  // namespace leap_object_tracker
