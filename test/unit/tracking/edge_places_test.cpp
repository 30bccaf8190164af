#include "leap_object_tracker/tracking/edge_places.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "drawn_box.hpp"

namespace leap_object_tracker {
namespace {

constexpr double kSize = 0.022;  // [m]

class EdgePlaces : public ::testing::Test {
 protected:
  std::vector<Eigen::Vector3d> find(const cv::Mat& image, double eye_x) const {
    EdgeField field;
    field.build(image, cv::Rect(cv::Point(), camera_.size));
    return placesAmongEdges(field, camera_, eye_x, 0.05, 0.3, kSize);
  }
  const RectifiedStereoCamera camera_ = roundCamera();
};

TEST_F(EdgePlaces, coverTheBodyFromEitherEyeAndFewOthers) {
  const Pose truth = poseAt(0.03, -0.02, 0.13);
  const RectifiedStereoFrame frame = drawnFrame(box(0.04, 0.04, 0.04), truth, camera_);
  for (const bool left : {true, false}) {
    const auto places = find(left ? frame.left : frame.right, left ? 0 : camera_.baseline);
    // As near as the steps of the grid let it be.
    const auto near = std::count_if(places.begin(), places.end(), [&](const auto& place) {
      return (place - truth.translation()).norm() < 0.02;
    });
    EXPECT_GT(near, 0);
    for (const Eigen::Vector3d& place : places) {
      EXPECT_GE(place.z(), 0.05);
      EXPECT_LT(place.z(), 0.3);
      const Eigen::Vector2d apart =
          left ? camera_.leftPixel(place) - camera_.leftPixel(truth.translation())
               : camera_.rightPixel(place) - camera_.rightPixel(truth.translation());
      EXPECT_LT(apart.cwiseAbs().maxCoeff(), 1.3 * camera_.focal_length * kSize / place.z() + 40);
    }
  }
}

TEST_F(EdgePlaces, areNoneWhereNothingIs) {
  EXPECT_TRUE(find(cv::Mat(camera_.size, CV_8UC1, cv::Scalar(9)), 0).empty());
}

TEST_F(EdgePlaces, areNoneWhereTheBodyWouldHardlyBeInTheImage) {
  const Pose cut = poseAt(0.13 * 320 / 130, 0, 0.13);
  const auto places = find(drawnFrame(box(0.04, 0.04, 0.04), cut, camera_).left, 0);
  EXPECT_FALSE(places.empty());
  for (const Eigen::Vector3d& place : places)
    EXPECT_LT(camera_.leftPixel(place).x(),
              camera_.size.width - 0.4 * camera_.focal_length * kSize / place.z());
}

}  // namespace
}  // namespace leap_object_tracker
