// Whole frames, from the raw pair to the pose, and how long it takes until the first one.
#include <tbb/task_arena.h>

#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "recording.hpp"
#include "timed.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kFrames = 40;

/// Walks through a recording to and fro, as if it went on for ever.
class Sequence {
 public:
  explicit Sequence(const Recording& recording)
      : recording_(recording), period_(recording.raw[1].stamp - recording.raw[0].stamp) {}

  RawStereoFrame next() {
    const std::size_t last = recording_.raw.size() - 1, place = count_ % (2 * last);
    RawStereoFrame frame = recording_.raw[place <= last ? place : 2 * last - place];
    frame.stamp = recording_.raw.front().stamp + period_ * static_cast<int>(count_++);
    return frame;
  }

 private:
  const Recording& recording_;
  Stamp::duration period_;
  std::size_t count_ = 0;
};

void wholeFrame(benchmark::State& state, const std::string& scene, const std::string& mode,
                Measurement measurement) {
  const Recording& frames = recording(scene, mode, kFrames);
  TrackerParams params;
  params.filter.particles = static_cast<int>(state.range(0));
  params.threads = static_cast<int>(state.range(1));
  params.measurement = measurement;
  tbb::task_arena arena(params.threads);
  const StereoRectifier rectifier(frames.calibration, frames.camera);
  Tracker tracker(params, frames.object, frames.camera);
  tracker.start(frames.camera_from_object.front());
  Sequence sequence(frames);
  RectifiedStereoFrame rectified;
  int tracked = 0, all = 0;
  const auto track = [&] {
    arena.execute([&] { rectifier.rectify(sequence.next(), rectified); });
    tracked += tracker.track(rectified).has_value();
    ++all;
  };
  for (int i = 0; i < 20; ++i) track();
  timeEach(state, track);
  state.counters["tracked"] = static_cast<double>(tracked) / all;
}
/// As it comes: contour, and features where there are any.
const bool registered = [] {
  struct Case {
    const char *name, *scene, *mode;
    Measurement measurement;
    std::vector<std::int64_t> particles;
  };
  for (const Case& one :
       {Case{"wholeFrame/cube_640x240",
             "x10_cube_textured",
             "640x240",
             Measurement::kAuto,
             {1000, 10000, 100000}},
        Case{"wholeFrame/cube_contour",
             "x10_cube_textured",
             "640x240",
             Measurement::kContour,
             {1000, 10000, 100000}},
        Case{"wholeFrame/cube_640x480", "x10_cube_textured", "640x480", Measurement::kAuto, {1000}},
        Case{"wholeFrame/cylinder_640x240",
             "x10_cylinder_textured",
             "640x240",
             Measurement::kAuto,
             {1000}},
        Case{"wholeFrame/mug_640x240", "wobble_mug", "640x240", Measurement::kAuto, {1000}}})
    benchmark::RegisterBenchmark(one.name, wholeFrame, one.scene, one.mode, one.measurement)
        ->ArgNames({"particles", "threads"})
        ->ArgsProduct({one.particles, {1, 2}})
        ->MinTime(1.5)
        ->UseManualTime();
  return true;
}();

/// A finely tessellated torus: a mesh of 2 * rings * rings triangles.
ObjectModel torus(std::uint32_t rings) {
  ObjectModel object;
  object.name = "torus";
  object.shape = Shape::kMesh;
  for (std::uint32_t i = 0; i < rings; ++i)
    for (std::uint32_t j = 0; j < rings; ++j) {
      const double a = 2 * M_PI * i / rings, b = 2 * M_PI * j / rings;
      const double across = 0.03 + 0.01 * std::cos(b);
      object.mesh.vertices.emplace_back(across * std::cos(a), across * std::sin(a),
                                        0.01 * std::sin(b));
      const std::uint32_t next_i = (i + 1) % rings, next_j = (j + 1) % rings;
      object.mesh.triangles.push_back({i * rings + j, next_i * rings + j, next_i * rings + next_j});
      object.mesh.triangles.push_back({i * rings + j, next_i * rings + next_j, i * rings + next_j});
    }
  return object;
}

void startUp(benchmark::State& state, const ObjectModel& object) {
  const Recording& frames = recording("x10_cube_textured", "640x240", kFrames);
  timeEach(state, [&] {
    const StereoRectifier rectifier(frames.calibration, frames.camera);
    const Tracker tracker(TrackerParams(), object, frames.camera);
    benchmark::DoNotOptimize(&tracker);
  });
}
void startUpOfPrimitive(benchmark::State& state) {
  startUp(state, recording("x10_cube_textured", "640x240", kFrames).object);
}
BENCHMARK(startUpOfPrimitive)->UseManualTime();
/// Without a cache on disk: the first start ever.
void startUpOfMesh(benchmark::State& state) {
  startUp(state, torus(static_cast<std::uint32_t>(std::sqrt(state.range(0) / 2))));
  state.counters["triangles"] = static_cast<double>(state.range(0));
}
BENCHMARK(startUpOfMesh)->Arg(2000)->Arg(100000)->Iterations(1)->UseManualTime();

}  // namespace
}  // namespace leap_object_tracker
