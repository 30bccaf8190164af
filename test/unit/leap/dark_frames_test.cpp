#include "leap_object_tracker/leap/dark_frames.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

FrameMetadata labelled(int label) {
  FrameMetadata metadata;
  metadata.label1 = label;
  return metadata;
}

TEST(DarkFrameDetector, believesTheSettingThatSaysAllOrNone) {
  DarkFrameDetector detector;
  EXPECT_FALSE(detector.isDark(labelled(0), 2, 0));
  EXPECT_TRUE(detector.isDark(labelled(1), 200, 1));
}

TEST(DarkFrameDetector, followsTheLabelWhileLitFramesAreTheBrighterOnes) {
  DarkFrameDetector detector;
  int wrong = 0;
  for (int i = 0; i < 100; ++i) {
    const bool dark = i % 2 == 0;
    // Sunlight changes more from frame to frame than the LEDs add.
    const double brightness = 100 + 50 * std::sin(i * 0.05) + (dark ? 0 : 4);
    if (i > 10)
      wrong += detector.isDark(labelled(dark ? 0 : 1), brightness, 2) != dark;
    else
      detector.isDark(labelled(dark ? 0 : 1), brightness, 2);
  }
  EXPECT_EQ(0, wrong);
}

TEST(DarkFrameDetector, turnsTheLabelRoundIfTheDeviceMeansTheOpposite) {
  DarkFrameDetector detector;
  int wrong = 0;
  for (int i = 0; i < 60; ++i) {
    const bool dark = i % 3 == 0;
    const bool said = detector.isDark(labelled(dark ? 1 : 0), dark ? 5 : 40, 3);
    if (i > 6) wrong += said != dark;
  }
  EXPECT_EQ(0, wrong);
}

TEST(DarkFrameDetector, goesByBrightnessIfTheLabelNeverChanges) {
  for (const int period : {2, 5, 6}) {  // documents disagree on the period
    DarkFrameDetector detector;
    int wrong = 0;
    for (int i = 0; i < 200; ++i) {
      const bool dark = i % period == 0;
      const bool said = detector.isDark(labelled(1), dark ? 4 : 25, 5);
      if (i > 2 * period) wrong += said != dark;
    }
    EXPECT_EQ(0, wrong) << period;
  }
}

TEST(AmbientSubtraction, leavesTheLightOfTheLeds) {
  for (const bool gamma : {false, true}) {
    const auto response = [&](double light) {
      return std::min(255.0, gamma ? 255 * std::sqrt(light / 255) : light);
    };
    LeapControls controls;
    controls.gamma = gamma;
    const double sun = 60, leds = 90;
    const cv::Mat dark(4, 4, CV_8UC1, cv::Scalar(std::lround(response(sun))));
    cv::Mat left(4, 4, CV_8UC1, cv::Scalar(std::lround(response(sun + leds))));
    cv::Mat right = left.clone();
    AmbientSubtraction subtraction;
    EXPECT_FALSE(subtraction.subtract(left, right, controls));
    subtraction.setDark(dark, dark, controls);
    ASSERT_TRUE(subtraction.subtract(left, right, controls));
    EXPECT_NEAR(response(leds), left.at<std::uint8_t>(2, 2), 2);
    EXPECT_NEAR(response(leds), right.at<std::uint8_t>(0, 3), 2);
  }
}

TEST(AmbientSubtraction, scalesTheDarkFrameToAnotherExposure) {
  LeapControls of_dark, of_lit;
  of_dark.exposure_us = 100;
  of_lit.exposure_us = 200;
  const cv::Mat dark(4, 4, CV_8UC1, cv::Scalar(20));
  cv::Mat left(4, 4, CV_8UC1, cv::Scalar(150)), right = left.clone();
  AmbientSubtraction subtraction;
  subtraction.setDark(dark, dark, of_dark);
  ASSERT_TRUE(subtraction.subtract(left, right, of_lit));
  EXPECT_EQ(110, left.at<std::uint8_t>(1, 1));
}

TEST(AmbientSubtraction, neverGoesBelowBlack) {
  const cv::Mat dark(4, 4, CV_8UC1, cv::Scalar(90));
  cv::Mat left(4, 4, CV_8UC1, cv::Scalar(30)), right = left.clone();
  AmbientSubtraction subtraction;
  subtraction.setDark(dark, dark, {});
  ASSERT_TRUE(subtraction.subtract(left, right, {}));
  EXPECT_EQ(0, left.at<std::uint8_t>(1, 1));
}

}  // namespace
}  // namespace leap_object_tracker
