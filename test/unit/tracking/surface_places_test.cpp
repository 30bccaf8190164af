#include "leap_object_tracker/tracking/surface_places.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

#include "drawn_box.hpp"

namespace leap_object_tracker {
namespace {

constexpr double kNearest = 0.04, kFarthest = 0.6, kSize = 0.02;  // [m]

/// A plane speckled square that faces the eyes, before what else is in the images.
void drawSquare(const Eigen::Vector3d& middle, double half_width, RectifiedStereoFrame& frame) {
  const RectifiedStereoCamera eyes = roundCamera();
  cv::Mat speckles(24, 24, CV_8UC1);
  cv::RNG random(7);
  random.fill(speckles, cv::RNG::UNIFORM, 60, 200);
  for (int eye = 0; eye < 2; ++eye) {
    const double scale = eyes.focal_length / middle.z(), half = half_width * scale;
    const double u = eyes.center_u + (middle.x() - eye * eyes.baseline) * scale;
    const double v = eyes.center_v + middle.y() * scale;
    const double pixels = 2 * half / speckles.cols;
    cv::warpAffine(speckles, eye == 0 ? frame.left : frame.right,
                   cv::Mat_<double>({2, 3}, {pixels, 0, u - half, 0, pixels, v - half}), eyes.size,
                   cv::INTER_LINEAR, cv::BORDER_TRANSPARENT);
  }
}

RectifiedStereoFrame darkFrame() {
  return {Stamp(), cv::Mat(roundCamera().size, CV_8UC1, cv::Scalar(2)),
          cv::Mat(roundCamera().size, CV_8UC1, cv::Scalar(2))};
}

double nearestTo(const Eigen::Vector3d& middle, const std::vector<Eigen::Vector3d>& places) {
  double nearest = 1;
  for (const Eigen::Vector3d& place : places) nearest = std::min(nearest, (place - middle).norm());
  return nearest;
}

TEST(SurfacePlaces, liesBehindASurfaceThatBothEyesSee) {
  for (const Eigen::Vector3d& middle :
       {Eigen::Vector3d(0.02, 0.01, 0.12), Eigen::Vector3d(0.05, -0.04, 0.25)}) {
    RectifiedStereoFrame frame = darkFrame();
    drawSquare(middle, kSize, frame);
    const auto places = SurfacePlaces(roundCamera(), kNearest, kFarthest, kSize).find(frame);
    ASSERT_FALSE(places.empty());
    EXPECT_LT(nearestTo(middle, places), kSize);
    EXPECT_GT(places.front().z(), middle.z());
  }
}

TEST(SurfacePlaces, areFoundAmongBodiesThatTouchInTheImage) {
  RectifiedStereoFrame frame = darkFrame();
  const Eigen::Vector3d far(0.03, 0, 0.22), near(0.005, 0, 0.14);
  drawSquare(far, 2 * kSize, frame);
  drawSquare(near, kSize, frame);
  const auto places = SurfacePlaces(roundCamera(), kNearest, kFarthest, kSize).find(frame);
  EXPECT_LT(nearestTo(near, places), kSize);
  EXPECT_LT(nearestTo(far + Eigen::Vector3d(0.02, 0, 0), places), 1.5 * kSize);
  // No surface, no place.
  EXPECT_GT(nearestTo({-0.05, 0.05, 0.14}, places), 2 * kSize);
}

TEST(SurfacePlaces, needBothEyesAndSomethingToMatch) {
  const SurfacePlaces finder(roundCamera(), kNearest, kFarthest, kSize);
  RectifiedStereoFrame frame = darkFrame();
  EXPECT_TRUE(finder.find(frame).empty());
  drawSquare({0.02, 0.01, 0.12}, kSize, frame);
  frame.right.release();
  EXPECT_TRUE(finder.find(frame).empty());
}

}  // namespace
}  // namespace leap_object_tracker
