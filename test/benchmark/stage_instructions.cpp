// Under `valgrind --tool=callgrind --instr-atstart=no`: leaves one profile for each stage of a
// frame, named by its trigger, on one thread. Counts of instructions do not depend on what else
// runs.
#include <tbb/task_arena.h>
#include <valgrind/callgrind.h>

#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/feature_measurement.hpp"
#include "leap_object_tracker/tracking/particle_filter.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/pose_search.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "recording.hpp"

namespace leap_object_tracker {
namespace {

/// Once to warm up, once counted.
template <class Stage>
void count(const char* name, const Stage& stage) {
  stage();
  CALLGRIND_START_INSTRUMENTATION;
  stage();
  CALLGRIND_STOP_INSTRUMENTATION;
  CALLGRIND_DUMP_STATS_AT(name);
  CALLGRIND_ZERO_STATS;
}

/// With landmarks learnt from the frame itself.
void countFeatures() {
  const Recording& frames = recording("x10_cylinder_textured", "640x240", 3);
  const Observation seen(frames);
  const Pose& pose = frames.camera_from_object[0];
  FeatureMeasurement measurement(FeatureParams(), frames.object, frames.camera);
  count("features of a frame", [&] {
    measurement.observe(frames.rectified[0], seen.regions(), pose, 0.0005);
    measurement.learn(pose, 0.0002, 0.002);
  });
  const auto poses = seen.particles(1000);
  std::vector<float> scores(poses.size());
  count("feature scores, 1000 particles",
        [&] { measurement.score(poses.data(), poses.size(), scores.data()); });
}

void countTracker(const char* name, const Recording& frames) {
  TrackerParams params;
  params.threads = 1;
  Tracker tracker(params, frames.object, frames.camera);
  tracker.start(frames.camera_from_object[0]);
  RectifiedStereoFrame next = frames.rectified[0];
  const Stamp::duration period = frames.raw[1].stamp - frames.raw[0].stamp;
  count(name, [&] {
    tracker.track(next);
    next.stamp += period;
  });
}

void countAll() {
  const Recording& frames = recording("x10_cube_textured", "640x240", 3);
  const ContourParams contour;
  const Observation seen(frames);
  const StereoRectifier rectifier(frames.calibration, frames.camera);
  RectifiedStereoFrame rectified;
  count("rectification", [&] { rectifier.rectify(frames.raw[0], rectified); });

  EdgeField field;
  count("edges of an eye", [&] { field.build(frames.rectified[0].left, seen.regions()[0]); });
  GainMap map;
  count("blunt gain map", [&] { field.transform({3.0F, 2.0F}, 1, map); });
  count("sharp gain map", [&] { field.transform({1.2F, 3.0F}, 1, map); });

  const ContourModel model(frames.object, contour.points, contour.edge_radius);
  const auto eyes = seen.eyes();
  const auto poses = seen.particles(1000);
  std::vector<float> scores(poses.size());
  count("kernel, 1000 particles", [&] {
    scoreContours(model, model.points(), eyes.data(), eyes.size(), 1 / 3.0F, poses.data(),
                  poses.size(), scores.data());
  });

  ParticleFilter filter{FilterParams()};
  const Matrix6d covariance = 1e-6 * Matrix6d::Identity();
  filter.initialize(frames.camera_from_object[0], covariance, Twist::Zero(), covariance);
  count("prediction, 1000 particles", [&] { filter.predict({}, 0.0087, Pose::Identity()); });
  count("annealing, 1000 particles", [&] {
    filter.anneal(
        [](const ParticlePose* particles, std::size_t many, float* likelihoods) {
          for (std::size_t i = 0; i < many; ++i)
            likelihoods[i] = -1e3F * std::abs(particles[i].translation[0]);
        },
        0.2, 0.4);
  });

  const PoseRefiner refiner(contour, frames.camera);
  Twist off;
  off << 0.001, -0.001, 0.001, 0.02, -0.02, 0.02;
  const Pose start = movedInCamera(frames.camera_from_object[0], off);
  count("refinement", [&] {
    refiner.refine(model, seen.fields(), start, {}, Appearance(), {6, 4, 2.5});
  });
  PoseSearch search(TrackerParams(), frames.object, model, frames.camera);
  count("search",
        [&] { search.find(frames.rectified[0], {}, [](const FoundPose&) { return true; }); });

  countFeatures();
  countTracker("tracker, 1000 particles", frames);
  countTracker("tracker with features, 1000 particles",
               recording("x10_cylinder_textured", "640x240", 3));
}

}  // namespace
}  // namespace leap_object_tracker

int main() {
  tbb::task_arena arena(1);
  arena.execute([] { leap_object_tracker::countAll(); });
}
