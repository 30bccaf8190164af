#include "leap_object_tracker/tracking/tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "cast_body.hpp"
#include "drawn_box.hpp"

namespace leap_object_tracker {
namespace {

constexpr double kPeriod = 0.02;  // [s]

class MovingBox : public ::testing::Test {
 protected:
  Pose truthAt(int frame) const {
    const double t = frame * kPeriod;
    Pose pose = poseAt(0.02 * std::sin(3 * t), 0.005, 0.12 + 0.02 * std::sin(2 * t));
    pose.linear() = rotationFromVector({0, 0.5 * std::sin(2 * t), 0}) * pose.linear();
    return pose;
  }
  RectifiedStereoFrame frameAt(int frame) const {
    return drawnFrame(object_, truthAt(frame), camera_, 1 + frame * kPeriod);
  }
  RectifiedStereoFrame darkAt(int frame) const {
    RectifiedStereoFrame dark;
    dark.stamp = stampFromSeconds(1 + frame * kPeriod);
    dark.left = cv::Mat(camera_.size, CV_8UC1, cv::Scalar(3));
    dark.right = dark.left.clone();
    return dark;
  }
  double positionError(const PoseEstimate& estimate, int frame) const {
    return (estimate.camera_from_object.translation() - truthAt(frame).translation()).norm();
  }
  /// @param tolerance [m]
  /// @param change of what the eyes see
  template <class Change>
  void expectFoundWithinThreeFrames(const TrackerParams& params, double tolerance,
                                    const Change& change) const {
    Tracker tracker(params, object_, camera_);
    tracker.search();
    std::optional<PoseEstimate> estimate;
    int frame = 0;
    for (; frame < 3 && !estimate; ++frame) {
      RectifiedStereoFrame seen = frameAt(frame);
      change(seen);
      estimate = tracker.track(seen);
    }
    ASSERT_TRUE(estimate);
    EXPECT_LT(positionError(*estimate, frame - 1), tolerance);
    EXPECT_LT(angleBetween(estimate->camera_from_object.linear(), truthAt(frame - 1).linear(),
                           object_.symmetry),
              0.05);
  }

  const RectifiedStereoCamera camera_ = roundCamera();
  const ObjectModel object_ = box(0.03, 0.04, 0.05);
};

TEST_F(MovingBox, isFollowedFromAStartPose) {
  Tracker tracker(TrackerParams(), object_, camera_);
  tracker.start(truthAt(0));
  for (int frame = 0; frame < 30; ++frame) {
    const auto estimate = tracker.track(frameAt(frame));
    ASSERT_TRUE(estimate) << frame;
    EXPECT_LT(positionError(*estimate, frame), 0.001) << frame;
    EXPECT_LT(angleBetween(estimate->camera_from_object.linear(), truthAt(frame).linear()), 0.03);
  }
}

TEST_F(MovingBox, isFoundFromNothingWithinThreeFrames) {
  expectFoundWithinThreeFrames({}, 0.002, [](RectifiedStereoFrame&) {});
}

TEST_F(MovingBox, isFoundByOneEyeBeforeABrightWallWithinThreeFrames) {
  TrackerParams params;
  params.eyes = Eyes::kLeft;
  expectFoundWithinThreeFrames(params, 0.003, [](RectifiedStereoFrame& frame) {
    frame.left = 255 - frame.left;
    frame.right.release();
  });
}

TEST(NearBox, isFoundThoughTheBorderCutsIt) {
  const RectifiedStereoCamera camera = roundCamera();
  const ObjectModel object = box(0.04, 0.06, 0.09);
  int found = 0;
  constexpr int kPoses = 16;
  for (int i = 0; i < kPoses; ++i) {
    Pose truth = Pose::Identity();
    truth.translation() << 0.02 + 0.07 * std::cos(0.8 * i), 0.07 * std::sin(0.8 * i), 0.06;
    truth.linear() = rotationFromVector({0.4 + 0.5 * i, 0.7 - 0.3 * i, 0.2 * i});
    Tracker tracker(TrackerParams(), object, camera);
    tracker.search();
    std::optional<PoseEstimate> estimate;
    for (int frame = 0; frame < 3; ++frame)
      estimate = tracker.track(drawnFrame(object, truth, camera, 1 + frame * kPeriod));
    if (!estimate) continue;
    const double turn =
        angleBetween(estimate->camera_from_object.linear(), truth.linear(), object.symmetry);
    const double shift = (estimate->camera_from_object.translation() - truth.translation()).norm();
    found += shift < 0.002 && turn < 0.035;
    EXPECT_LT(shift, 0.01) << i;
    EXPECT_LT(turn, 0.17) << i;
  }
  EXPECT_EQ(found, kPoses);
}

TEST(TurningBody, hasNoPoseUntilItShowsWhichWayItIsTurned) {
  const ObjectModel object = squareFaced();
  const RectifiedStereoCamera camera = roundCamera();
  Tracker tracker(TrackerParams(), object, camera);
  tracker.search();
  Pose truth = facing();
  for (int frame = 0; frame < 6; ++frame) {
    EXPECT_FALSE(tracker.track(drawnFrame(object, truth, camera, 1 + frame / 40.0))) << frame;
    EXPECT_TRUE(tracker.report().unclear) << frame;
    EXPECT_EQ(tracker.report().state, TrackerState::kSearching) << frame;
  }
  truth.linear() = rotationFromVector({0.9, 0.9, 0});
  std::optional<PoseEstimate> estimate;
  for (int frame = 6; frame < 9; ++frame)
    estimate = tracker.track(drawnFrame(object, truth, camera, 1 + frame / 40.0));
  ASSERT_TRUE(estimate);
  EXPECT_FALSE(tracker.report().unclear);
  EXPECT_LT(angleBetween(estimate->camera_from_object.linear(), truth.linear(), object.symmetry),
            0.1);
}

TEST(BoxOfUntoldSymmetry, isFoundInOneOfItsEqualPoses) {
  ObjectModel object = box(0.03, 0.04, 0.05);
  const Symmetry symmetry = object.symmetry;
  object.symmetry = {};
  const RectifiedStereoCamera camera = roundCamera();
  Tracker tracker(TrackerParams(), object, camera);
  tracker.search();
  std::optional<PoseEstimate> estimate;
  for (int frame = 0; frame < 3; ++frame)
    estimate = tracker.track(drawnFrame(object, aslant(), camera, 1 + frame / 40.0));
  ASSERT_TRUE(estimate);
  EXPECT_LT(angleBetween(estimate->camera_from_object.linear(), aslant().linear(), symmetry), 0.1);
}

TEST_F(MovingBox, isGivenUpWhenItIsGoneAndFoundAgain) {
  Tracker tracker(TrackerParams(), object_, camera_);
  tracker.start(truthAt(0));
  int frame = 0;
  for (; frame < 5; ++frame) tracker.track(frameAt(frame));
  for (int gone = 0; gone < 10; ++gone, ++frame) tracker.track(darkAt(frame));
  EXPECT_NE(tracker.report().state, TrackerState::kTracking);
  EXPECT_FALSE(tracker.track(darkAt(frame++)));
  std::optional<PoseEstimate> estimate;
  for (int back = 0; back < 4 && !estimate; ++back, ++frame)
    estimate = tracker.track(frameAt(frame));
  ASSERT_TRUE(estimate);
  EXPECT_LT(positionError(*estimate, frame - 1), 0.002);
}

TEST_F(MovingBox, isFoundAtOnceWhereItWasThoughMuchOfItIsCovered) {
  Tracker tracker(TrackerParams(), object_, camera_);
  tracker.start(truthAt(0));
  const auto shown = [&](int frame, bool covered) {
    RectifiedStereoFrame still = frameAt(0);
    still.stamp = stampFromSeconds(1 + frame * kPeriod);
    const double middle = camera_.leftPixel(truthAt(0).translation()).x();
    if (covered) {
      still.left.colRange(0, static_cast<int>(middle) - 9).setTo(4);
      const double disparity =
          camera_.focal_length * camera_.baseline / truthAt(0).translation().z();
      still.right.colRange(0, static_cast<int>(middle - disparity) - 9).setTo(4);
    }
    return still;
  };
  int frame = 0;
  for (; frame < 5; ++frame) ASSERT_TRUE(tracker.track(shown(frame, false)));
  for (int gone = 0; gone < 6; ++gone, ++frame) tracker.track(darkAt(frame));
  ASSERT_EQ(tracker.report().state, TrackerState::kLost);
  const auto estimate = tracker.track(shown(frame, true));
  ASSERT_TRUE(estimate);
  EXPECT_LT(estimate->support, 0.6);
  EXPECT_LT(positionError(*estimate, 0), 0.001);
}

TEST_F(MovingBox, isFollowedFromTheSecondFrameThoughItReturnsFast) {
  Tracker tracker(TrackerParams(), object_, camera_);
  tracker.start(truthAt(0));
  int frame = 0;
  for (; frame < 3; ++frame) tracker.track(frameAt(0));
  for (int gone = 0; gone < 40; ++gone, ++frame) tracker.track(darkAt(frame));
  ASSERT_EQ(tracker.report().state, TrackerState::kSearching);
  Pose place = truthAt(0);
  place.translation() << -0.07, 0.01, 0.13;
  for (int seen = 0; seen < 5; ++seen, ++frame) {
    const auto estimate = tracker.track(drawnFrame(object_, place, camera_, 1 + frame * kPeriod));
    if (seen > 0) {
      ASSERT_TRUE(estimate) << seen;
      EXPECT_LT((estimate->camera_from_object.translation() - place.translation()).norm(), 0.002);
    }
    place.translation().x() += 0.03;  // 1.5 m/s
  }
}

TEST_F(MovingBox, isFollowedByTheEyeThatSeesMostOfIt) {
  Tracker tracker(TrackerParams(), object_, camera_);
  tracker.start(truthAt(0));
  std::optional<PoseEstimate> estimate;
  for (int frame = 0; frame < 30; ++frame) {
    RectifiedStereoFrame seen = frameAt(frame);
    if (frame >= 5) seen.right.setTo(4);
    estimate = tracker.track(seen);
    ASSERT_TRUE(estimate) << frame;
    EXPECT_GT(estimate->support, 0.8) << frame;
    EXPECT_LT(positionError(*estimate, frame), 0.005) << frame;
  }
}

TEST_F(MovingBox, thatIsElsewhereThanWhatIsFollowedIsTakenUpInstead) {
  Tracker tracker(TrackerParams(), object_, camera_);
  // A quarter of the contour is not there: the pose is followed, but not for sure.
  Pose wrong = truthAt(0);
  wrong.linear() = wrong.linear() * rotationFromVector({0, M_PI / 2, 0});
  tracker.start(wrong);
  std::optional<PoseEstimate> estimate;
  for (int frame = 0; frame < 30; ++frame) {
    RectifiedStereoFrame still = frameAt(0);
    still.stamp = stampFromSeconds(1 + frame * kPeriod);
    estimate = tracker.track(still);
  }
  ASSERT_TRUE(estimate);
  EXPECT_LT(positionError(*estimate, 0), 0.001);
  EXPECT_LT(
      angleBetween(estimate->camera_from_object.linear(), truthAt(0).linear(), object_.symmetry),
      0.03);
}

TEST_F(MovingBox, isNotTakenUpByACornerOfIt) {
  Tracker tracker(TrackerParams(), object_, camera_);
  tracker.search();
  for (int frame = 0; frame < 5; ++frame) {
    RectifiedStereoFrame corner = frameAt(0);
    // All but a corner lies beyond the border of the image.
    const int shift = 265;
    for (cv::Mat* eye : {&corner.left, &corner.right}) {
      cv::Mat moved(eye->size(), CV_8UC1, cv::Scalar(4));
      (*eye)(cv::Rect(0, 0, eye->cols - shift, eye->rows))
          .copyTo(moved(cv::Rect(shift, 0, eye->cols - shift, eye->rows)));
      *eye = moved;
    }
    corner.stamp = stampFromSeconds(1 + frame * kPeriod);
    EXPECT_FALSE(tracker.track(corner)) << frame;
  }
}

TEST_F(MovingBox, hasTheSamePosesWhateverTheNumberOfThreads) {
  TrackerParams one, two;
  one.threads = 1;
  two.threads = 2;
  Tracker first(one, object_, camera_), second(two, object_, camera_);
  first.search();
  second.search();
  int compared = 0;
  for (int frame = 0; frame < 8; ++frame) {
    const auto a = first.track(frameAt(frame)), b = second.track(frameAt(frame));
    ASSERT_EQ(a.has_value(), b.has_value()) << frame;
    if (!a) continue;
    EXPECT_TRUE(a->camera_from_object.isApprox(b->camera_from_object, 0.0)) << frame;
    ++compared;
  }
  EXPECT_GT(compared, 3);
}

TEST_F(MovingBox, isTrackedByOneEyeWithLessKnownDepth) {
  TrackerParams params;
  Tracker both(params, object_, camera_);
  params.eyes = Eyes::kLeft;
  Tracker left(params, object_, camera_);
  both.start(truthAt(0));
  left.start(truthAt(0));
  std::optional<PoseEstimate> by_both, by_left;
  for (int frame = 0; frame < 10; ++frame) {
    by_both = both.track(frameAt(frame));
    RectifiedStereoFrame one_eye = frameAt(frame);
    one_eye.right = cv::Mat();
    by_left = left.track(one_eye);
  }
  ASSERT_TRUE(by_both && by_left);
  EXPECT_GT(by_left->covariance(2, 2), by_both->covariance(2, 2));
}

TEST_F(MovingBox, isLessKnownWhereItsEdgesScatter) {
  const ObjectModel other = box(0.0315, 0.039, 0.051);
  const auto covarianceOf = [&](const ObjectModel& drawn) {
    Tracker tracker(TrackerParams(), object_, camera_);
    tracker.start(truthAt(0));
    std::optional<PoseEstimate> estimate;
    for (int frame = 0; frame < 10; ++frame)
      estimate = tracker.track(drawnFrame(drawn, truthAt(frame), camera_, 1 + frame * kPeriod));
    return estimate ? estimate->covariance : Matrix6d(Matrix6d::Zero());
  };
  const Matrix6d alike = covarianceOf(object_), scattered = covarianceOf(other);
  ASSERT_GT(alike(0, 0), 0);
  EXPECT_GT(scattered(0, 0), 2 * alike(0, 0));
  EXPECT_GT(scattered(2, 2), 2 * alike(2, 2));
}

TEST_F(MovingBox, restsInTheFixedFrameWhileTheCameraMoves) {
  TrackerParams params;
  Tracker tracker(params, object_, camera_);
  const Pose fixed_from_object = poseAt(0, 0, 0.14);
  const auto cameraAt = [](int frame) {
    Pose pose = Pose::Identity();
    pose.translation().x() = 0.012 * frame;  // 0.6 m/s
    return pose;
  };
  tracker.start(cameraAt(0).inverse() * fixed_from_object);
  for (int frame = 0; frame < 6; ++frame) {
    const Pose seen = cameraAt(frame).inverse() * fixed_from_object;
    const auto estimate =
        tracker.track(drawnFrame(object_, seen, camera_, 1 + frame * kPeriod), cameraAt(frame));
    ASSERT_TRUE(estimate) << frame;
    EXPECT_LT((estimate->camera_from_object.translation() - seen.translation()).norm(), 0.001);
  }
}

TEST(Tracker, refusesACameraWithoutFocalLength) {
  EXPECT_THROW(Tracker(TrackerParams(), box(0.03, 0.03, 0.03), RectifiedStereoCamera()),
               std::invalid_argument);
}

/// A frame whose body shows its middle only, its outline lost in a haze.
RectifiedStereoFrame withoutOutline(const RectifiedStereoFrame& frame) {
  RectifiedStereoFrame hazy;
  for (const bool left : {true, false}) {
    const cv::Mat& image = left ? frame.left : frame.right;
    cv::Mat body, share, mixed;
    cv::morphologyEx(image > 8, body, cv::MORPH_CLOSE, cv::Mat::ones(9, 9, CV_8UC1));
    cv::erode(body, body, cv::Mat::ones(13, 13, CV_8UC1));
    body.convertTo(share, CV_32FC1, 1 / 255.0);
    cv::GaussianBlur(share, share, cv::Size(), 3);
    image.convertTo(mixed, CV_32FC1);
    mixed = mixed.mul(share) + 50 * (1 - share);
    mixed.convertTo(left ? hazy.left : hazy.right, CV_8UC1);
  }
  return hazy;
}

TEST(TexturedBody, isFollowedThoughItsOutlineIsHidden) {
  const RectifiedStereoCamera camera = roundCamera();
  const ObjectModel body = box(0.05, 0.05, 0.02);
  Pose truth = poseAt(0.02, 0, 0.15);
  truth.linear() = rotationFromVector({0.35, 0.3, 0.2});
  Look look;
  look.checks = 0.006;
  look.rays = 3;
  RectifiedStereoFrame clear = castFrame(body.mesh, truth, camera, look);
  RectifiedStereoFrame hazy = withoutOutline(clear);
  Tracker tracker(TrackerParams(), body, camera);
  tracker.start(truth);
  for (int frame = 0; frame < 40; ++frame) {
    RectifiedStereoFrame& seen = frame < 20 ? clear : hazy;
    seen.stamp = stampFromSeconds(1 + frame * kPeriod);
    const auto estimate = tracker.track(seen);
    ASSERT_TRUE(estimate) << frame;
    EXPECT_LT((estimate->camera_from_object.translation() - truth.translation()).norm(), 0.001)
        << frame;
    if (&seen == &hazy) {
      EXPECT_LT(tracker.report().support, 0.5) << frame;
    }
  }
}

}  // namespace
}  // namespace leap_object_tracker
