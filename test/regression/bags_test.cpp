// Every bag of expected.yaml, frame by frame through rectification and tracker. The same seed gives
// the same numbers, so the bounds are the measured values and a margin that the file states.
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <cmath>
#include <cstdio>
#include <limits>

#include "leap_object_tracker/evaluation/trajectory_error.hpp"
#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "ros/parameters.hpp"
#include "ros/stereo_bag.hpp"

namespace leap_object_tracker {
namespace {

struct Expected {
  std::string bag, object, config;
  double position_rms = 0;      ///< [mm] at most
  double orientation_rms = 0;   ///< [deg] at most
  double share_2mm_2deg = 0;    ///< at least
  int frames_without_pose = 0;  ///< at most
  bool from_truth = false;      ///< starts at the first true pose instead of a search
};

std::vector<Expected> readExpected() {
  std::vector<Expected> all;
  for (const auto& entry : YAML::LoadFile(LEAP_SOURCE_FOLDER "/test/regression/expected.yaml")) {
    Expected expected;
    expected.bag = entry["bag"].as<std::string>();
    expected.object = entry["object"].as<std::string>();
    expected.config = entry["config"].as<std::string>();
    expected.position_rms = entry["position_rms_mm"].as<double>();
    expected.orientation_rms = entry["orientation_rms_deg"].as<double>();
    expected.share_2mm_2deg = entry["share_2mm_2deg"].as<double>();
    expected.frames_without_pose = entry["frames_without_pose"].as<int>();
    expected.from_truth = entry["start"].as<std::string>() == "truth";
    all.push_back(expected);
  }
  return all;
}

struct Tracked {
  Trajectory truth, poses;
  std::vector<Stamp> frames;
  ObjectModel object;
};

/// @param most_frames the rest of the bag is left out
Tracked track(const Expected& expected, int threads,
              std::size_t most_frames = std::numeric_limits<std::size_t>::max()) {
  const std::string root = LEAP_SOURCE_FOLDER "/";
  const std::string config = root + "config/" + expected.config;
  ParameterReader reader(loadYamlFile(config), config);
  TrackerParams params = readTrackerNodeParams(reader).tracker;
  params.threads = threads;
  const StereoBag bag(root + "bags/" + expected.bag, {}, params.eyes);
  Tracked run;
  run.object = loadObject(root + "config/objects/" + expected.object);
  const StereoRectifier rectifier(bag.calibration(), rectifiedCamera(bag.calibration(), {}));
  Tracker tracker(params, run.object, rectifier.camera());
  if (expected.from_truth)
    tracker.start(bag.firstTruth().value().camera_from_object);
  else
    tracker.search();
  const auto rest = bag.forEachPair([&](const RawStereoFrame& raw) {
    if (run.frames.size() == most_frames) return;
    run.frames.push_back(raw.stamp);
    const auto estimate = tracker.track(rectifier.rectify(raw));
    if (estimate)
      run.poses.push_back({estimate->stamp, estimate->camera_from_object, estimate->covariance});
  });
  run.truth = rest.truth;
  return run;
}

class Bags : public testing::TestWithParam<Expected> {};

TEST_P(Bags, areTrackedWithinTheirBounds) {
  const Expected& expected = GetParam();
  const Tracked run = track(expected, 2);
  EvaluationParams params;
  params.frames = run.frames;
  const TrajectoryReport report = compare(run.poses, run.truth, run.object, params);
  const double position = 1e3 * report.position.rms,
               orientation = 180 / M_PI * report.orientation.rms;
  std::printf(
      "%s: position RMS %.3f mm, orientation RMS %.3f deg, %.1f %% within 2 mm and 2 deg, "
      "%d of %zu frames without pose\n",
      expected.bag.c_str(), position, orientation, 100 * report.within_2mm_2deg,
      report.without_pose, run.frames.size());
  EXPECT_LE(position, expected.position_rms);
  EXPECT_LE(orientation, expected.orientation_rms);
  EXPECT_GE(report.within_2mm_2deg, expected.share_2mm_2deg);
  EXPECT_LE(report.without_pose, expected.frames_without_pose);
}

TEST_P(Bags, giveTheSamePosesWhateverTheNumberOfThreads) {
  const Tracked one = track(GetParam(), 1, 15), three = track(GetParam(), 3, 15);
  ASSERT_GT(one.poses.size(), 10u);
  ASSERT_EQ(one.poses.size(), three.poses.size());
  for (std::size_t i = 0; i < one.poses.size(); ++i)
    EXPECT_EQ(one.poses[i].camera_from_object.matrix(), three.poses[i].camera_from_object.matrix());
}

INSTANTIATE_TEST_SUITE_P(Regression, Bags, testing::ValuesIn(readExpected()),
                         [](const auto& expected) {
                           const std::string& bag = expected.param.bag;
                           return bag.substr(0, bag.find('.'));
                         });

}  // namespace
}  // namespace leap_object_tracker
