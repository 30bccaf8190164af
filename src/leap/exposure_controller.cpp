#include "leap_object_tracker/leap/exposure_controller.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

constexpr int kSaturated = 250;
constexpr double kBlackLevel = 3;      // of the sensor
constexpr double kFaintest = 6;        // below it a level says little
constexpr double kLargestRise = 4;     // in one step, from so faint a picture
constexpr double kHighestLevel = 220;  // of the brightest share that may not saturate
constexpr double kHoldBelow = 1.25, kHoldAbove = 1.05;
constexpr int kMostSamples = 40000;
constexpr double kGlowMargin = 0.1;  // share of the width at each side that the LEDs shine into

struct Histogram {
  std::array<int, 256> count = {};
  int total = 0;

  double shareFrom(int level) const {
    int above = 0;
    for (int i = level; i < 256; ++i) above += count[i];
    return total ? static_cast<double>(above) / total : 0;
  }
  int level(double share) const {
    int seen = 0;
    for (int i = 0; i < 256; ++i) {
      seen += count[i];
      if (seen > share * total) return i;
    }
    return 255;
  }
};

Histogram histogram(const cv::Mat& image, const cv::Rect& region) {
  const cv::Rect whole(0, 0, image.cols, image.rows);
  const int margin = static_cast<int>(kGlowMargin * image.cols);
  const cv::Rect part = region.area() > 0
                            ? (region & whole)
                            : cv::Rect(margin, 0, image.cols - 2 * margin, image.rows);
  const int step =
      std::max(1, static_cast<int>(std::sqrt(static_cast<double>(part.area()) / kMostSamples)));
  Histogram histogram;
  for (int v = part.y; v < part.y + part.height; v += step)
    for (int u = part.x; u < part.x + part.width; u += step) {
      ++histogram.count[image.at<std::uint8_t>(v, u)];
      ++histogram.total;
    }
  return histogram;
}

/// How far to go down when part of the picture is at the end of the scale and cannot tell.
/// @param excess share of saturated pixels over the allowed one
double retreat(double excess) {
  if (excess > 30) return 0.1;
  if (excess > 6) return 0.3;
  return 0.7;
}

double linearLevel(int level, bool gamma) {
  const double linear = gamma ? level * level / 255.0 : level;
  return linear - kBlackLevel;
}

}  // namespace

ExposureController::ExposureController(const ExposureParams& params) : params_(params) {
  const auto share = [](double value) { return value > 0 && value < 1; };
  if (!(params.bright_level >= 20 && params.bright_level <= 240) || !share(params.bright_share) ||
      !share(params.bright_share_image) || !share(params.most_saturated) ||
      !share(params.most_saturated_image) || params.longest_exposure_us < kShortestExposureUs ||
      params.longest_exposure_us > kLongestExposureUs || params.most_gain < kLeastAnalogGain ||
      params.most_gain > kMostAnalogGain)
    throw std::invalid_argument(
        "auto exposure: bright_level must be 20 to 240, shares between 0 and 1, "
        "longest_exposure_us 10 to 65535, most_gain 16 to 63");
}

std::optional<LeapControls> ExposureController::update(const cv::Mat& image, const cv::Rect& region,
                                                       const LeapControls& taken_with,
                                                       const LeapControls& commanded) const {
  const Histogram seen = histogram(image, region);
  if (seen.total == 0) return std::nullopt;
  const double saturated = seen.shareFrom(kSaturated);
  const bool knows_region = region.area() > 0;
  const double share = knows_region ? params_.bright_share : params_.bright_share_image;
  const double most_saturated =
      knows_region ? params_.most_saturated : params_.most_saturated_image;
  const double bright = linearLevel(seen.level(share), taken_with.gamma);
  const double brightest = linearLevel(seen.level(1 - most_saturated), taken_with.gamma);

  double wanted;
  if (saturated > most_saturated)
    wanted = taken_with.light() * retreat(saturated / most_saturated);
  else if (std::max(bright, brightest) < kFaintest)
    wanted = taken_with.light() * kLargestRise;
  else
    wanted = taken_with.light() * std::min(params_.bright_level / std::max(bright, 1.0),
                                           kHighestLevel / std::max(brightest, 1.0));

  const double now = commanded.light();
  const bool good_enough =
      saturated <= most_saturated && now > wanted / kHoldBelow && now < wanted * kHoldAbove;
  if (good_enough) return std::nullopt;
  const LeapControls next = withLight(commanded, wanted);
  if (next == commanded) return std::nullopt;
  return next;
}

double ExposureController::saturatedShare(const cv::Mat& image, const cv::Rect& region) {
  return histogram(image, region).shareFrom(kSaturated);
}

LeapControls ExposureController::withLight(const LeapControls& controls, double light) const {
  LeapControls next = controls;
  const double per_digital_gain = light / (controls.digital_gain / 4.0);
  next.exposure_us = std::clamp(static_cast<int>(std::lround(per_digital_gain)),
                                kShortestExposureUs, params_.longest_exposure_us);
  next.analog_gain =
      std::clamp(static_cast<int>(std::lround(16 * per_digital_gain / next.exposure_us)),
                 kLeastAnalogGain, params_.most_gain);
  return next;
}

}  // namespace leap_object_tracker
