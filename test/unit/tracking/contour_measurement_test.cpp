#include "leap_object_tracker/tracking/contour_measurement.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "drawn_box.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"

namespace leap_object_tracker {
namespace {

using Sharpness = ContourMeasurement::Sharpness;

class DrawnBox : public ::testing::Test {
 protected:
  DrawnBox() : model_(object_, 96), measurement_(ContourParams(), Eyes::kBoth, camera_) {
    observe(truth_);
  }

  void observe(const Pose& pose) {
    const cv::Rect left(260, 160, 140, 140), right(220, 160, 140, 140);
    measurement_.observe(drawnFrame(object_, pose, camera_), {left, right});
  }

  float score(const Pose& pose, Sharpness sharpness) const {
    const ParticlePose particle = toParticlePose(pose);
    float value = NAN;
    measurement_.score(model_, sharpness, &particle, 1, &value);
    return value;
  }

  const RectifiedStereoCamera camera_ = roundCamera();
  const ObjectModel object_ = box(0.03, 0.04, 0.05);
  const Pose truth_ = poseAt(0.01, -0.01, 0.12);
  const ContourModel model_;
  ContourMeasurement measurement_;
};

TEST_F(DrawnBox, scoresTheTruePoseAboveOneNudgedAlongAnyAxis) {
  for (const Sharpness sharpness : {Sharpness::kBlunt, Sharpness::kSharp})
    for (int axis = 0; axis < 6; ++axis)
      for (const double sign : {-1.0, 1.0}) {
        Twist nudge = Twist::Zero();
        nudge[axis] = sign * (axis < 2 ? 0.004 : axis == 2 ? 0.012 : 0.15);
        EXPECT_GT(score(truth_, sharpness), score(movedInCamera(truth_, nudge), sharpness))
            << "axis " << axis << " sign " << sign;
      }
}

TEST_F(DrawnBox, givesAFarCollapsedProjectionNothing) {
  Pose far = truth_;
  far.translation() *= 20;
  EXPECT_LT(std::abs(score(far, Sharpness::kSharp)), 0.05F * score(truth_, Sharpness::kSharp));
}

TEST_F(DrawnBox, isFiniteBehindAndInsideTheCamera) {
  for (const double depth : {-0.2, -0.01, 0.0, 0.001, 0.02}) {
    Pose pose = truth_;
    pose.translation().z() = depth;
    EXPECT_TRUE(std::isfinite(score(pose, Sharpness::kSharp))) << depth;
  }
}

TEST_F(DrawnBox, scoresAnEmptyFrameZeroOrLess) {
  RectifiedStereoFrame dark;
  dark.left = cv::Mat(camera_.size, CV_8UC1, cv::Scalar(3));
  dark.right = dark.left.clone();
  const cv::Rect whole(cv::Point(), camera_.size);
  measurement_.observe(dark, {whole, whole});
  EXPECT_LE(score(truth_, Sharpness::kSharp), 0);
}

TEST_F(DrawnBox, gainsFromTheSecondEye) {
  const float both = score(truth_, Sharpness::kSharp);
  ContourMeasurement left(ContourParams(), Eyes::kLeft, camera_);
  const cv::Rect whole(cv::Point(), camera_.size);
  left.observe(drawnFrame(object_, truth_, camera_), {measurement_.fields()[0].region(), whole});
  const ParticlePose particle = toParticlePose(truth_);
  float one = 0;
  left.score(model_, Sharpness::kSharp, &particle, 1, &one);
  EXPECT_GT(one, 0.3F * both);
  EXPECT_LT(one, 0.7F * both);
}

TEST_F(DrawnBox, scoresTheSameWithEveryInstructionSet) {
  const float reference = score(truth_, Sharpness::kSharp);
  for (const std::string& target : contourKernelTargets()) {
    useContourKernelTarget(target);
    EXPECT_NEAR(score(truth_, Sharpness::kSharp), reference, 0.01F * reference) << target;
  }
  useContourKernelTarget("");
  EXPECT_THROW(useContourKernelTarget("abacus"), std::invalid_argument);
}

TEST_F(DrawnBox, isRefinedToAFractionOfAMillimetre) {
  const PoseRefiner refiner(ContourParams(), camera_);
  for (int axis = 0; axis < 6; ++axis) {
    Twist nudge = Twist::Zero();
    nudge[axis] = axis < 3 ? 0.002 : 0.04;
    const RefinedPose refined =
        refiner.refine(model_, measurement_.fields(), movedInCamera(truth_, nudge), {},
                       Appearance(), {8, 5, 3, 2.5, 2.5});
    const Twist error = cameraTwistBetween(truth_, refined.camera_from_object);
    EXPECT_LT(error.head<3>().norm(), 0.0004) << "axis " << axis;
    EXPECT_LT(error.tail<3>().norm(), 0.012) << "axis " << axis;
    EXPECT_GT(refined.support(), 0.9);
  }
}

TEST_F(DrawnBox, supportsNoPoseWhereNothingIs) {
  const PoseRefiner refiner(ContourParams(), camera_);
  const RefinedPose refined = refiner.refine(model_, measurement_.fields(),
                                             poseAt(-0.08, 0.05, 0.15), {}, Appearance(), {2.5});
  EXPECT_LT(refined.support(), 0.1);
}

TEST_F(DrawnBox, isNotPulledByWhatHidesItFromOneEye) {
  const PoseRefiner refiner(ContourParams(), camera_);
  Pose straight = Pose::Identity();
  straight.translation() << 0.02, 0, 0.15;
  RectifiedStereoFrame frame = drawnFrame(object_, straight, camera_);
  // A card, one edge of which runs beside the object's.
  const Eigen::Vector3d side = straight * Eigen::Vector3d(0.015, 0, -0.025);
  const int u = cvRound(camera_.leftPixel(side - Eigen::Vector3d(camera_.baseline, 0, 0)).x()) + 2;
  frame.right = 4;
  cv::rectangle(frame.right, cv::Rect(0, 0, u, camera_.size.height), cv::Scalar(190), cv::FILLED);
  measurement_.observe(frame, {cv::Rect(260, 160, 140, 140), cv::Rect(220, 160, 140, 140)});
  PosePrior prior{straight, Matrix6d::Zero()};
  prior.information.diagonal() << Eigen::Vector3d::Constant(1 / (0.003 * 0.003)),
      Eigen::Vector3d::Constant(1 / (0.03 * 0.03));
  const RefinedPose refined =
      refiner.refine(model_, measurement_.fields(), straight, prior, Appearance(), {6, 4, 3, 2.5});
  const Twist error = cameraTwistBetween(straight, refined.camera_from_object);
  EXPECT_LT(error.head<3>().norm(), 0.0005);
  EXPECT_LT(error.tail<3>().norm(), 0.0015);
  EXPECT_GT(refined.eyes[0].share(), 0.9);
  EXPECT_LT(refined.eyes[1].share(), 0.5);
  EXPECT_EQ(refined.bestEyeSupport(), refined.eyes[0].share());
}

TEST_F(DrawnBox, missesAnOutlineMoreWhereItWouldShow) {
  const PoseRefiner refiner(ContourParams(), camera_);
  Pose straight = Pose::Identity();
  straight.translation() << 0.02, 0, 0.15;
  const auto judged = [&](int beyond, std::uint8_t grey) {
    RectifiedStereoFrame frame = drawnFrame(object_, straight, camera_);
    for (int eye = 0; eye < 2; ++eye) {
      Eigen::Vector3d corner = straight * Eigen::Vector3d(-0.015, 0, -0.025);
      corner.x() -= eye * camera_.baseline;
      const int u = cvRound(camera_.leftPixel(corner).x());
      cv::Mat& image = eye == 0 ? frame.left : frame.right;
      cv::rectangle(image, cv::Rect(beyond < 0 ? u - 8 : u - 2, 224, 10, 32), cv::Scalar(grey),
                    cv::FILLED);
    }
    measurement_.observe(frame, {cv::Rect(260, 160, 140, 140), cv::Rect(220, 160, 140, 140)});
    return refiner.refine(model_, measurement_.fields(), straight, {}, Appearance(), {});
  };
  // What is behind one side is as bright as the object, or that side is as dark as what is behind.
  const RefinedPose bright = judged(-1, 200), dark = judged(1, 4);
  EXPECT_NEAR(bright.support(), dark.support(), 0.1);
  EXPECT_GT(dark.evidence, bright.evidence + 2);
  EXPECT_GT(dark.strength(), bright.strength());
}

}  // namespace
}  // namespace leap_object_tracker
