#include "leap_object_tracker/leap/exposure_controller.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "leap_object_tracker/leap/control_history.hpp"

namespace leap_object_tracker {
namespace {

const cv::Rect kObject(60, 20, 40, 30);

/// A square before a dark background, lit from the camera: light falls with the square of distance.
cv::Mat picture(double distance, const LeapControls& controls, std::mt19937& random) {
  constexpr double kBrightness = 0.6;  // [grey level / us] at 10 cm
  const double near = kBrightness * std::pow(0.1 / distance, 2) * controls.light();
  std::normal_distribution<double> noise(0, 1.5);
  cv::Mat image(80, 160, CV_8UC1);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u) {
      const bool on_object = kObject.contains({u, v});
      const double shade = on_object ? 0.6 + 0.4 * (u - kObject.x) / kObject.width : 0.01;
      double level = near * shade + 3 + noise(random);
      level = std::clamp(level, 0.0, 255.0);
      if (controls.gamma) level = 255 * std::sqrt(level / 255);
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(level);
    }
  return image;
}

/// Settings act two frames after they were sent.
class Loop {
 public:
  explicit Loop(const ExposureParams& params, const LeapControls& start)
      : controller_(params), commanded_(start), on_their_way_(3, start) {}

  /// @return the picture of this frame
  cv::Mat step(double distance, const cv::Rect& region) {
    const LeapControls in_force = on_their_way_.front();
    on_their_way_.pop_front();
    const cv::Mat image = picture(distance, in_force, random_);
    if (const auto next = controller_.update(image, region, in_force, commanded_)) {
      commanded_ = *next;
      ++changes_;
    }
    on_their_way_.push_back(commanded_);
    return image;
  }
  int changes() const { return changes_; }
  const LeapControls& commanded() const { return commanded_; }

 private:
  ExposureController controller_;
  LeapControls commanded_;
  std::deque<LeapControls> on_their_way_;
  std::mt19937 random_{1};
  int changes_ = 0;
};

double saturatedOnObject(const cv::Mat& image) {
  return ExposureController::saturatedShare(image, kObject);
}

class ExposureLoop : public testing::TestWithParam<std::tuple<bool, bool>> {};

TEST_P(ExposureLoop, survivesAStepFrom30To5CentimetresWithinTenFrames) {
  const auto [gamma, knows_region] = GetParam();
  LeapControls start;
  start.gamma = gamma;
  Loop loop(ExposureParams(), start);
  const cv::Rect region = knows_region ? kObject : cv::Rect();
  for (int i = 0; i < 60; ++i) loop.step(0.30, region);
  EXPECT_GT(loop.commanded().light(), 500);
  for (int i = 0; i < 10; ++i) loop.step(0.05, region);
  for (int i = 0; i < 50; ++i) EXPECT_LT(saturatedOnObject(loop.step(0.05, region)), 0.01);
}

TEST_P(ExposureLoop, restsOnceThePictureIsGood) {
  const auto [gamma, knows_region] = GetParam();
  LeapControls start;
  start.gamma = gamma;
  for (const double distance : {0.05, 0.1, 0.2, 0.3}) {
    Loop loop(ExposureParams(), start);
    const cv::Rect region = knows_region ? kObject : cv::Rect();
    for (int i = 0; i < 40; ++i) loop.step(distance, region);
    const int settled = loop.changes();
    for (int i = 0; i < 300; ++i) loop.step(distance, region);
    EXPECT_LE(loop.changes() - settled, 1) << distance;
  }
}

INSTANTIATE_TEST_SUITE_P(All, ExposureLoop, testing::Combine(testing::Bool(), testing::Bool()));

TEST(ExposureController, bringsTheObjectToTheWantedLevel) {
  ExposureParams params;
  Loop loop(params, LeapControls());
  cv::Mat image;
  for (int i = 0; i < 40; ++i) image = loop.step(0.1, kObject);
  std::vector<std::uint8_t> levels;
  for (int v = kObject.y; v < kObject.br().y; ++v)
    for (int u = kObject.x; u < kObject.br().x; ++u) levels.push_back(image.at<std::uint8_t>(v, u));
  std::sort(levels.begin(), levels.end());
  const double bright = levels[static_cast<std::size_t>(params.bright_share * levels.size())];
  EXPECT_NEAR(params.bright_level, bright, 0.25 * params.bright_level);
}

TEST(ExposureController, usesGainOnlyWhenTheLongestExposureIsTooShort) {
  ExposureParams params;
  params.longest_exposure_us = 300;
  Loop near(params, LeapControls());
  for (int i = 0; i < 40; ++i) near.step(0.1, kObject);
  EXPECT_EQ(kLeastAnalogGain, near.commanded().analog_gain);
  Loop far(params, LeapControls());
  for (int i = 0; i < 40; ++i) far.step(0.16, kObject);
  EXPECT_EQ(300, far.commanded().exposure_us);
  EXPECT_GT(far.commanded().analog_gain, kLeastAnalogGain);
}

TEST(ExposureController, staysWithinItsLimitsInTheDark) {
  ExposureParams params;
  Loop loop(params, LeapControls());
  for (int i = 0; i < 40; ++i) loop.step(5, kObject);
  EXPECT_EQ(params.longest_exposure_us, loop.commanded().exposure_us);
  EXPECT_EQ(params.most_gain, loop.commanded().analog_gain);
}

TEST(ExposureController, ignoresARegionOutsideTheImage) {
  const ExposureController controller{ExposureParams()};
  const cv::Mat image(80, 160, CV_8UC1, cv::Scalar(255));
  EXPECT_FALSE(controller.update(image, cv::Rect(500, 500, 10, 10), {}, {}));
}

TEST(ExposureController, refusesSenselessParameters) {
  ExposureParams params;
  params.bright_share = 1.5;
  EXPECT_THROW(ExposureController{params}, std::invalid_argument);
  params = ExposureParams();
  params.most_gain = 100;
  EXPECT_THROW(ExposureController{params}, std::invalid_argument);
}

TEST(ControlHistory, tellsTheSettingsOfAFrameFromTheirLowerBits) {
  ControlHistory history;
  LeapControls controls;
  controls.exposure_us = 700;
  controls.analog_gain = 40;
  history.sent(controls);
  controls.exposure_us = 100;
  history.sent(controls);
  FrameMetadata metadata;
  metadata.exposure_bits = 700 % 512;
  metadata.gain_bits = 40 % 32;
  EXPECT_EQ(700, history.ofFrame(metadata).exposure_us);
  metadata.exposure_bits = 100;
  EXPECT_EQ(100, history.ofFrame(metadata).exposure_us);
  metadata.exposure_bits = 1;
  EXPECT_EQ(100, history.ofFrame(metadata).exposure_us);
}

}  // namespace
}  // namespace leap_object_tracker
