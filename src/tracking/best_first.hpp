#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <vector>

namespace leap_object_tracker {

/// Puts the indices of the `count` highest scores in front, the best ones first, of equal ones the
/// lower index.
template <class Scores>
void putBestFirst(const Scores& scores, std::size_t count, std::vector<std::uint32_t>& order) {
  order.resize(scores.size());
  std::iota(order.begin(), order.end(), 0U);
  std::partial_sort(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(count), order.end(),
                    [&](std::uint32_t a, std::uint32_t b) {
                      return scores[a] > scores[b] || (scores[a] == scores[b] && a < b);
                    });
}

}  // namespace leap_object_tracker
