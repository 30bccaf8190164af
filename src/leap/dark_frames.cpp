#include "leap_object_tracker/leap/dark_frames.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kMemory = 0.1;  // weight of a new mean
constexpr double kExtremeMemory = 0.02;
constexpr double kLeastContrast = 1;  // [grey levels] between lit and dark

/// linear(a) - scale * linear(b), with the square-root response of the device taken into account.
void subtractWithGamma(cv::Mat& lit, const cv::Mat& dark, double scale) {
  const auto s = static_cast<float>(scale);
  for (int v = 0; v < lit.rows; ++v) {
    std::uint8_t* a = lit.ptr(v);
    const std::uint8_t* b = dark.ptr(v);
    for (int u = 0; u < lit.cols; ++u) {
      const float difference =
          static_cast<float>(a[u] * a[u]) - s * static_cast<float>(b[u] * b[u]);
      a[u] = static_cast<std::uint8_t>(std::sqrt(std::max(difference, 0.0F)) + 0.5F);
    }
  }
}

}  // namespace

bool DarkFrameDetector::isDark(const FrameMetadata& metadata, double brightness,
                               int dark_interval) {
  if (dark_interval == 0) return false;
  if (dark_interval == 1) return true;

  const int label = metadata.label1 != 0;
  std::optional<double>& mean = mean_of_label_[label];
  mean = mean ? *mean + kMemory * (brightness - *mean) : brightness;
  frames_since_label_[label] = 0;
  ++frames_since_label_[1 - label];
  if (frames_since_label_[1 - label] > 4 * (dark_interval + 1)) mean_of_label_[1 - label].reset();

  const auto follow = [&](std::optional<double>& extreme, bool passed) {
    extreme = !extreme || passed ? brightness : *extreme + kExtremeMemory * (brightness - *extreme);
  };
  follow(brightest_, brightest_ && brightness > *brightest_);
  follow(darkest_, darkest_ && brightness < *darkest_);

  if (mean_of_label_[0] && mean_of_label_[1] && *mean_of_label_[0] != *mean_of_label_[1])
    return label == (*mean_of_label_[1] < *mean_of_label_[0] ? 1 : 0);
  if (*brightest_ - *darkest_ < kLeastContrast) return false;
  return brightness < (*brightest_ + *darkest_) / 2;
}

void AmbientSubtraction::setDark(const cv::Mat& left, const cv::Mat& right,
                                 const LeapControls& taken_with) {
  left.copyTo(dark_left_);
  right.copyTo(dark_right_);
  dark_light_ = taken_with.light();
}

bool AmbientSubtraction::subtract(cv::Mat& left, cv::Mat& right,
                                  const LeapControls& taken_with) const {
  if (dark_left_.size() != left.size() || dark_right_.size() != right.size() || dark_light_ <= 0)
    return false;
  const double scale = taken_with.light() / dark_light_;
  const auto subtractOne = [&](cv::Mat& lit, const cv::Mat& dark) {
    if (taken_with.gamma)
      subtractWithGamma(lit, dark, scale);
    else
      cv::addWeighted(lit, 1, dark, -scale, 0, lit);
  };
  subtractOne(left, dark_left_);
  subtractOne(right, dark_right_);
  return true;
}

}  // namespace leap_object_tracker
