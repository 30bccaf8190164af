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
  void expectFound() {
    const ContourModel model(object_, TrackerParams().contour.points);
    PoseSearch search(TrackerParams(), object_, model, camera_);
    const auto found = search.find(
        frame_, std::nullopt, GetParam(),
        [this](const RefinedPose& pose) { return pose.support() > 0.7 && pose.evidence > 60; });
    ASSERT_TRUE(found);
    const Pose& pose = found->camera_from_object;
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

INSTANTIATE_TEST_SUITE_P(EitherWay, SearchedBox,
                         ::testing::Values(PoseSearch::Where::kBrightRegions,
                                           PoseSearch::Where::kSurfaces));

}  // namespace
}  // namespace leap_object_tracker
