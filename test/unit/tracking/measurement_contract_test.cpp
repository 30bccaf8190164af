#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "leap_object_tracker/tracking/contour_measurement.hpp"
#include "leap_object_tracker/tracking/feature_measurement.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "support/textured_box.hpp"

namespace leap_object_tracker {
namespace {

constexpr double kPeriod = 0.02;  // [s]

/// What every way to measure a pose must keep to, on a painted box.
class MeasurementContract : public testing::TestWithParam<Measurement> {
 protected:
  MeasurementContract() : object_(makePrimitive("box", Shape::kBox, size_)) {
    camera_.focal_length = 130;
    camera_.center_u = 199.5;
    camera_.center_v = 99.5;
    camera_.baseline = 0.04;
    camera_.size = cv::Size(400, 200);
    true_pose_.translation() = Eigen::Vector3d(0.015, 0, 0.1);
    true_pose_.linear() = rotationFromVector({0.5, 0.4, 0.1});
    model_ = std::make_unique<ContourModel>(object_, 96);
    contour_ = std::make_unique<ContourMeasurement>(ContourParams(), Eyes::kBoth, camera_);
    features_ = std::make_unique<FeatureMeasurement>(FeatureParams(), object_, camera_);
    observe(pictureOf(true_pose_), true_pose_);
    features_->learn(true_pose_, 0.0003, 0.003);
    observe(pictureOf(true_pose_), true_pose_);
  }

  RectifiedStereoFrame pictureOf(const Pose& pose, int frame = 0) const {
    RectifiedStereoFrame picture = paintedBox(size_, pose, camera_);
    picture.stamp = stampFromSeconds(1 + kPeriod * frame);
    return picture;
  }

  RectifiedStereoFrame emptyPicture(int frame = 0) const {
    RectifiedStereoFrame picture;
    picture.left = cv::Mat(camera_.size, CV_8UC1, cv::Scalar(5));
    picture.right = picture.left.clone();
    picture.stamp = stampFromSeconds(1 + kPeriod * frame);
    return picture;
  }

  void observe(const RectifiedStereoFrame& frame, const Pose& predicted) {
    const cv::Rect whole(cv::Point(), camera_.size);
    contour_->observe(frame, {whole, whole});
    features_->observe(frame, {whole, whole}, predicted, 0.003);
  }

  void score(const std::vector<ParticlePose>& poses, std::vector<float>& scores) const {
    std::vector<float> of_contour(poses.size(), 0), of_features(poses.size(), 0);
    if (GetParam() != Measurement::kFeature)
      contour_->score(*model_, ContourMeasurement::Sharpness::kSharp, poses.data(), poses.size(),
                      of_contour.data());
    if (GetParam() != Measurement::kContour)
      features_->score(poses.data(), poses.size(), of_features.data());
    scores.resize(poses.size());
    std::transform(of_contour.begin(), of_contour.end(), of_features.begin(), scores.begin(),
                   [](float a, float b) { return a + b; });
  }

  float scoreOf(const Pose& pose) const {
    std::vector<float> scores;
    score({toParticlePose(pose)}, scores);
    return scores.front();
  }

  Pose nudged(int axis, double amount) const {
    Twist twist = Twist::Zero();
    twist[axis] = amount;
    return movedInCamera(true_pose_, twist);
  }

  TrackerParams params() const {
    TrackerParams params;
    params.measurement = GetParam();
    return params;
  }

  /// The box on its way, after so many frames.
  Pose truthAt(int frame) const {
    const double t = frame * kPeriod;
    Pose pose = true_pose_;
    pose.translation() += Eigen::Vector3d(0.01 * std::sin(3 * t), 0, 0.01 * std::sin(2 * t));
    pose.linear() = rotationFromVector({0, 0.4 * std::sin(2 * t), 0}) * pose.linear();
    return pose;
  }

  const Eigen::Vector3d size_{0.03, 0.03, 0.03};
  const ObjectModel object_;
  RectifiedStereoCamera camera_;
  Pose true_pose_ = Pose::Identity();
  std::unique_ptr<ContourModel> model_;
  std::unique_ptr<ContourMeasurement> contour_;
  std::unique_ptr<FeatureMeasurement> features_;
};

TEST_P(MeasurementContract, scoresTheTruePoseAboveOneNudgedAlongAnyAxis) {
  const float best = scoreOf(true_pose_);
  EXPECT_GT(best, 5);
  for (int axis = 0; axis < 6; ++axis)
    for (const double sign : {-1.0, 1.0})
      EXPECT_GT(best, scoreOf(nudged(axis, sign * (axis < 2    ? 0.003
                                                   : axis == 2 ? 0.006
                                                               : 0.12))))
          << "axis " << axis << ", sign " << sign;
}

TEST_P(MeasurementContract, isFiniteBehindAndInsideTheCamera) {
  for (const double depth : {-0.2, -0.01, 0.0, 0.001, 0.02}) {
    Pose pose = true_pose_;
    pose.translation().z() = depth;
    EXPECT_TRUE(std::isfinite(scoreOf(pose))) << depth;
  }
}

TEST_P(MeasurementContract, givesAFarCollapsedPoseNothing) {
  Pose far = true_pose_;
  far.translation() *= 20;
  EXPECT_LT(std::abs(scoreOf(far)), 0.05F * scoreOf(true_pose_));
}

TEST_P(MeasurementContract, hasNothingToSayWhereNoObjectIs) {
  observe(emptyPicture(), true_pose_);
  EXPECT_LE(scoreOf(true_pose_), 0.01F);
}

TEST_P(MeasurementContract, saysTheSameWhenAskedAgain) {
  const float first = scoreOf(true_pose_);
  EXPECT_EQ(scoreOf(true_pose_), first);
  observe(pictureOf(true_pose_), true_pose_);
  EXPECT_EQ(scoreOf(true_pose_), first);
}

TEST_P(MeasurementContract, isNotPulledTowardsThePrediction) {
  const float here = scoreOf(true_pose_);
  observe(pictureOf(true_pose_), nudged(0, 0.001));
  EXPECT_NEAR(scoreOf(true_pose_), here, 0.1F * here);
}

TEST_P(MeasurementContract, scoresABatchAsEachPoseOfIt) {
  std::vector<ParticlePose> poses;
  for (int i = 0; i < 100; ++i) poses.push_back(toParticlePose(nudged(i % 6, 2e-5 * i)));
  std::vector<float> scores;
  score(poses, scores);
  for (int i = 0; i < 100; i += 13)
    EXPECT_NEAR(scores[static_cast<std::size_t>(i)], scoreOf(nudged(i % 6, 2e-5 * i)),
                1e-4F * scores[0]);
}

TEST_P(MeasurementContract, followsAMovingBox) {
  Tracker tracker(params(), object_, camera_);
  tracker.start(truthAt(0));
  for (int frame = 0; frame < 20; ++frame) {
    const auto estimate = tracker.track(pictureOf(truthAt(frame), frame));
    ASSERT_TRUE(estimate) << frame;
    const Pose& pose = estimate->camera_from_object;
    EXPECT_LT((pose.translation() - truthAt(frame).translation()).norm(), 0.0015) << frame;
    EXPECT_LT(angleBetween(pose.linear(), truthAt(frame).linear()), 0.06) << frame;
  }
}

TEST_P(MeasurementContract, hasTheSamePosesWhateverTheNumberOfThreads) {
  TrackerParams one = params(), two = params();
  one.threads = 1;
  two.threads = 2;
  Tracker first(one, object_, camera_), second(two, object_, camera_);
  first.start(truthAt(0));
  second.start(truthAt(0));
  for (int frame = 0; frame < 6; ++frame) {
    const auto a = first.track(pictureOf(truthAt(frame), frame));
    const auto b = second.track(pictureOf(truthAt(frame), frame));
    ASSERT_TRUE(a && b) << frame;
    EXPECT_TRUE(a->camera_from_object.isApprox(b->camera_from_object, 0.0)) << frame;
  }
}

TEST_P(MeasurementContract, goesOnWithOneEye) {
  Tracker tracker(params(), object_, camera_);
  tracker.start(truthAt(0));
  for (int frame = 0; frame < 12; ++frame) {
    RectifiedStereoFrame picture = pictureOf(truthAt(frame), frame);
    if (frame >= 4 && frame < 6) picture.right = cv::Mat();
    tracker.track(picture);
  }
  EXPECT_EQ(tracker.report().state, TrackerState::kTracking);
}

TEST_P(MeasurementContract, givesUpABoxThatIsGone) {
  Tracker tracker(params(), object_, camera_);
  tracker.start(truthAt(0));
  int frame = 0;
  for (; frame < 6; ++frame) tracker.track(pictureOf(truthAt(frame), frame));
  for (; frame < 14; ++frame) tracker.track(emptyPicture(frame));
  EXPECT_NE(tracker.report().state, TrackerState::kTracking);
}

std::string nameOf(const testing::TestParamInfo<Measurement>& info) {
  switch (info.param) {
    case Measurement::kContour:
      return "contour";
    case Measurement::kFeature:
      return "feature";
    case Measurement::kBoth:
      return "both";
    case Measurement::kAuto:
      break;
  }
  return "auto";
}

INSTANTIATE_TEST_SUITE_P(All, MeasurementContract,
                         testing::Values(Measurement::kContour, Measurement::kFeature,
                                         Measurement::kBoth, Measurement::kAuto),
                         nameOf);

}  // namespace
}  // namespace leap_object_tracker
