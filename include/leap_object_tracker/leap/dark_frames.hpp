#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "leap_object_tracker/leap/frame_metadata.hpp"
#include "leap_object_tracker/leap/leap_protocol.hpp"

namespace leap_object_tracker {

/// Tells frames without LED light from lit ones. Trusts the label in the frame as long as frames
/// with one label are brighter than those with the other; else brightness alone.
class DarkFrameDetector {
 public:
  /// @param brightness mean of the picture, 0 to 255
  bool isDark(const FrameMetadata& metadata, double brightness, int dark_interval);

 private:
  std::optional<double> mean_of_label_[2];
  int frames_since_label_[2] = {0, 0};
  std::optional<double> brightest_;
  std::optional<double> darkest_;
};

/// Takes sunlight out of lit frames with the latest dark one.
class AmbientSubtraction {
 public:
  void setDark(const cv::Mat& left, const cv::Mat& right, const LeapControls& taken_with);

  /// Subtracts in place; the dark frame is scaled to the settings of the lit one.
  /// @return false while no dark frame is known
  bool subtract(cv::Mat& left, cv::Mat& right, const LeapControls& taken_with) const;

 private:
  cv::Mat dark_left_;
  cv::Mat dark_right_;
  double dark_light_ = 0;
};

}  // namespace leap_object_tracker
