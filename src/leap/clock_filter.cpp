#include "leap_object_tracker/leap/clock_filter.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace leap_object_tracker {
namespace {

constexpr double kTick = 1e-3;              // [s] of the device's clock
constexpr double kLargestJump = 0.5;        // [s] between the clocks, beyond: the device restarted
constexpr double kLargestMiss = 2 * kTick;  // beyond: the period has changed
constexpr double kPeriodGain = 0.05;
constexpr double kSegment = 0.25;  // [s]
constexpr std::size_t kSegments = 32;
constexpr std::size_t kFewestForDrift = 8;
constexpr double kLargestDrift = 1e-3;

}  // namespace

ClockFilter::ClockFilter(double period) : period_(period) {}

double ClockFilter::push(std::uint32_t device_ms, double arrival) {
  const auto elapsed_ms = static_cast<std::int32_t>(device_ms - last_ms_);
  const bool plausible = started_ && elapsed_ms > 0 &&
                         std::abs(elapsed_ms * kTick - (arrival - last_arrival_)) < kLargestJump;
  if (plausible)
    refine(device_ms);
  else
    restart(device_ms, arrival);
  last_ms_ = device_ms;
  last_arrival_ = arrival;
  remember({device_, arrival - device_});
  return device_ + offsetAt(device_);
}

void ClockFilter::restart(std::uint32_t device_ms, double arrival) {
  started_ = true;
  reading_ = device_ms * kTick;
  device_ = reading_ + kTick / 2;
  drift_ = 0;
  last_arrival_ = arrival;
  earliest_.clear();
}

void ClockFilter::refine(std::uint32_t device_ms) {
  const double elapsed = static_cast<std::int32_t>(device_ms - last_ms_) * kTick;
  reading_ += elapsed;
  const double frames = std::max(1.0, std::round(elapsed / period_));
  const double predicted = device_ + frames * period_;
  const double miss = std::clamp(predicted, reading_, reading_ + kTick) - predicted;
  if (std::abs(miss) > kLargestMiss)
    device_ = reading_ + kTick / 2;
  else
    device_ = predicted + miss;
  period_ += kPeriodGain * miss / frames;
}

void ClockFilter::remember(const Point& point) {
  if (earliest_.empty() || point.device - segment_start_ >= kSegment) {
    earliest_.push_back(point);
    segment_start_ = point.device;
    if (earliest_.size() > kSegments) earliest_.pop_front();
  } else if (point.offset < earliest_.back().offset) {
    earliest_.back() = point;
  }
}

double ClockFilter::offsetAt(double device) {
  const auto lower = [](const Point& a, const Point& b) { return a.offset < b.offset; };
  if (earliest_.size() < kFewestForDrift)
    return std::min_element(earliest_.begin(), earliest_.end(), lower)->offset;

  // Lower hull; of all lines below the points, its edge over the middle lies closest to them.
  std::vector<Point> hull;
  for (const Point& point : earliest_) {
    while (hull.size() >= 2) {
      const Point& a = hull[hull.size() - 2];
      const Point& b = hull.back();
      const bool b_is_above = (b.offset - a.offset) * (point.device - a.device) >=
                              (point.offset - a.offset) * (b.device - a.device);
      if (!b_is_above) break;
      hull.pop_back();
    }
    hull.push_back(point);
  }
  const double middle = (earliest_.front().device + earliest_.back().device) / 2;
  std::size_t right = 1;
  while (right + 1 < hull.size() && hull[right].device < middle) ++right;
  const Point& a = hull[right - 1];
  const Point& b = hull[right];
  drift_ = std::clamp((b.offset - a.offset) / (b.device - a.device), -kLargestDrift, kLargestDrift);
  return a.offset + drift_ * (device - a.device);
}

}  // namespace leap_object_tracker
