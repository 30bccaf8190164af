#include "leap_object_tracker/tracking/eye_agreement.hpp"

#include <gtest/gtest.h>

#include "cast_body.hpp"
#include "drawn_box.hpp"

namespace leap_object_tracker {
namespace {

class EyesThatAgree : public ::testing::Test {
 protected:
  void show(double checks, bool right_eye = true) {
    Look look;
    look.checks = checks;
    look.rays = 3;
    const RectifiedStereoFrame frame = castFrame(body_.mesh, truth_, camera_, look);
    const cv::Rect whole(cv::Point(), camera_.size);
    fields_[0].build(frame.left, whole);
    fields_[1].build(right_eye ? frame.right : cv::Mat(), whole);
  }

  Pose scaled(double share) const {
    Pose pose = truth_;
    pose.translation() *= share;
    return pose;
  }

  const RectifiedStereoCamera camera_ = roundCamera();
  ObjectModel body_ = box(0.05, 0.05, 0.02);
  const Pose truth_ = aslant();
  std::array<EdgeField, 2> fields_;
  const EyeAgreement agreement_{body_.mesh, camera_};
};

TEST_F(EyesThatAgree, tellTheSurfaceFromOneBeforeOrBehindIt) {
  show(0.011);
  const double here = agreement_.compare(fields_, truth_).log_likelihood_ratio;
  EXPECT_GT(here, 10);
  for (const double share : {0.94, 1.06})
    EXPECT_LT(agreement_.compare(fields_, scaled(share)).log_likelihood_ratio, 0.2 * here) << share;
  Pose tilted = truth_;
  tilted.linear() = rotationFromVector({0, 0.5, 0}) * truth_.linear();
  EXPECT_LT(agreement_.compare(fields_, tilted).log_likelihood_ratio, 0.7 * here);
}

TEST_F(EyesThatAgree, tellHowFarTheDisparitiesAreOff) {
  show(0.011);
  const auto here = agreement_.compare(fields_, truth_);
  EXPECT_EQ(here.best_shift, 0);
  EXPECT_EQ(here.best_ratio, here.log_likelihood_ratio);
  const double disparity = camera_.focal_length * camera_.baseline / truth_.translation().z();
  for (const int shift : {-3, 2}) {
    const auto there =
        agreement_.compare(fields_, scaled(disparity / (disparity + shift)));  // [px] too near
    EXPECT_NEAR(there.best_shift, shift, 1);
    EXPECT_GT(there.best_ratio, 0.5 * here.best_ratio);
    EXPECT_GT(there.best_ratio, there.log_likelihood_ratio);
  }
}

TEST_F(EyesThatAgree, sayNothingOfAPlainBody) {
  show(0);
  EXPECT_NEAR(agreement_.compare(fields_, truth_).log_likelihood_ratio, 0, 1);
}

TEST_F(EyesThatAgree, areTwo) {
  show(0.011, false);
  EXPECT_EQ(agreement_.compare(fields_, truth_).log_likelihood_ratio, 0);
  EXPECT_EQ(agreement_.compare(fields_, truth_).best_shift, 0);
}

TEST_F(EyesThatAgree, seeNothingOfABodyBehindThem) {
  show(0.011);
  EXPECT_EQ(agreement_.compare(fields_, scaled(-1)).best_ratio, 0);
}

}  // namespace
}  // namespace leap_object_tracker
