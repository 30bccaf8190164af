#include "leap_object_tracker/evaluation/trajectory_error.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace leap_object_tracker {
namespace {

constexpr double kDegree = M_PI / 180.0;
constexpr double kPeriod = 0.025;  // [s]

const ObjectModel& cube() {
  static const ObjectModel object =
      makePrimitive("cube", Shape::kBox, Eigen::Vector3d(0.03, 0.03, 0.03));
  return object;
}

const ObjectModel& cylinder() {
  static const ObjectModel object =
      makePrimitive("cylinder", Shape::kCylinder, Eigen::Vector3d(0.015, 0.065, 0));
  return object;
}

/// Swings 3 cm to both sides at 2 Hz, 10 cm before the camera, turning meanwhile.
Pose swing(double time) {
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(0.03 * std::sin(4 * M_PI * time), 0.01, 0.1);
  pose.linear() = rotationFromVector({0.2 * std::sin(5 * time), 0.5 * time, 0.1});
  return pose;
}

StampedPose stamped(double time, const Pose& pose) { return {stampFromSeconds(time), pose, {}}; }

Trajectory swinging(int frames) {
  Trajectory trajectory;
  for (int i = 0; i < frames; ++i) trajectory.push_back(stamped(i * kPeriod, swing(i * kPeriod)));
  return trajectory;
}

TEST(StatisticsOf, areThoseOfAShortList) {
  const ErrorStatistics statistics = statisticsOf({4.0, 1.0, 2.0, 3.0, 0.0});
  EXPECT_DOUBLE_EQ(statistics.rms, std::sqrt(30.0 / 5.0));
  EXPECT_DOUBLE_EQ(statistics.mean, 2.0);
  EXPECT_DOUBLE_EQ(statistics.median, 2.0);
  EXPECT_DOUBLE_EQ(statistics.p95, 3.8);
  EXPECT_DOUBLE_EQ(statistics.largest, 4.0);
  EXPECT_TRUE(std::isnan(statisticsOf({}).rms));
}

TEST(SurfacePoints, lieOnTheSurfaceAndOnEveryFace) {
  std::array<int, 6> on_face{};
  for (const auto& point : surfacePoints(cube().mesh, 600)) {
    EXPECT_NEAR(point.cwiseAbs().maxCoeff(), 0.015, 1e-12);
    Eigen::Index axis = 0;
    point.cwiseAbs().maxCoeff(&axis);
    ++on_face[static_cast<std::size_t>(2 * axis + (point[axis] > 0))];
  }
  for (const int count : on_face) EXPECT_NEAR(count, 100, 15);
}

TEST(Compare, findsNoErrorInTheTruth) {
  const TrajectoryReport report = compare(swinging(80), swinging(80), cube());
  EXPECT_EQ(report.with_pose, 80);
  EXPECT_EQ(report.without_pose, 0);
  EXPECT_LT(report.position.largest, 1e-9);
  EXPECT_LT(report.orientation.largest, 1e-6);
  EXPECT_NEAR(report.add_auc, 1.0, 1e-6);
  EXPECT_DOUBLE_EQ(report.within_1mm_1deg, 1.0);
  EXPECT_TRUE(report.gaps.empty());
  ASSERT_TRUE(report.lag);
  EXPECT_NEAR(*report.lag, 0.0, 1e-9);
}

TEST(Compare, measuresAConstantOffset) {
  Trajectory estimate = swinging(80);
  for (auto& pose : estimate) pose.camera_from_object.translation().z() += 0.003;
  const TrajectoryReport report = compare(estimate, swinging(80), cube());
  EXPECT_NEAR(report.position.rms, 0.003, 1e-9);
  EXPECT_NEAR(report.axis_rms[2], 0.003, 1e-9);
  EXPECT_NEAR(report.axis_rms[0], 0.0, 1e-9);
  EXPECT_NEAR(report.add.mean, 0.003, 1e-9);
  EXPECT_NEAR(report.mssd.mean, 0.003, 1e-9);
  EXPECT_LT(report.add_s.mean, 0.003);
  EXPECT_NEAR(report.add_auc, 0.7, 1e-6);
  EXPECT_DOUBLE_EQ(report.within_2mm_2deg, 0.0);
  EXPECT_DOUBLE_EQ(report.within_5mm_5deg, 1.0);
  EXPECT_NEAR(report.jitter_position, 0.0, 1e-9);
}

TEST(Compare, forgivesAQuarterTurnOfACubeInAllButAdd) {
  Trajectory estimate = swinging(10);
  for (auto& pose : estimate) {
    pose.camera_from_object.linear() *= rotationFromVector({0, 0, M_PI / 2});
    pose.camera_from_object.linear() *= rotationFromVector({2 * kDegree, 0, 0});
  }
  const TrajectoryReport report = compare(estimate, swinging(10), cube());
  EXPECT_NEAR(report.orientation.rms, 2 * kDegree, 1e-6);
  // A corner is sqrt(2) * 15 mm away from the axis of the turn.
  EXPECT_NEAR(report.mssd.mean, std::sqrt(2.0) * 0.015 * 2 * std::sin(kDegree), 1e-6);
  EXPECT_GT(report.add.mean, 0.01);
  EXPECT_LT(report.add_s.mean, 0.001);
}

TEST(Compare, doesNotCountTheSpinOfACylinder) {
  Trajectory estimate = swinging(10);
  for (auto& pose : estimate) {
    pose.camera_from_object.linear() *= rotationFromVector({3 * kDegree, 0, 0});
    pose.camera_from_object.linear() *= rotationFromVector({0, 0, 1.234});
  }
  const TrajectoryReport report = compare(estimate, swinging(10), cylinder());
  EXPECT_NEAR(report.orientation.rms, 3 * kDegree, 1e-6);
}

TEST(Compare, countsFramesWithoutAPoseAsFailures) {
  Trajectory estimate = swinging(100);
  estimate.erase(estimate.begin() + 40, estimate.begin() + 60);
  const TrajectoryReport report = compare(estimate, swinging(100), cube());
  EXPECT_EQ(report.without_pose, 20);
  EXPECT_DOUBLE_EQ(report.within_2mm_2deg, 0.8);
  EXPECT_NEAR(report.add_auc, 0.8, 1e-6);
}

TEST(Compare, timesTheGapUntilAGoodPoseComesAgain) {
  Trajectory estimate = swinging(100);
  for (int i = 60; i < 64; ++i)
    estimate[static_cast<std::size_t>(i)].camera_from_object.translation().x() += 0.05;
  estimate.erase(estimate.begin() + 40, estimate.begin() + 60);
  const TrajectoryReport report = compare(estimate, swinging(100), cube());
  ASSERT_EQ(report.gaps.size(), 1u);
  EXPECT_NEAR(report.gaps[0].begin, 40 * kPeriod, 1e-6);
  EXPECT_NEAR(report.gaps[0].length, 24 * kPeriod, 1e-6);
  EXPECT_TRUE(report.gaps[0].closed);
  EXPECT_NEAR(report.wrong, 0.04, 1e-9);
}

TEST(Compare, tellsAnOpenGapAtTheEnd) {
  Trajectory estimate = swinging(100);
  estimate.resize(90);
  const TrajectoryReport report = compare(estimate, swinging(100), cube());
  ASSERT_EQ(report.gaps.size(), 1u);
  EXPECT_FALSE(report.gaps[0].closed);
}

TEST(Compare, timesTheFirstPoseAndTheFirstGoodOne) {
  Trajectory estimate = swinging(50);
  for (int i = 0; i < 8; ++i)
    estimate[static_cast<std::size_t>(i)].camera_from_object.translation().x() += 0.02;
  estimate.erase(estimate.begin(), estimate.begin() + 5);
  const TrajectoryReport report = compare(estimate, swinging(50), cube());
  ASSERT_TRUE(report.time_to_first_pose && report.time_to_good_pose);
  EXPECT_NEAR(*report.time_to_first_pose, 5 * kPeriod, 1e-6);
  EXPECT_NEAR(*report.time_to_good_pose, 8 * kPeriod, 1e-6);
}

TEST(Compare, findsTheLagOfALateEstimate) {
  Trajectory estimate;
  for (int i = 0; i < 160; ++i) estimate.push_back(stamped(i * kPeriod, swing(i * kPeriod - 0.03)));
  const TrajectoryReport report = compare(estimate, swinging(160), cube());
  ASSERT_TRUE(report.lag);
  EXPECT_NEAR(*report.lag, 0.03, 0.001);
}

TEST(Compare, hasNoLagForAnObjectAtRest) {
  Trajectory truth;
  for (int i = 0; i < 100; ++i) truth.push_back(stamped(i * kPeriod, swing(0)));
  EXPECT_FALSE(compare(truth, truth, cube()).lag);
}

TEST(Compare, measuresJitterWithoutBias) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.001);
  Trajectory estimate = swinging(4000), truth = swinging(4000);
  for (auto& pose : estimate)
    pose.camera_from_object.translation() +=
        Eigen::Vector3d(0.02 + noise(random), noise(random), noise(random));
  EvaluationParams params;
  params.surface_points = 1;
  const TrajectoryReport report = compare(estimate, truth, cube(), params);
  EXPECT_NEAR(report.jitter_position, std::sqrt(3.0) * 0.001, 0.00005);
}

TEST(Compare, sortsFramesIntoBandsOfTheirDepth) {
  Trajectory truth = swinging(4), estimate;
  const std::array<double, 4> depths{0.04, 0.12, 0.14, 0.40};
  for (std::size_t i = 0; i < 4; ++i) truth[i].camera_from_object.translation().z() = depths[i];
  estimate = truth;
  estimate[3].camera_from_object.translation().y() += 0.002;
  const TrajectoryReport report = compare(estimate, truth, cube());
  ASSERT_EQ(report.bands.size(), 3u);
  EXPECT_EQ(report.bands[0].frames, 1);
  EXPECT_EQ(report.bands[1].frames, 2);
  EXPECT_NEAR(report.bands[2].position.rms, 0.002, 1e-9);
}

/// An estimate that errs just as its covariance says, in all directions but the free one.
TrajectoryReport honestReport(const ObjectModel& object, double claimed_over_true) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  const Trajectory truth = swinging(1000);
  Trajectory estimate = truth;
  for (auto& pose : estimate) {
    Pose& p = pose.camera_from_object;
    for (int i = 0; i < 3; ++i) p.translation()[i] += 0.001 * normal(random);
    const Eigen::Vector3d turn(normal(random), normal(random), normal(random));
    p.linear() = rotationFromVector(0.01 * turn) * p.linear();
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal() << 1e-6, 1e-6, 1e-6, 1e-4, 1e-4, 1e-4;
    pose.covariance = covariance * claimed_over_true * claimed_over_true;
  }
  EvaluationParams params;
  params.surface_points = 1;
  return compare(estimate, truth, object, params);
}

TEST(Compare, findsTheNeesOfAnHonestEstimateWithinItsBand) {
  const auto nees = honestReport(cube(), 1.0).nees;
  ASSERT_TRUE(nees);
  EXPECT_EQ(nees->degrees_of_freedom, 6);
  EXPECT_GT(nees->mean, nees->band_low);
  EXPECT_LT(nees->mean, nees->band_high);
  EXPECT_NEAR(nees->share_inside, 0.95, 0.02);
}

TEST(Compare, leavesTheFreeAxisOutOfTheNees) {
  const auto nees = honestReport(cylinder(), 1.0).nees;
  ASSERT_TRUE(nees);
  EXPECT_EQ(nees->degrees_of_freedom, 5);
  EXPECT_GT(nees->mean, nees->band_low);
  EXPECT_LT(nees->mean, nees->band_high);
}

TEST(Compare, findsAnOverconfidentEstimateAboveTheBand) {
  const auto nees = honestReport(cube(), 0.5).nees;
  ASSERT_TRUE(nees);
  EXPECT_NEAR(nees->mean, 24.0, 1.5);
  EXPECT_GT(nees->mean, nees->band_high);
}

TEST(Compare, usesTheFramesThatAPoseWasDueFor) {
  EvaluationParams params;
  for (int i = 0; i < 10; ++i) params.frames.push_back(stampFromSeconds(0.1 * i + 0.0101));
  Trajectory estimate;
  for (const Stamp stamp : params.frames)
    estimate.push_back(stamped(seconds(stamp), swing(seconds(stamp))));
  const TrajectoryReport report = compare(estimate, swinging(80), cube(), params);
  EXPECT_EQ(report.frames.size(), 10u);
  // The truth is interpolated over 25 ms: at most a/8 * dt^2 = 0.37 mm off.
  EXPECT_LT(report.position.largest, 0.0004);
}

TEST(Compare, refusesAnEmptyTruthAndAnotherClock) {
  EXPECT_THROW(compare(swinging(3), {}, cube()), std::invalid_argument);
  Trajectory later = swinging(3);
  for (auto& pose : later) pose.stamp += std::chrono::hours(1);
  EXPECT_THROW(compare(later, swinging(3), cube()), std::invalid_argument);
}

TEST(Compare, reportsARunWithoutAnyPose) {
  const TrajectoryReport report = compare({}, swinging(5), cube());
  EXPECT_EQ(report.without_pose, 5);
  EXPECT_FALSE(report.time_to_first_pose);
  EXPECT_DOUBLE_EQ(report.add_auc, 0.0);
}

}  // namespace
}  // namespace leap_object_tracker
