#include "leap_object_tracker/tracking/grey_model.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace leap_object_tracker {
namespace {

constexpr float kFewest = 50;          // samples
constexpr float kSurprise = 0.02F;     // share of samples that follow no histogram
constexpr float kLargestRatio = 2.0F;  // [nats]

/// Shares of the bins, blurred by one bin, with a floor for what was never seen.
GreyModel::Histogram shares(const GreyModel::Histogram& counts, float sum) {
  GreyModel::Histogram result;
  for (int i = 0; i < GreyModel::kBins; ++i) {
    const auto at = [&](int k) {
      return counts[static_cast<std::size_t>(std::clamp(k, 0, GreyModel::kBins - 1))];
    };
    result[static_cast<std::size_t>(i)] =
        (1 - kSurprise) * (0.25F * at(i - 1) + 0.5F * at(i) + 0.25F * at(i + 1)) / sum +
        kSurprise / GreyModel::kBins;
  }
  return result;
}

}  // namespace

int GreyModel::bin(std::uint8_t grey) {
  static const std::array<std::uint8_t, 256> table = [] {
    std::array<std::uint8_t, 256> bins{};
    for (std::size_t i = 0; i < bins.size(); ++i)
      bins[i] = static_cast<std::uint8_t>(
          std::min<double>(kBins - 1, std::sqrt(static_cast<double>(i) / 256) * kBins));
    return bins;
  }();
  return table[grey];
}

void GreyModel::learn(const Histogram& inside, const Histogram& outside, double rate) {
  const float inside_sum = std::accumulate(inside.begin(), inside.end(), 0.0F);
  const float outside_sum = std::accumulate(outside.begin(), outside.end(), 0.0F);
  if (inside_sum < kFewest || outside_sum < kFewest) return;
  const auto share = static_cast<float>(known_ ? rate : 1.0);
  const Histogram new_inside = shares(inside, inside_sum),
                  new_outside = shares(outside, outside_sum);
  for (std::size_t i = 0; i < inside_.size(); ++i) {
    inside_[i] += share * (new_inside[i] - inside_[i]);
    outside_[i] += share * (new_outside[i] - outside_[i]);
  }
  known_ = true;
  for (std::size_t grey = 0; grey < log_ratio_.size(); ++grey) {
    const auto i = static_cast<std::size_t>(bin(static_cast<std::uint8_t>(grey)));
    log_ratio_[grey] =
        std::clamp(std::log(inside_[i] / outside_[i]), -kLargestRatio, kLargestRatio);
  }
}

}  // namespace leap_object_tracker
