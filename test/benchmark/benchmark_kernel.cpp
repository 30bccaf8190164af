// How many poses the contour kernel scores a second, by points, particles, instruction set and
// threads, and how close that comes to a loop that only looks values up.
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "gather_loop.hpp"
#include "recording.hpp"
#include "timed.hpp"

namespace leap_object_tracker {
namespace {

const Observation& observation() {
  static const Observation known(recording("x10_cube_textured", "640x240", 40));
  return known;
}

void score(benchmark::State& state, const std::string& target) {
  const int points = static_cast<int>(state.range(0));
  const auto count = static_cast<std::size_t>(state.range(1));
  const Observation& seen = observation();
  const ContourModel model(seen.frames().object, points, ContourParams().edge_radius);
  const auto eyes = seen.eyes();
  const auto poses = seen.particles(count);
  std::vector<float> scores(count);
  tbb::task_arena arena(static_cast<int>(state.range(2)));
  useContourKernelTarget(target);
  timeEach(state, [&] {
    arena.execute([&] {
      tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, 128),
                        [&](const tbb::blocked_range<std::size_t>& range) {
                          scoreContours(model, points, eyes.data(), eyes.size(), 1 / 3.0F,
                                        poses.data() + range.begin(), range.size(),
                                        scores.data() + range.begin());
                        });
    });
    benchmark::DoNotOptimize(scores.data());
  });
  useContourKernelTarget("");
  state.counters["particles_per_s"] =
      static_cast<double>(count) / (1e-6 * state.counters["median_us"]);
}

/// The lookups of `points` points in both eyes: offsets as the kernel has them, one thread.
void gather(benchmark::State& state, const std::string& target) {
  const auto points = static_cast<std::size_t>(state.range(0));
  const auto count = static_cast<std::size_t>(state.range(1));
  const GainMap& map = *observation().eyes()[0].map;
  std::vector<std::int32_t> offsets, moves;
  for (std::size_t i = 0; i < 2 * points; ++i) {
    const auto step = static_cast<std::int32_t>(i * 7919 % 10007);
    offsets.push_back(step % GainMap::kDirections * map.plane_stride +
                      step % (map.height - 8) * map.row_stride + step % (map.width - 8));
  }
  for (std::size_t i = 0; i < count; ++i) {
    const auto step = static_cast<std::int32_t>(i * 104729 % 1009);
    moves.push_back(step % 8 * map.row_stride + step / 8 % 8);
  }
  useContourKernelTarget(target);
  timeEach(state, [&] {
    benchmark::DoNotOptimize(
        gatherOnly(map.first(), offsets.data(), offsets.size(), moves.data(), count));
  });
  useContourKernelTarget("");
  state.counters["particles_per_s"] =
      static_cast<double>(count) / (1e-6 * state.counters["median_us"]);
}

const bool registered = [] {
  const std::string best = contourKernelTargets().front();
  for (const std::string& target : contourKernelTargets()) {
    auto* scoring = benchmark::RegisterBenchmark(("Kernel/" + target).c_str(), score, target);
    scoring->ArgNames({"points", "particles", "threads"})->UseManualTime();
    scoring->ArgsProduct({{32, 96, 128, 512}, {10000}, {1, 2}});
    if (target == best) scoring->ArgsProduct({{32, 96, 128, 512}, {1000, 100000}, {1, 2}});
    benchmark::RegisterBenchmark(("Gather/" + target).c_str(), gather, target)
        ->ArgNames({"points", "particles"})
        ->Args({96, 10000})
        ->UseManualTime();
  }
  return true;
}();

}  // namespace
}  // namespace leap_object_tracker
