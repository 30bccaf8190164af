#include "leap_object_tracker/rectification/stereo_rectifier.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace leap_object_tracker {
namespace {

CameraCalibration eyeOf(DistortionModel model, const std::vector<double>& distortion,
                        const Eigen::Vector3d& turned) {
  CameraCalibration eye;
  eye.size = {640, 240};
  eye.fx = 134;  // binned rows: fy is half of fx
  eye.fy = 67;
  eye.cx = 318.9;
  eye.cy = 121.6;
  eye.distortion_model = model;
  eye.distortion = distortion;
  eye.rectified_from_raw = rotationFromVector(turned);
  return eye;
}

StereoCalibration pairOf(DistortionModel model, const std::vector<double>& distortion) {
  return {eyeOf(model, distortion, {0.01, -0.004, 0.02}),
          eyeOf(model, distortion, {-0.006, 0.01, -0.015}), 0.04};
}

/// A raw image with one soft spot where the eye sees a direction of the rectified frame.
cv::Mat spotAt(const CameraCalibration& eye, const Eigen::Vector3d& in_rectified) {
  const Eigen::Vector3d in_raw = eye.rectified_from_raw.transpose() * in_rectified;
  const Eigen::Vector2d center = pixelFromRay(eye, in_raw.hnormalized());
  cv::Mat image(eye.size, CV_8UC1);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u) {
      const double du = (u - center.x()) / 2, dv = (v - center.y()) / 1;
      image.at<std::uint8_t>(v, u) =
          static_cast<std::uint8_t>(std::lround(250 * std::exp(-(du * du + dv * dv) / 2)));
    }
  return image;
}

Eigen::Vector2d centroidOf(const cv::Mat& image) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      sum += image.at<std::uint8_t>(v, u) * Eigen::Vector3d(u, v, 1);
  return sum.hnormalized();
}

struct Lens {
  const char* name;
  DistortionModel model;
  std::vector<double> distortion;
};

class EveryLens : public testing::TestWithParam<Lens> {};

TEST_P(EveryLens, putsAPointWhereTheIdealPairSeesIt) {
  const StereoCalibration calibration = pairOf(GetParam().model, GetParam().distortion);
  const StereoRectifier rectifier(calibration, rectifiedCamera(calibration, {}));
  for (const Eigen::Vector3d& point :
       {Eigen::Vector3d(0, 0, 0.1), Eigen::Vector3d(0.05, -0.03, 0.12),
        Eigen::Vector3d(-0.06, 0.04, 0.1)}) {
    const RectifiedStereoFrame frame = rectifier.rectify(
        {Stamp(), spotAt(calibration.left, point),
         spotAt(calibration.right, point - Eigen::Vector3d(calibration.baseline, 0, 0))});
    const Eigen::Vector2d left = centroidOf(frame.left), right = centroidOf(frame.right);
    EXPECT_LT((left - rectifier.camera().leftPixel(point)).norm(), 0.3);
    EXPECT_LT((right - rectifier.camera().rightPixel(point)).norm(), 0.3);
    EXPECT_NEAR(left.y(), right.y(), 0.2);
  }
}

INSTANTIATE_TEST_SUITE_P(
    StereoRectifier, EveryLens,
    testing::Values(Lens{"none", DistortionModel::kNone, {}},
                    Lens{"plumbBob", DistortionModel::kPlumbBob, {-0.1, 0.01, 0.001, -0.001, 0}},
                    Lens{"rationalPolynomial",
                         DistortionModel::kRationalPolynomial,
                         {0.93, 0.35, 0.0007, -0.0008, 0.0067, 0.737, 0.362, 0.018}},
                    Lens{"equidistant", DistortionModel::kEquidistant, {0.02, 0.01, 0, 0}},
                    Lens{"leapInverse",
                         DistortionModel::kLeapInverse,
                         {1.272, 0.2982, 0.0177, 1.464, 0.3432, -0.006705, 0.00015, 0.00197}}),
    [](const auto& lens) { return lens.param.name; });

TEST(RectifiedCamera, hasSquarePixelsAndKeepsTheRawResolution) {
  const RectifiedStereoCamera camera = rectifiedCamera(pairOf(DistortionModel::kNone, {}), {});
  EXPECT_EQ(camera.size, cv::Size(640, 480));
  EXPECT_DOUBLE_EQ(camera.focal_length, 134);
  EXPECT_DOUBLE_EQ(camera.baseline, 0.04);
}

TEST(RectifiedCamera, followsItsParameters) {
  RectificationParams params;
  params.width = 200;
  params.height = 100;
  params.horizontal_fov_deg = 90;
  const RectifiedStereoCamera camera = rectifiedCamera(pairOf(DistortionModel::kNone, {}), params);
  EXPECT_EQ(camera.size, cv::Size(200, 100));
  EXPECT_NEAR(camera.focal_length, 100, 1e-9);
}

TEST(RectifiedCamera, refusesACalibrationWithoutFocalLengthOrBaseline) {
  StereoCalibration calibration = pairOf(DistortionModel::kNone, {});
  calibration.baseline = 0;
  EXPECT_THROW(rectifiedCamera(calibration, {}), std::invalid_argument);
  calibration = pairOf(DistortionModel::kNone, {});
  calibration.right.fx = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(rectifiedCamera(calibration, {}), std::invalid_argument);
  calibration = pairOf(DistortionModel::kNone, {});
  calibration.right.size = {320, 240};
  EXPECT_THROW(rectifiedCamera(calibration, {}), std::invalid_argument);
}

TEST(StereoRectifier, refusesAFrameOfAnotherSizeOrType) {
  const StereoCalibration calibration = pairOf(DistortionModel::kNone, {});
  const StereoRectifier rectifier(calibration, rectifiedCamera(calibration, {}));
  const cv::Mat good(240, 640, CV_8UC1, cv::Scalar(9)), small(120, 640, CV_8UC1, cv::Scalar(9)),
      wide(240, 640, CV_16UC1, cv::Scalar(9));
  EXPECT_THROW(rectifier.rectify({Stamp(), good, small}), std::invalid_argument);
  EXPECT_THROW(rectifier.rectify({Stamp(), wide, good}), std::invalid_argument);
}

TEST(StereoRectifier, leavesAnEmptyEyeEmpty) {
  const StereoCalibration calibration = pairOf(DistortionModel::kNone, {});
  const StereoRectifier rectifier(calibration, rectifiedCamera(calibration, {}));
  const cv::Mat good(240, 640, CV_8UC1, cv::Scalar(9));
  const RectifiedStereoFrame frame = rectifier.rectify({Stamp(), good, {}});
  EXPECT_FALSE(frame.left.empty());
  EXPECT_TRUE(frame.right.empty());
}

TEST(StereoRectifier, writesIntoImagesThatAreThere) {
  const StereoCalibration calibration = pairOf(DistortionModel::kNone, {});
  const StereoRectifier rectifier(calibration, rectifiedCamera(calibration, {}));
  const cv::Mat good(240, 640, CV_8UC1, cv::Scalar(9));
  RectifiedStereoFrame frame;
  frame.left.create(480, 640, CV_8UC1);
  frame.right.create(480, 640, CV_8UC1);
  const std::uint8_t* place = frame.left.data;
  rectifier.rectify({Stamp(), good, good}, frame);
  EXPECT_EQ(frame.left.data, place);
  EXPECT_EQ(frame.left.at<std::uint8_t>(240, 320), 9);
}

}  // namespace
}  // namespace leap_object_tracker
