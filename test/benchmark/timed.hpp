#pragma once

#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <vector>

namespace leap_object_tracker {

/// Runs `stage` once an iteration and keeps each duration: counters "median_us" and "p99_us".
/// To be used with UseManualTime().
template <class Stage>
void timeEach(benchmark::State& state, const Stage& stage) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> seconds;
  for (auto _ : state) {
    const auto begin = Clock::now();
    stage();
    seconds.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
    state.SetIterationTime(seconds.back());
  }
  std::sort(seconds.begin(), seconds.end());
  const auto at = [&](double share) {
    return 1e6 * seconds[static_cast<std::size_t>(share * static_cast<double>(seconds.size() - 1))];
  };
  if (seconds.empty()) return;
  state.counters["median_us"] = at(0.5);
  state.counters["p99_us"] = at(0.99);
}

}  // namespace leap_object_tracker
