#include "leap_object_tracker/simulation/leap_sensor.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "leap_object_tracker/simulation/hash_random.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kMetadataPixels = 6;
constexpr std::uint8_t kMetadataTag = 0x78;

/// LEDs beside the lenses shine into them: a patch at the left and the right border.
cv::Mat makeGlow(const SensorMode& mode, double strength) {
  constexpr double kReach = 18, kHeight = 60;  // [px of the 480-row grid]
  cv::Mat glow(mode.height, mode.width, CV_32FC1);
  for (int v = 0; v < mode.height; ++v)
    for (int u = 0; u < mode.width; ++u) {
      const double row = ((v + 0.5) * mode.rowsPerPixel() - 240) / kHeight;
      const double left = u / kReach, right = (mode.width - 1 - u) / kReach;
      glow.at<float>(v, u) = static_cast<float>(
          strength * std::exp(-row * row) * (std::exp(-left * left) + std::exp(-right * right)));
    }
  return glow;
}

}  // namespace

LeapSensor::LeapSensor(const SensorParams& params, const SensorMode& mode, std::uint64_t unit)
    : params_(params), mode_(mode), glow_(makeGlow(mode, params.glow)) {
  fixed_noise_.create(mode.height, mode.width, CV_32FC1);
  HashRandom random(unit);
  for (int v = 0; v < mode.height; ++v)
    for (int u = 0; u < mode.width; ++u)
      fixed_noise_.at<float>(v, u) = static_cast<float>(params.fixed_noise * random.normal());
}

cv::Mat LeapSensor::expose(const cv::Mat& radiance, const SensorControls& controls, bool lit,
                           std::uint64_t name) const {
  cv::Mat light = radiance.clone();
  if (params_.lens_blur > 0)
    cv::GaussianBlur(light, light, cv::Size(5, 5), params_.lens_blur,
                     params_.lens_blur / mode_.rowsPerPixel(), cv::BORDER_REPLICATE);
  if (lit) light += glow_;

  const double gain = controls.gain / 16.0 * controls.digital_gain / 4.0;
  const double electrons_per_count = params_.full_well / 255;
  const double rows = mode_.rowsPerPixel();  // averaged by the sensor
  cv::Mat image(mode_.height, mode_.width, CV_8UC1);
  tbb::parallel_for(0, mode_.height, [&](int v) {
    for (int u = 0; u < mode_.width; ++u) {
      HashRandom random(name, static_cast<std::uint64_t>(v) * 4096 + static_cast<std::uint64_t>(u));
      const double counts = std::min(255.0, light.at<float>(v, u) * controls.exposure_us);
      const double shot_variance = counts / electrons_per_count;
      const double read_variance = params_.read_noise * params_.read_noise;
      const double noise = std::sqrt((shot_variance + read_variance) / rows) * random.fastNormal();
      double value = gain * (counts + noise + fixed_noise_.at<float>(v, u)) + params_.dark_offset;
      if (controls.gamma) value = std::sqrt(std::max(0.0, value) * 255);
      image.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(value);
    }
  });
  return image;
}

void embedMetadata(cv::Mat& left, cv::Mat& right, const SensorControls& controls, bool lit) {
  const auto exposure = static_cast<unsigned>(std::lround(controls.exposure_us));
  const auto gain = static_cast<unsigned>(controls.gain);
  constexpr unsigned kLabel2 = 0;
  const unsigned label1 = lit ? 1 : 0;
  const std::array<unsigned, kMetadataPixels> samples{
      kMetadataTag,    kLabel2 >> 4, kLabel2 & 0x0F, label1 << 4 | (exposure >> 5 & 0x0F),
      exposure & 0x1F, gain & 0x1F};
  for (int i = 0; i < kMetadataPixels; ++i)
    for (cv::Mat* image : {&left, &right})
      image->at<std::uint8_t>(image->rows - 1, image->cols - kMetadataPixels + i) =
          static_cast<std::uint8_t>(samples[static_cast<std::size_t>(i)]);
}

double brightestOf(const cv::Mat& left, const cv::Mat& right) {
  constexpr double kBrightestShare = 2e-3;  // of all pixels
  std::array<int, 256> histogram{};
  for (const cv::Mat* image : {&left, &right})
    for (int v = 0; v < image->rows - 1; ++v)
      for (int u = 0; u < image->cols; ++u) ++histogram[image->at<std::uint8_t>(v, u)];
  const int wanted_pixels = static_cast<int>(kBrightestShare * 2 * left.rows * left.cols);
  double sum = 0;
  int pixels = 0;
  for (int value = 255; value >= 0 && pixels < wanted_pixels; --value) {
    const int taken = std::min(histogram[static_cast<std::size_t>(value)], wanted_pixels - pixels);
    pixels += taken;
    sum += taken * value;
  }
  return sum / std::max(1, pixels);
}

SensorControls brighter(const SensorControls& controls, double factor, double longest_exposure_us) {
  constexpr int kUnitGain = 16, kMostGain = 31;
  const double product = std::clamp(controls.exposure_us * controls.gain * factor, 10.0 * kUnitGain,
                                    longest_exposure_us * kMostGain);
  SensorControls result = controls;
  result.exposure_us = std::round(std::clamp(product / kUnitGain, 10.0, longest_exposure_us));
  result.gain =
      std::clamp(static_cast<int>(std::lround(product / result.exposure_us)), kUnitGain, kMostGain);
  return result;
}

SensorControls AutoExposure::after(const cv::Mat& left, const cv::Mat& right,
                                   const SensorControls& controls) {
  constexpr double kTarget = 190;        // [counts] of the brightest
  constexpr int kEvery = 3, kDelay = 2;  // [frames]

  SensorControls next = controls;
  if (frames_until_obeyed_ == 0) next = wanted_;
  if (frames_until_obeyed_ >= 0) --frames_until_obeyed_;
  if (frames_++ % kEvery != 0 || frames_until_obeyed_ >= 0) return next;

  double brightest = std::max(4.0, brightestOf(left, right));
  double target = kTarget;
  if (controls.gamma) brightest *= brightest, target *= target;
  const double factor = std::clamp(target / brightest, 0.7, 1.4);
  if (factor > 0.93 && factor < 1.07) return next;
  wanted_ = brighter(next, factor, longest_exposure_us_);
  frames_until_obeyed_ = kDelay - 1;
  return next;
}

}  // namespace leap_object_tracker
