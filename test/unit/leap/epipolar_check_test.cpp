#include "leap_object_tracker/leap/epipolar_check.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "leap_object_tracker/leap/leap_calibration.hpp"
#include "support/emulated_leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

/// Grey level of a wall with blobs of all sizes, 20 cm ahead.
std::uint8_t wall(double x, double y) {
  const auto cell = [](double a, double b) {
    const auto h = static_cast<std::uint32_t>(std::floor(a)) * 73856093u ^
                   static_cast<std::uint32_t>(std::floor(b)) * 19349663u;
    return (h * 2654435761u >> 24) / 255.0;
  };
  return static_cast<std::uint8_t>(20 + 110 * cell(x * 120 + 1e4, y * 120 + 1e4) +
                                   110 * cell(x * 45 + 1e4, y * 45 + 1e4));
}

cv::Mat picture(const CameraCalibration& eye, double eye_x) {
  cv::Mat image(eye.size, CV_8UC1);
  constexpr double kDistance = 0.2;
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u) {
      const Eigen::Vector2d raw = rayFromPixel(eye, Eigen::Vector2d(u, v));
      const Eigen::Vector2d ray = (eye.rectified_from_raw * raw.homogeneous()).hnormalized();
      image.at<std::uint8_t>(v, u) = wall(eye_x + kDistance * ray.x(), kDistance * ray.y());
    }
  return image;
}

TEST(EpipolarCheck, tellsTheRightConventionFromAWrongOne) {
  const LeapCalibrationRecord record = parseCalibration(calibrationOfUnitB());
  const auto with = [&](CalibrationConvention convention) {
    return stereoCalibration(record, LeapMode::k640x480, convention);
  };
  const StereoCalibration truth = with(CalibrationConvention::kRecommended);
  RawStereoFrame frame;
  frame.left = picture(truth.left, 0);
  frame.right = picture(truth.right, truth.baseline);

  const auto right = epipolarResidual(frame, truth);
  const auto wrong = epipolarResidual(frame, with(CalibrationConvention::kNone));
  ASSERT_TRUE(right);
  ASSERT_TRUE(wrong);
  EXPECT_LT(right->median, 0.6);
  EXPECT_GT(wrong->median, 1.5 * right->median);
}

TEST(EpipolarCheck, saysNothingOfAnEmptyPicture) {
  const StereoCalibration calibration =
      stereoCalibration(parseCalibration(calibrationOfUnitA()), LeapMode::k640x240,
                        CalibrationConvention::kRecommended);
  RawStereoFrame frame;
  frame.left = frame.right = cv::Mat(240, 640, CV_8UC1, cv::Scalar(5));
  EXPECT_FALSE(epipolarResidual(frame, calibration));
}

}  // namespace
}  // namespace leap_object_tracker
