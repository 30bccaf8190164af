#include "leap_object_tracker/tracking/textured_surface.hpp"

#include <gtest/gtest.h>

#include "cast_body.hpp"
#include "drawn_box.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"

namespace leap_object_tracker {
namespace {

class Texture : public ::testing::Test {
 protected:
  void show(double checks) {
    Look look;
    look.checks = checks;
    look.rays = 3;
    const RectifiedStereoFrame frame = castFrame(body_.mesh, truth_, camera_, look);
    const cv::Rect where(200, 140, 240, 200);
    fields_[0].build(frame.left, where);
    fields_[1].build(frame.right, where);
  }

  void learn(TexturedSurface& surface) {
    for (int frame = 0; frame < 8; ++frame) {
      surface.look(fields_, truth_);
      surface.learn(fields_, truth_);
    }
    surface.look(fields_, truth_);
  }

  /// Gauss-Newton on the evidence alone, of the axes that count.
  Pose align(const TexturedSurface& surface, Pose pose, const Twist& free) const {
    for (int step = 0; step < 12; ++step) {
      SurfaceEvidence evidence = surface.evidence(fields_, pose);
      evidence.information.diagonal() += (1e12 * (Twist::Ones() - free)).eval();
      pose = normalized(movedInCamera(pose, evidence.information.ldlt().solve(evidence.gradient)));
    }
    return pose;
  }

  double tiltBetween(const Pose& a, const Pose& b) const {
    return vectorFromRotation(a.linear() * b.linear().transpose()).norm();
  }

  const RectifiedStereoCamera camera_ = roundCamera();
  ObjectModel body_ = box(0.05, 0.05, 0.02);
  const Pose truth_ = aslant();
  std::array<EdgeField, 2> fields_;
};

TEST_F(Texture, ofOneFrameTellsDepthAndTilt) {
  show(0.011);
  TexturedSurface surface(body_, camera_);
  surface.look(fields_, truth_);
  Twist nudge = Twist::Zero(), free = Twist::Zero();
  nudge.tail<4>() << 0.001, 0.03, -0.03, 0;
  free.segment<3>(2).setOnes();
  const Pose start = movedInCamera(truth_, nudge);
  EXPECT_LT(surface.evidence(fields_, start).log_likelihood,
            surface.evidence(fields_, truth_).log_likelihood - 2);
  const Pose aligned = align(surface, start, free);
  EXPECT_NEAR(aligned.translation().z(), truth_.translation().z(), 1e-4);
  EXPECT_LT(tiltBetween(aligned, truth_), 0.3 * tiltBetween(start, truth_));
}

TEST_F(Texture, thatIsLearnedTellsTheWholePose) {
  show(0.011);
  TexturedSurface surface(body_, camera_);
  learn(surface);
  Twist nudge;
  nudge << 0.0008, -0.0008, 0.001, 0.02, -0.02, 0.02;
  const Pose aligned = align(surface, movedInCamera(truth_, nudge), Twist::Ones());
  EXPECT_LT((aligned.translation() - truth_.translation()).norm(), 5e-5);
  EXPECT_LT(tiltBetween(aligned, truth_), 0.003);
}

TEST_F(Texture, supportsThePoseItIsSeenAtOnly) {
  show(0.011);
  TexturedSurface surface(body_, camera_);
  EXPECT_EQ(surface.support(fields_, truth_), 0);  // nothing was learned
  learn(surface);
  EXPECT_GT(surface.support(fields_, truth_), 0.95);
  Twist nudge = Twist::Zero();
  nudge.head<2>() << 0.004, 0.003;
  EXPECT_LT(surface.support(fields_, movedInCamera(truth_, nudge)), 0.6);
  surface.forget();
  surface.look(fields_, truth_);
  EXPECT_EQ(surface.support(fields_, truth_), 0);
}

TEST_F(Texture, isNotSeenInTheDark) {
  show(0.011);
  TexturedSurface surface(body_, camera_);
  learn(surface);
  const cv::Rect where(200, 140, 240, 200);
  const cv::Mat dark(camera_.size, CV_8UC1, cv::Scalar(3));
  for (EdgeField& field : fields_) field.build(dark, where);
  EXPECT_EQ(surface.support(fields_, truth_), 0);
}

TEST_F(Texture, isMatchedThoughAnEyeIsDarker) {
  show(0.011);
  TexturedSurface surface(body_, camera_);
  surface.look(fields_, truth_);
  const double before = surface.evidence(fields_, truth_).log_likelihood;
  RectifiedStereoFrame frame;
  fields_[1].image().convertTo(frame.right, -1, 0.9);
  cv::Mat whole(camera_.size, CV_8UC1, cv::Scalar(4));
  frame.right.copyTo(whole(fields_[1].region()));
  const cv::Rect where = fields_[1].region();
  fields_[1].build(whole, where);
  surface.look(fields_, truth_);
  EXPECT_LT(before, 0);
  EXPECT_GT(surface.evidence(fields_, truth_).log_likelihood, 2 * before - 1);
}

TEST_F(Texture, ofAPlainBodySaysNothing) {
  show(0);
  TexturedSurface surface(body_, camera_);
  learn(surface);
  EXPECT_EQ(surface.evidence(fields_, truth_).log_likelihood, 0);
  EXPECT_TRUE(surface.evidence(fields_, truth_).information.isZero());
}

TEST_F(Texture, isNotLookedForWhereThereIsSaidToBeNone) {
  show(0.011);
  body_.textured = false;
  TexturedSurface surface(body_, camera_);
  learn(surface);
  EXPECT_TRUE(surface.evidence(fields_, truth_).information.isZero());
}

TEST_F(Texture, needsBothEyesToChoosePlaces) {
  show(0.011);
  fields_[1].build(cv::Mat(), cv::Rect());
  TexturedSurface surface(body_, camera_);
  surface.look(fields_, truth_);
  EXPECT_TRUE(surface.evidence(fields_, truth_).information.isZero());
}

}  // namespace
}  // namespace leap_object_tracker
