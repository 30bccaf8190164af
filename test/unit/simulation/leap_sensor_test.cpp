#include "leap_object_tracker/simulation/leap_sensor.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace leap_object_tracker {
namespace {

const SensorMode kMode = sensorMode("640x240");

std::vector<int> lastBytes(const SensorControls& controls, bool lit) {
  cv::Mat left(kMode.height, kMode.width, CV_8UC1, cv::Scalar(7));
  cv::Mat right = left.clone();
  embedMetadata(left, right, controls, lit);
  std::vector<int> bytes;  // as the device sends them: left, right, left ...
  for (int i = 6; i >= 1; --i) {
    bytes.push_back(left.at<std::uint8_t>(kMode.height - 1, kMode.width - i));
    bytes.push_back(right.at<std::uint8_t>(kMode.height - 1, kMode.width - i));
  }
  return bytes;
}

SensorParams noiseless() {
  SensorParams params;
  params.full_well = 1e9;
  params.read_noise = params.fixed_noise = params.dark_offset = params.glow = params.lens_blur = 0;
  return params;
}

int grayOf(double radiance, const SensorControls& controls) {
  const LeapSensor sensor(noiseless(), kMode, 1);
  const cv::Mat light(kMode.height, kMode.width, CV_32FC1, cv::Scalar(radiance));
  return sensor.expose(light, controls, true, 1).at<std::uint8_t>(100, 300);
}

TEST(EmbedMetadata, writesTheBytesOfTwoRecordedFrames) {
  SensorControls controls;
  controls.exposure_us = 511;
  controls.gain = 22;
  EXPECT_EQ(lastBytes(controls, true),
            (std::vector<int>{0x78, 0x78, 0, 0, 0, 0, 0x1f, 0x1f, 0x1f, 0x1f, 0x16, 0x16}));
  controls.gain = 31;
  EXPECT_EQ(lastBytes(controls, true),
            (std::vector<int>{0x78, 0x78, 0, 0, 0, 0, 0x1f, 0x1f, 0x1f, 0x1f, 0x1f, 0x1f}));
}

TEST(EmbedMetadata, keepsExposureModulo512AndTheLabelOfADarkFrame) {
  SensorControls controls;
  controls.exposure_us = 512 + 33;
  controls.gain = 32 + 5;
  EXPECT_EQ(lastBytes(controls, false),
            (std::vector<int>{0x78, 0x78, 0, 0, 0, 0, 1, 1, 1, 1, 5, 5}));
}

TEST(LeapSensor, isLinearInExposureAndGains) {
  SensorControls controls;
  controls.exposure_us = 100;
  EXPECT_EQ(grayOf(0.5, controls), 50);
  controls.exposure_us = 200;
  EXPECT_EQ(grayOf(0.5, controls), 100);
  controls.gain = 24;
  EXPECT_EQ(grayOf(0.5, controls), 150);
  controls.digital_gain = 6;
  EXPECT_EQ(grayOf(0.5, controls), 225);
  controls.digital_gain = 8;
  EXPECT_EQ(grayOf(0.5, controls), 255);
}

TEST(LeapSensor, takesTheSquareRootWithGamma) {
  SensorControls controls;
  controls.exposure_us = 100;
  controls.gamma = true;
  EXPECT_EQ(grayOf(0.64, controls), 128);  // sqrt(64 * 255)
}

TEST(LeapSensor, hasShotNoiseThatBinningHalves) {
  SensorParams params = noiseless();
  params.full_well = 2550;  // 10 electrons a count: 100 counts +- sqrt(10)
  SensorControls controls;
  controls.exposure_us = 100;
  const auto varianceIn = [&](const char* name) {
    const SensorMode mode = sensorMode(name);
    const cv::Mat light(mode.height, mode.width, CV_32FC1, cv::Scalar(1));
    cv::Scalar mean, deviation;
    cv::meanStdDev(LeapSensor(params, mode, 1).expose(light, controls, true, 2), mean, deviation);
    EXPECT_NEAR(mean[0], 100, 0.05);
    return deviation[0] * deviation[0];
  };
  constexpr double kRounding = 1.0 / 12;
  EXPECT_NEAR(varianceIn("640x480"), 10 + kRounding, 0.2);
  EXPECT_NEAR(varianceIn("640x240"), 5 + kRounding, 0.1);
}

TEST(AutoExposure, bringsAGrayPatchToItsTargetAndDoesNotSwing) {
  AutoExposure control(511);
  SensorControls controls;
  controls.exposure_us = 20;
  cv::Mat image(240, 640, CV_8UC1);
  const auto expose = [&] {
    image.setTo(3);
    image(cv::Rect(300, 100, 40, 40))
        .setTo(std::min(255.0, 0.8 * controls.exposure_us * controls.gain / 16));
  };
  for (int i = 0; i < 60; ++i) {
    expose();
    controls = control.after(image, image, controls);
  }
  expose();
  EXPECT_NEAR(image.at<std::uint8_t>(120, 320), 190, 15);
  EXPECT_EQ(controls.gain, 16);
  const double settled = controls.exposure_us;
  for (int i = 0; i < 9; ++i) controls = control.after(image, image, controls);
  EXPECT_EQ(controls.exposure_us, settled);
}

TEST(AutoExposure, raisesGainOnlyAtTheLongestExposure) {
  AutoExposure control(300);
  SensorControls controls;
  const cv::Mat dark(240, 640, CV_8UC1, cv::Scalar(10));
  for (int i = 0; i < 60; ++i) controls = control.after(dark, dark, controls);
  EXPECT_EQ(controls.exposure_us, 300);
  EXPECT_EQ(controls.gain, 31);
}

}  // namespace
}  // namespace leap_object_tracker
