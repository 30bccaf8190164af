#include "leap_object_tracker/tracking/feature_extractor.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "leap_object_tracker/geometry/signed_distance.hpp"
#include "support/textured_box.hpp"

namespace leap_object_tracker {
namespace {

const Eigen::Vector3d kSize(0.03, 0.03, 0.03);

RectifiedStereoCamera leapLikeCamera() {
  RectifiedStereoCamera camera;
  camera.focal_length = 130;
  camera.center_u = 199.5;
  camera.center_v = 99.5;
  camera.baseline = 0.04;
  camera.size = cv::Size(400, 200);
  return camera;
}

/// Turned so that three faces show.
Pose boxAt(double depth) {
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(0.015, 0, depth);
  pose.linear() = rotationFromVector({0.5, 0.4, 0});
  return pose;
}

FeatureWindow wholeImage(const RectifiedStereoCamera& camera, double depth) {
  FeatureWindow window;
  window.regions = {cv::Rect(cv::Point(), camera.size), cv::Rect(cv::Point(), camera.size)};
  window.nearest = depth - 0.03;
  window.farthest = depth + 0.03;
  return window;
}

TEST(Triangulate, invertsTheProjection) {
  const RectifiedStereoCamera camera = leapLikeCamera();
  const Eigen::Vector3d point(0.01, -0.02, 0.1);
  Eigen::Vector3d found;
  Eigen::Matrix3d covariance;
  triangulate(camera, camera.leftPixel(point),
              camera.leftPixel(point).x() - camera.rightPixel(point).x(), 0.3, 0.2, found,
              covariance);
  EXPECT_LT((found - point).norm(), 1e-12);
}

TEST(Triangulate, predictsTheScatterOfNoisyPixels) {
  const RectifiedStereoCamera camera = leapLikeCamera();
  const Eigen::Vector3d point(0.02, -0.01, 0.1);
  const Eigen::Vector2d pixel = camera.leftPixel(point);
  const double disparity = pixel.x() - camera.rightPixel(point).x();
  Eigen::Vector3d mean, found;
  Eigen::Matrix3d predicted, ignored, scatter = Eigen::Matrix3d::Zero();
  triangulate(camera, pixel, disparity, 0.3, 0.2, mean, predicted);
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  constexpr int kSamples = 20000;
  for (int i = 0; i < kSamples; ++i) {
    const Eigen::Vector2d noise(0.3 * normal(random), 0.3 * normal(random));
    triangulate(camera, pixel + noise, disparity + 0.2 * normal(random), 0.3, 0.2, found, ignored);
    scatter += (found - mean) * (found - mean).transpose() / kSamples;
  }
  EXPECT_LT((scatter - predicted).norm(), 0.03 * predicted.norm());
}

class ExtractedFeatures : public testing::TestWithParam<double> {};

TEST_P(ExtractedFeatures, lieOnTheSurfaceOfAPaintedBox) {
  const double depth = GetParam();
  const RectifiedStereoCamera camera = leapLikeCamera();
  const Pose pose = boxAt(depth);
  FeatureExtractor extractor(FeatureParams(), camera);
  const auto& features =
      extractor.extract(paintedBox(kSize, pose, camera), wholeImage(camera, depth));
  const SignedDistance distance(makePrimitive("box", Shape::kBox, kSize));
  int near = 0;
  for (const auto& feature : features) {
    const Eigen::Vector3f spot = (pose.inverse() * feature.point_in_camera).cast<float>();
    const double deviation = std::sqrt(feature.covariance(2, 2));
    if (std::abs(distance(spot)) < 3 * deviation) ++near;
  }
  EXPECT_GE(features.size(), 25u);
  EXPECT_GE(near, 0.9 * static_cast<double>(features.size()));
}

INSTANTIATE_TEST_SUITE_P(Depths, ExtractedFeatures, testing::Values(0.08, 0.10, 0.15));

TEST(FeatureExtractor, findsCornersInADimImageToo) {
  const RectifiedStereoCamera camera = leapLikeCamera();
  RectifiedStereoFrame frame = paintedBox(kSize, boxAt(0.1), camera);
  FeatureExtractor extractor(FeatureParams(), camera);
  const std::size_t bright = extractor.extract(frame, wholeImage(camera, 0.1)).size();
  frame.left.convertTo(frame.left, -1, 0.3);
  frame.right.convertTo(frame.right, -1, 0.3);
  EXPECT_GE(extractor.extract(frame, wholeImage(camera, 0.1)).size(), 0.6 * bright);
}

TEST(FeatureExtractor, hasNoFeaturesWithOneEyeOrOutsideTheImage) {
  const RectifiedStereoCamera camera = leapLikeCamera();
  RectifiedStereoFrame frame = paintedBox(kSize, boxAt(0.1), camera);
  FeatureExtractor extractor(FeatureParams(), camera);
  FeatureWindow outside = wholeImage(camera, 0.1);
  outside.regions[0] = cv::Rect(1000, 1000, 20, 20);
  EXPECT_TRUE(extractor.extract(frame, outside).empty());
  frame.right = cv::Mat();
  EXPECT_TRUE(extractor.extract(frame, wholeImage(camera, 0.1)).empty());
  EXPECT_EQ(extractor.counts().left_corners, 0);
}

TEST(FeatureExtractor, findsNothingInAnEvenImage) {
  const RectifiedStereoCamera camera = leapLikeCamera();
  RectifiedStereoFrame frame;
  frame.left = cv::Mat(camera.size, CV_8UC1, cv::Scalar(120));
  frame.right = frame.left.clone();
  FeatureExtractor extractor(FeatureParams(), camera);
  EXPECT_TRUE(extractor.extract(frame, wholeImage(camera, 0.1)).empty());
}

TEST(FeatureExtractor, alsoUsesTheDetectorOfSurf) {
  const RectifiedStereoCamera camera = leapLikeCamera();
  FeatureExtractor extractor(FeatureParams(), camera, CornerDetector::kSurf);
  extractor.extract(paintedBox(kSize, boxAt(0.1), camera), wholeImage(camera, 0.1));
  EXPECT_GT(extractor.counts().left_corners, 10);
  EXPECT_GT(extractor.counts().matches, 3);
}

}  // namespace
}  // namespace leap_object_tracker
