// Counts every allocation of the process while frames are tracked.
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <cerrno>
#include <cstddef>
#include <opencv2/features2d.hpp>

#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"
#include "leap_object_tracker/tracking/feature_measurement.hpp"
#include "leap_object_tracker/tracking/particle_filter.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "recording.hpp"

namespace {
std::atomic<bool> counting{false};
std::atomic<long> allocations{0};

void note() {
  if (counting) ++allocations;
}
}  // namespace

// Those of the C library, in its stead for all libraries; operator new comes here as well.
extern "C" {
void* __libc_malloc(std::size_t size);
void* __libc_calloc(std::size_t count, std::size_t size);
void* __libc_realloc(void* memory, std::size_t size);
void* __libc_memalign(std::size_t alignment, std::size_t size);

void* malloc(std::size_t size) {
  note();
  return __libc_malloc(size);
}
void* calloc(std::size_t count, std::size_t size) {
  note();
  return __libc_calloc(count, size);
}
void* realloc(void* memory, std::size_t size) {
  note();
  return __libc_realloc(memory, size);
}
void* memalign(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
void* aligned_alloc(std::size_t alignment, std::size_t size) {
  note();
  return __libc_memalign(alignment, size);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t size) {
  note();
  *memory = __libc_memalign(alignment, size);
  return *memory == nullptr ? ENOMEM : 0;
}
}

namespace leap_object_tracker {
namespace {

/// Allocations of one call on average, after calls enough to settle.
template <class Call>
double allocationsOf(const Call& call) {
  constexpr int kCalls = 20;
  for (int i = 0; i < 2 * kCalls; ++i) call(i);
  allocations = 0;
  counting = true;
  for (int i = 0; i < kCalls; ++i) call(2 * kCalls + i);
  counting = false;
  return static_cast<double>(allocations) / kCalls;
}

const Recording& frames() { return recording("x10_cube_textured", "640x240", 10); }

TEST(Allocations, areCounted) {
  EXPECT_GE(allocationsOf([](int) { delete new int; }), 0);
  std::vector<int> kept;
  EXPECT_GE(allocationsOf([&](int i) { std::vector<int>(1000 + i).swap(kept); }), 1);
}

TEST(Allocations, doNotHappenInRectification) {
  const StereoRectifier rectifier(frames().calibration, frames().camera);
  // Each eye in an image of its own, as messages bring them.
  const RawStereoFrame raw{frames().raw[0].stamp, frames().raw[0].left.clone(),
                           frames().raw[0].right.clone()};
  RectifiedStereoFrame rectified;
  tbb::task_arena arena(1);
  arena.execute(
      [&] { EXPECT_EQ(allocationsOf([&](int) { rectifier.rectify(raw, rectified); }), 0); });
}

TEST(Allocations, doNotHappenInTheParticleFilter) {
  const Observation seen(frames());
  const ContourModel model(frames().object, ContourParams().points);
  const auto eyes = seen.eyes();
  const BatchScorer scorer = [&](const ParticlePose* poses, std::size_t count, float* scores) {
    scoreContours(model, model.points(), eyes.data(), eyes.size(), 1 / 3.0F, poses, count, scores);
  };
  const Matrix6d covariance = 1e-6 * Matrix6d::Identity();
  const Pose& pose = frames().camera_from_object[0];
  ParticleFilter filter{FilterParams()};
  tbb::task_arena arena(1);
  arena.execute([&] {
    filter.initialize(pose, covariance, Twist::Zero(), covariance);
    EXPECT_EQ(allocationsOf([&](int) {
                filter.predict({}, 0.0087, Pose::Identity());
                filter.anneal(scorer, 0.2, 0.4);
                filter.weigh(scorer);
                filter.resample(0.5);
                filter.inject(0.5, pose, covariance, Twist::Zero(), covariance);
              }),
              0);
  });
}

TEST(Allocations, doNotHappenInEdgesAndGainMaps) {
  const Observation seen(frames());
  const cv::Mat& image = frames().rectified[0].left;
  EdgeField field;
  GainMap map;
  tbb::task_arena arena(1);
  arena.execute([&] {
    EXPECT_EQ(allocationsOf([&](int) { field.build(image, seen.regions()[0]); }), 0);
    EXPECT_EQ(allocationsOf([&](int) { field.transform({1.2F, 3.0F}, 1, map); }), 0);
  });
}

const Recording& cylinder() { return recording("x10_cylinder_textured", "640x240", 10); }

TEST(Allocations, ofFeaturesAreThoseOfFast) {
  const Observation seen(cylinder());
  const RectifiedStereoFrame& frame = cylinder().rectified[0];
  const Pose& pose = cylinder().camera_from_object[0];
  FeatureMeasurement measurement(FeatureParams(), cylinder().object, cylinder().camera);
  const auto poses = seen.particles(1000);
  std::vector<float> scores(poses.size());
  tbb::task_arena arena(1);
  arena.execute([&] {
    std::vector<cv::KeyPoint> found;
    const double of_fast = allocationsOf([&](int) { cv::FAST(frame.left, found, 10, true); });
    const auto observe = [&](int) { measurement.observe(frame, seen.regions(), pose, 0.0005); };
    EXPECT_LE(allocationsOf(observe), 2 * of_fast);
    EXPECT_EQ(allocationsOf([&](int) {
                measurement.score(poses.data(), poses.size(), scores.data());
                measurement.refine({pose, 1e6 * Matrix6d::Identity()});
              }),
              0);
    EXPECT_EQ(allocationsOf([&](int) { measurement.learn(pose, 0.0002, 0.002); }), 0);
  });
}

/// Of a tracked frame, after frames enough to settle.
double allocationsOfAFrame(const Recording& recording, Measurement measurement) {
  TrackerParams params;
  params.measurement = measurement;
  params.threads = 1;
  Tracker tracker(params, recording.object, recording.camera);
  tracker.start(recording.camera_from_object[0]);
  const Stamp::duration period = recording.raw[1].stamp - recording.raw[0].stamp;
  RectifiedStereoFrame frame = recording.rectified[0];
  const auto track = [&](int) {
    frame.stamp += period;
    ASSERT_TRUE(tracker.track(frame));
  };
  const double first = allocationsOf(track), later = allocationsOf(track);
  EXPECT_LE(later, first + 1);
  return later;
}

TEST(Allocations, ofAWholeFrameAreFewAndDoNotGrow) {
  const double contour = allocationsOfAFrame(frames(), Measurement::kContour);
  const double features = allocationsOfAFrame(cylinder(), Measurement::kBoth);
  std::printf("allocations a frame: %.1f, with features %.1f\n", contour, features);
  EXPECT_LE(contour, 8);    // lists of hypotheses
  EXPECT_LE(features, 32);  // and cv::FAST
}

}  // namespace
}  // namespace leap_object_tracker
