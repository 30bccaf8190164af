#include "leap_object_tracker/tracking/pose_search.hpp"

#include <gtest/gtest.h>

#include "drawn_box.hpp"
#include "leap_object_tracker/geometry/symmetry.hpp"

namespace leap_object_tracker {
namespace {

class SearchedBox : public ::testing::TestWithParam<PoseSearch::Where> {
 protected:
  void draw(const ObjectModel& part, const Eigen::Vector3d& at) {
    Pose pose = truth_;
    pose.translation() = truth_ * at;
    const RectifiedStereoFrame alone = drawnFrame(part, pose, camera_);
    frame_.left = cv::max(frame_.left, alone.left);
    frame_.right = cv::max(frame_.right, alone.right);
  }
  void expectFound(Eyes eyes = Eyes::kBoth) {
    TrackerParams params;
    params.eyes = eyes;
    const ContourModel model(object_, params.contour.points);
    PoseSearch search(params, object_, model, camera_);
    const auto found = search.find(frame_, {GetParam(), {}, {}}, [](const FoundPose& pose) {
      return pose.refined.support() > 0.7 && pose.refined.evidence > 60;
    });
    ASSERT_TRUE(found);
    EXPECT_GT(found->lead, 20) << "no other way to turn it";
    const Pose& pose = found->refined.camera_from_object;
    EXPECT_LT((pose.translation() - truth_.translation()).norm(), 0.002);
    EXPECT_LT(angleBetween(pose.linear(), truth_.linear(), object_.symmetry), 0.05);
  }

  const RectifiedStereoCamera camera_ = roundCamera();
  const ObjectModel object_ = box(0.03, 0.04, 0.05);
  const Pose truth_ = poseAt(0.01, 0.005, 0.12);
  RectifiedStereoFrame frame_ = drawnFrame(object_, truth_, camera_);
};

TEST_P(SearchedBox, isFoundAlone) { expectFound(); }

TEST_P(SearchedBox, isFoundBetweenFingersThatTouchIt) {
  // Beside two of its faces: all three are one bright region.
  for (const double side : {-1.0, 1.0}) draw(box(0.01, 0.012, 0.1), {side * 0.02, 0, 0.03});
  expectFound();
}

TEST_P(SearchedBox, isFoundByOneEye) {
  frame_.left.release();
  expectFound(Eyes::kRight);
}

INSTANTIATE_TEST_SUITE_P(EitherWay, SearchedBox,
                         ::testing::Values(PoseSearch::Where::kBrightRegions,
                                           PoseSearch::Where::kSurfaces));

class DarkBox : public SearchedBox {};

TEST_P(DarkBox, isFoundBeforeABrightWall) {
  for (cv::Mat* eye : {&frame_.left, &frame_.right}) *eye = 255 - *eye;
  expectFound();
  expectFound(Eyes::kLeft);
}

INSTANTIATE_TEST_SUITE_P(EitherWay, DarkBox,
                         ::testing::Values(PoseSearch::Where::kDarkRegions,
                                           PoseSearch::Where::kSurfaces));

TEST(SearchedSquare, hasARivalWhereTurnedItLooksTheSame) {
  const ObjectModel object = squareFaced();
  const RectifiedStereoCamera camera = roundCamera();
  const ContourModel model(object, TrackerParams().contour.points);
  const RectifiedStereoFrame frame = drawnFrame(object, facing(), camera);
  PoseSearch search(TrackerParams(), object, model, camera);
  const auto any = [](const FoundPose&) { return true; };
  const auto found = search.find(frame, {}, any);
  ASSERT_TRUE(found);
  EXPECT_GT(found->refined.support(), 0.9);
  EXPECT_LT(found->lead, 5);
  ASSERT_TRUE(found->rival);
  const Pose& best = found->refined.camera_from_object;
  const double apart = angleBetween(found->rival->linear(), best.linear(), object.symmetry);
  EXPECT_NEAR(std::remainder(apart, M_PI / 2), 0, 0.05);
  EXPECT_GT(apart, 1);

  // What it is told of is compared as well.
  const auto again =
      search.find(frame, {PoseSearch::Where::kSurfaces, {}, {best, *found->rival}}, any);
  ASSERT_TRUE(again);
  EXPECT_LT(again->lead, 5);
}

}  // namespace
}  // namespace leap_object_tracker
