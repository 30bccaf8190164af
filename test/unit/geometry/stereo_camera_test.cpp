#include "leap_object_tracker/geometry/stereo_camera.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

CameraCalibration lens(DistortionModel model, const std::vector<double>& distortion) {
  CameraCalibration camera;
  camera.size = {640, 480};
  camera.fx = camera.fy = 132;
  camera.cx = 316;
  camera.cy = 235;
  camera.distortion_model = model;
  camera.distortion = distortion;
  return camera;
}

class EveryModel : public testing::TestWithParam<CameraCalibration> {};

TEST_P(EveryModel, pixelAndRayAreInversesOfEachOther) {
  for (double x = -1; x <= 1; x += 0.25)
    for (double y = -1; y <= 1; y += 0.25) {
      const Eigen::Vector2d ray(x, y);
      const Eigen::Vector2d pixel = pixelFromRay(GetParam(), ray);
      EXPECT_LT((rayFromPixel(GetParam(), pixel) - ray).norm(), 1e-5) << x << " " << y;
    }
}

INSTANTIATE_TEST_SUITE_P(
    StereoCamera, EveryModel,
    testing::Values(lens(DistortionModel::kNone, {}),
                    lens(DistortionModel::kPlumbBob, {-0.05, 0.01, 0.001, -0.001, 0}),
                    lens(DistortionModel::kRationalPolynomial,
                         {0.93, 0.35, 0.0007, -0.0008, 0.0067, 0.737, 0.362, 0.018}),
                    lens(DistortionModel::kEquidistant, {0.02, 0.01, 0, 0}),
                    lens(DistortionModel::kLeapInverse,
                         {1.272, 0.2982, 0.0177, 1.464, 0.3432, -0.006705, 0.00015, 0.00197})));

TEST(CameraCalibration, withoutDistortionIsAPinhole) {
  const Eigen::Vector2d pixel = pixelFromRay(lens(DistortionModel::kNone, {}), {0.5, -0.25});
  EXPECT_DOUBLE_EQ(pixel.x(), 316 + 66);
  EXPECT_DOUBLE_EQ(pixel.y(), 235 - 33);
}

TEST(CameraCalibration, hasNoPixelForARayOutsideOfTheLeapsLens) {
  const auto leap = lens(DistortionModel::kLeapInverse,
                         {1.272, 0.2982, 0.0177, 1.464, 0.3432, -0.006705, 0.00015, 0.00197});
  EXPECT_FALSE(pixelFromRay(leap, {500, 0}).allFinite());
}

TEST(RectifiedStereoCamera, seesAPointFartherLeftWithTheRightEye) {
  const RectifiedStereoCamera camera{100, 320, 240, 0.04, {640, 480}};
  const Eigen::Vector3d point(0.1, 0, 0.5);
  EXPECT_DOUBLE_EQ(camera.leftPixel(point).x(), 340);
  EXPECT_DOUBLE_EQ(camera.leftPixel(point).x() - camera.rightPixel(point).x(), 100 * 0.04 / 0.5);
}

}  // namespace
}  // namespace leap_object_tracker
