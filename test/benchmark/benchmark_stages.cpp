// Every stage of a frame by itself: rectification, edges, gain maps, prediction, annealing,
// resampling, refinement, features, search.
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/contour_measurement.hpp"
#include "leap_object_tracker/tracking/feature_measurement.hpp"
#include "leap_object_tracker/tracking/particle_filter.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/pose_search.hpp"
#include "recording.hpp"
#include "timed.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kFrames = 40;

const Recording& cube() { return recording("x10_cube_textured", "640x240", kFrames); }
const Recording& mug() { return recording("wobble_mug", "640x240", kFrames); }

void rectification(benchmark::State& state, const std::string& mode) {
  const Recording& frames = recording("x10_cube_textured", mode, kFrames);
  const StereoRectifier rectifier(frames.calibration, frames.camera);
  RectifiedStereoFrame rectified;
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  std::size_t i = 0;
  timeEach(state, [&] {
    arena.execute([&] { rectifier.rectify(frames.raw[i++ % frames.raw.size()], rectified); });
  });
}
BENCHMARK_CAPTURE(rectification, 640x240, "640x240")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime();
BENCHMARK_CAPTURE(rectification, 640x480, "640x480")
    ->ArgName("threads")
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime();

void edges(benchmark::State& state) {
  const Observation seen(cube());
  EdgeField field;
  timeEach(state, [&] { field.build(cube().rectified.front().left, seen.regions()[0]); });
  state.counters["pixels"] = seen.regions()[0].area();
}
BENCHMARK(edges)->UseManualTime();

void gainMap(benchmark::State& state) {
  const Observation seen(cube());
  GainMap map;
  const EdgeKernel kernel{static_cast<float>(state.range(0)) / 10, 3.0F};
  timeEach(state, [&] { seen.fields()[0].transform(kernel, 1, map); });
}
BENCHMARK(gainMap)->ArgName("sigma_tenths")->Arg(12)->Arg(30)->UseManualTime();

/// Both eyes, edges and both gain maps of each.
void observe(benchmark::State& state) {
  const Observation seen(cube());
  ContourMeasurement measurement(ContourParams(), Eyes::kBoth, cube().camera);
  tbb::task_arena arena(static_cast<int>(state.range(0)));
  timeEach(state, [&] {
    arena.execute([&] { measurement.observe(cube().rectified.front(), seen.regions()); });
  });
}
BENCHMARK(observe)->ArgName("threads")->Arg(1)->Arg(2)->UseManualTime();

/// A filter about the true pose of the first frame, and the scorer of that frame.
class Filtering {
 public:
  explicit Filtering(benchmark::State& state)
      : arena_(static_cast<int>(state.range(1))),
        seen_(cube()),
        model_(cube().object, ContourParams().points, ContourParams().edge_radius),
        measurement_(ContourParams(), Eyes::kBoth, cube().camera),
        filter_(params(state)) {
    measurement_.observe(cube().rectified.front(), seen_.regions());
    scatter();
  }

  void scatter() {
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal() << Eigen::Vector3d::Constant(1e-6), Eigen::Vector3d::Constant(1e-3);
    arena_.execute([&] {
      filter_.initialize(cube().camera_from_object.front(), covariance, Twist::Zero(), covariance);
    });
  }
  BatchScorer scorer() const {
    return [this](const ParticlePose* poses, std::size_t count, float* scores) {
      measurement_.score(model_, ContourMeasurement::Sharpness::kSharp, poses, count, scores);
    };
  }
  ParticleFilter& filter() { return filter_; }
  template <class Stage>
  void time(benchmark::State& state, const Stage& stage) {
    timeEach(state, [&] { arena_.execute(stage); });
  }

 private:
  static FilterParams params(const benchmark::State& state) {
    FilterParams params;
    params.particles = static_cast<int>(state.range(0));
    return params;
  }

  tbb::task_arena arena_;
  Observation seen_;
  ContourModel model_;
  ContourMeasurement measurement_;
  ParticleFilter filter_;
};

void prediction(benchmark::State& state) {
  Filtering filtering(state);
  filtering.time(state, [&] { filtering.filter().predict({}, 0.0087, Pose::Identity()); });
}

void injection(benchmark::State& state) {
  Filtering filtering(state);
  const Matrix6d covariance = 1e-6 * Matrix6d::Identity();
  filtering.time(state, [&] {
    filtering.filter().inject(0.5, cube().camera_from_object.front(), covariance, Twist::Zero(),
                              covariance);
  });
}

/// Likelihoods that cost nothing: what is left is weights, resampling and spreading, and the
/// prediction that makes a thinned set whole again.
void predictionAndAnnealing(benchmark::State& state) {
  Filtering filtering(state);
  const Pose truth = cube().camera_from_object.front();
  const float x = static_cast<float>(truth.translation().x());
  filtering.time(state, [&] {
    filtering.filter().predict({}, 0.0087, Pose::Identity());
    filtering.filter().anneal(
        [x](const ParticlePose* poses, std::size_t count, float* scores) {
          for (std::size_t i = 0; i < count; ++i) {
            const float off = (poses[i].translation[0] - x) * 2e3F;
            scores[i] = -off * off;
          }
        },
        0.2, 0.4);
  });
}

void resampling(benchmark::State& state) {
  Filtering filtering(state);
  const BatchScorer scorer = filtering.scorer();
  filtering.filter().weigh(scorer);
  filtering.time(state, [&] { filtering.filter().resample(1.01); });
}

void weighing(benchmark::State& state) {
  Filtering filtering(state);
  const BatchScorer scorer = filtering.scorer();
  filtering.time(state, [&] { filtering.filter().weigh(scorer); });
}

const bool registered = [] {
  for (const auto& [name, stage] :
       {std::make_pair("prediction", prediction),
        std::make_pair("predictionAndAnnealing", predictionAndAnnealing),
        std::make_pair("resampling", resampling), std::make_pair("injection", injection),
        std::make_pair("weighing", weighing)})
    benchmark::RegisterBenchmark(name, stage)
        ->ArgNames({"particles", "threads"})
        ->ArgsProduct({{1000, 10000, 100000}, {1, 2}})
        ->UseManualTime();
  return true;
}();

/// From 2 mm and 2 deg off, with the ranges of the tracker's first refinement.
void refinement(benchmark::State& state, const Recording& (*frames)()) {
  const Recording& recording = frames();
  const Observation seen(recording);
  const ContourParams params;
  const ContourModel model(recording.object, params.points, params.edge_radius);
  const PoseRefiner refiner(params, recording.camera);
  Twist off;
  off << 0.001, -0.001, 0.001, 0.02, -0.02, 0.02;
  const Pose start = movedInCamera(recording.camera_from_object.front(), off);
  timeEach(state, [&] {
    benchmark::DoNotOptimize(
        refiner.refine(model, seen.fields(), start, {}, Appearance(), {6, 4, 2.5}));
  });
}
BENCHMARK_CAPTURE(refinement, cube, &cube)->UseManualTime();
BENCHMARK_CAPTURE(refinement, mug, &mug)->UseManualTime();

void exactView(benchmark::State& state) {
  const ContourModel model(mug().object, ContourParams().points);
  const Pose& pose = mug().camera_from_object.front();
  const Eigen::Vector3d eye = -(pose.linear().transpose() * pose.translation());
  timeEach(state, [&] { benchmark::DoNotOptimize(model.exactView(eye)); });
}
BENCHMARK(exactView)->UseManualTime();

/// Features of a textured cylinder, with landmarks learnt from the frame itself.
class Features {
 public:
  explicit Features(int threads)
      : seen_(cylinder()),
        measurement_(FeatureParams(), cylinder().object, cylinder().camera),
        arena_(threads) {
    observe();
    for (int i = 0; i < 10; ++i) {
      measurement_.learn(pose(), 0.0002, 0.002);
      measurement_.expect(pose(), 0.0005);
    }
  }

  void observe() {
    arena_.execute([&] {
      measurement_.observe(cylinder().rectified.front(), seen_.regions(), pose(), 0.0005);
    });
  }
  const FeatureMeasurement& measurement() const { return measurement_; }
  std::vector<ParticlePose> particles(int count) const {
    return seen_.particles(static_cast<std::size_t>(count));
  }

 private:
  static const Recording& cylinder() {
    return recording("x10_cylinder_textured", "640x240", kFrames);
  }
  static const Pose& pose() { return cylinder().camera_from_object.front(); }

  Observation seen_;
  FeatureMeasurement measurement_;
  tbb::task_arena arena_;
};

void featureExtraction(benchmark::State& state) {
  Features features(static_cast<int>(state.range(0)));
  timeEach(state, [&] { features.observe(); });
  state.counters["features"] = static_cast<double>(features.measurement().features().size());
}
BENCHMARK(featureExtraction)->ArgName("threads")->Arg(1)->Arg(2)->UseManualTime();

void featureScoring(benchmark::State& state) {
  const Features features(1);
  const auto poses = features.particles(static_cast<int>(state.range(0)));
  std::vector<float> scores(poses.size());
  timeEach(state, [&] { features.measurement().score(poses.data(), poses.size(), scores.data()); });
}
BENCHMARK(featureScoring)->ArgName("particles")->Arg(1000)->UseManualTime();

void featureRefinement(benchmark::State& state) {
  const Features features(1);
  PosePrior prior;
  prior.mean = toPose(features.particles(1).front());
  prior.information = 1e6 * Matrix6d::Identity();
  timeEach(state, [&] { benchmark::DoNotOptimize(features.measurement().refine(prior)); });
}
BENCHMARK(featureRefinement)->UseManualTime();

void search(benchmark::State& state) {
  TrackerParams params;
  params.threads = static_cast<int>(state.range(0));
  const ContourModel model(cube().object, params.contour.points, params.contour.edge_radius);
  PoseSearch search(params, cube().object, model, cube().camera);
  const auto all = [](const FoundPose&) { return true; };
  tbb::task_arena arena(params.threads);
  timeEach(state, [&] {
    arena.execute(
        [&] { benchmark::DoNotOptimize(search.find(cube().rectified.front(), {}, all)); });
  });
}
BENCHMARK(search)->ArgName("threads")->Arg(1)->Arg(2)->UseManualTime();

}  // namespace
}  // namespace leap_object_tracker
