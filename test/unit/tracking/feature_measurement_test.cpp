#include "leap_object_tracker/tracking/feature_measurement.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>

#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "support/textured_box.hpp"

namespace leap_object_tracker {
namespace {

const Eigen::Vector3d kSize(0.03, 0.03, 0.03);

class FeatureMeasurementOfABox : public testing::Test {
 protected:
  FeatureMeasurementOfABox()
      : object_(makePrimitive("box", Shape::kBox, kSize)),
        measurement_(FeatureParams(), object_, camera()) {
    true_pose_.translation() = Eigen::Vector3d(0.015, 0, 0.1);
    true_pose_.linear() = rotationFromVector({0.5, 0.4, 0});
  }

  static RectifiedStereoCamera camera() {
    RectifiedStereoCamera camera;
    camera.focal_length = 130;
    camera.center_u = 199.5;
    camera.center_v = 99.5;
    camera.baseline = 0.04;
    camera.size = cv::Size(400, 200);
    return camera;
  }

  void observe(const Pose& pose, const Pose& predicted) {
    const cv::Rect whole(cv::Point(), camera().size);
    measurement_.observe(paintedBox(kSize, pose, camera()), {whole, whole}, predicted, 0.003);
  }

  /// Sees the box twice, so that all its features can become landmarks, then once more.
  void learnAndObserve() {
    observe(true_pose_, true_pose_);
    measurement_.learn(true_pose_, 0.0003, 0.003);
    observe(true_pose_, true_pose_);
  }

  float scoreOf(const Pose& pose) const {
    const ParticlePose particle = toParticlePose(pose);
    float score = 0;
    measurement_.score(&particle, 1, &score);
    return score;
  }

  Pose nudged(int axis, double amount) const {
    Twist twist = Twist::Zero();
    twist[axis] = amount;
    return movedInCamera(true_pose_, twist);
  }

  ObjectModel object_;
  FeatureMeasurement measurement_;
  Pose true_pose_ = Pose::Identity();
};

TEST_F(FeatureMeasurementOfABox, fallsWhenNudgedAlongEachAxisOnceLandmarksAreKnown) {
  learnAndObserve();
  const float best = scoreOf(true_pose_);
  EXPECT_GT(best, 10);
  for (int axis = 0; axis < 6; ++axis)
    for (const double sign : {-1.0, 1.0})
      EXPECT_LT(scoreOf(nudged(axis, sign * (axis < 3 ? 0.002 : 0.1))), 0.8 * best)
          << "axis " << axis << ", sign " << sign;
}

TEST_F(FeatureMeasurementOfABox, isFiniteBehindTheCameraAndZeroFarAway) {
  learnAndObserve();
  Pose behind = true_pose_;
  behind.translation().z() = -0.1;
  EXPECT_TRUE(std::isfinite(scoreOf(behind)));
  EXPECT_NEAR(scoreOf(behind), 0, 0.01);
}

TEST_F(FeatureMeasurementOfABox, saysTheSameTwice) {
  learnAndObserve();
  const float first = scoreOf(true_pose_);
  EXPECT_EQ(scoreOf(true_pose_), first);
  observe(true_pose_, true_pose_);
  EXPECT_EQ(scoreOf(true_pose_), first);
}

TEST_F(FeatureMeasurementOfABox, isNotPulledTowardsThePrediction) {
  learnAndObserve();
  const float here = scoreOf(true_pose_);
  observe(true_pose_, nudged(0, 0.001));
  EXPECT_NEAR(scoreOf(true_pose_), here, 0.1 * here);
}

TEST_F(FeatureMeasurementOfABox, scoresABatchAsItScoresEachPose) {
  learnAndObserve();
  std::vector<ParticlePose> poses;
  std::vector<float> scores(300);
  for (int i = 0; i < 300; ++i) poses.push_back(toParticlePose(nudged(i % 6, 1e-5 * i)));
  measurement_.score(poses.data(), poses.size(), scores.data());
  for (int i = 0; i < 300; i += 37)
    EXPECT_EQ(scores[static_cast<std::size_t>(i)], scoreOf(nudged(i % 6, 1e-5 * i)));
}

TEST_F(FeatureMeasurementOfABox, hasAGradientThatIsTheSlopeOfItsScore) {
  learnAndObserve();
  Twist offset;
  offset << 0.0002, -0.0003, 0.0004, 0.01, -0.008, 0.006;
  const Pose place = movedInCamera(true_pose_, offset);
  const Twist gradient = measurement_.support(place).gradient;
  for (int axis = 0; axis < 6; ++axis) {
    const double step = axis < 3 ? 2e-6 : 1e-4;
    Twist twist = Twist::Zero();
    twist[axis] = step;
    const double slope = (measurement_.support(movedInCamera(place, twist)).log_likelihood -
                          measurement_.support(movedInCamera(place, -twist)).log_likelihood) /
                         (2 * step);
    EXPECT_NEAR(gradient[axis], slope,
                0.03 * gradient.norm() / std::sqrt(6.0) + 0.03 * std::abs(slope))
        << "axis " << axis;
  }
}

TEST_F(FeatureMeasurementOfABox, bringsADisplacedPoseBackByGaussNewton) {
  learnAndObserve();
  Twist offset;
  offset << 0.001, -0.0015, 0.001, 0.04, -0.03, 0.03;
  const Pose start = movedInCamera(true_pose_, offset);
  observe(true_pose_, start);
  PosePrior prior{start, Matrix6d::Zero()};
  prior.information.diagonal() << Eigen::Vector3d::Constant(1 / std::pow(0.003, 2)),
      Eigen::Vector3d::Constant(1 / std::pow(0.1, 2));
  const Pose pose = measurement_.refine(prior).mean;
  EXPECT_LT((pose.translation() - true_pose_.translation()).norm(), 0.0004);
  EXPECT_LT(angleBetween(pose.linear(), true_pose_.linear()), 0.012);
}

TEST_F(FeatureMeasurementOfABox, leavesThePriorAloneWithoutFeatures) {
  const PosePrior prior{true_pose_, Matrix6d::Identity()};
  const PosePrior posterior = measurement_.refine(prior);
  EXPECT_TRUE(posterior.mean.isApprox(prior.mean, 1e-12));
  EXPECT_TRUE(posterior.information.isApprox(prior.information));
}

TEST_F(FeatureMeasurementOfABox, knowsItsLandmarksWhenTheCameraIsRolled) {
  learnAndObserve();
  Pose rolled = true_pose_;
  rolled.linear() = rotationFromVector({0, 0, 0.7}) * rolled.linear();
  observe(rolled, rolled);
  EXPECT_GE(measurement_.support(rolled).landmark_points, 8);
}

TEST_F(FeatureMeasurementOfABox, findsThePoseFromLandmarksAlone) {
  learnAndObserve();
  Pose elsewhere = true_pose_;
  elsewhere.translation() += Eigen::Vector3d(-0.02, 0.01, 0.004);
  observe(elsewhere, elsewhere);
  const auto found = measurement_.locate();
  ASSERT_TRUE(found);
  EXPECT_LT((found->translation() - elsewhere.translation()).norm(), 0.001);
  EXPECT_LT(angleBetween(found->linear(), elsewhere.linear()), 0.05);
}

TEST_F(FeatureMeasurementOfABox, keepsItsLandmarksInAFile) {
  learnAndObserve();
  const std::string path = testing::TempDir() + "landmarks.yaml";
  measurement_.landmarks().save(path, "box");
  const float here = scoreOf(true_pose_);
  const std::size_t count = measurement_.landmarks().landmarks().size();
  measurement_.landmarks().clear();
  observe(true_pose_, true_pose_);
  EXPECT_LT(scoreOf(true_pose_), 0.8 * here);
  measurement_.landmarks().load(path, "box");
  EXPECT_EQ(measurement_.landmarks().landmarks().size(), count);
  observe(true_pose_, true_pose_);
  EXPECT_NEAR(scoreOf(true_pose_), here, 0.01 * here);
  EXPECT_THROW(measurement_.landmarks().load(path, "mug"), std::runtime_error);
  std::remove(path.c_str());
}

TEST(LandmarkMap, refusesFilesOfAnotherKind) {
  const std::string path = testing::TempDir() + "no_landmarks.yaml";
  LandmarkMap map(10);
  EXPECT_THROW(map.load(path, "box"), std::runtime_error);
  std::ofstream(path) << "%YAML:1.0\n---\nformat: other\n";
  EXPECT_THROW(map.load(path, "box"), std::runtime_error);
  std::ofstream(path) << "no yaml at all {";
  EXPECT_THROW(map.load(path, "box"), std::runtime_error);
  std::remove(path.c_str());
}

TEST_F(FeatureMeasurementOfABox, forgetsLandmarksBeyondItsCapacity) {
  FeatureParams params;
  params.landmarks = 10;
  measurement_ = FeatureMeasurement(params, object_, camera());
  learnAndObserve();
  EXPECT_EQ(measurement_.landmarks().landmarks().size(), 10u);
}

}  // namespace
}  // namespace leap_object_tracker
