#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "leap_object_tracker/leap/leap_protocol.hpp"

namespace leap_object_tracker {

struct ExposureParams {
  double bright_level = 150;              ///< wanted level of the bright parts, 0 to 255, linear
  double bright_share = 0.90;             ///< share of a region's pixels that are darker than these
  double most_saturated = 0.005;          ///< share of its pixels that may be at the upper end
  double bright_share_image = 0.997;      ///< the same two where no region is known, of the whole
  double most_saturated_image = 0.00015;  ///< image without the glow of the LEDs at its sides
  int longest_exposure_us = 500;          ///< [us] longer ones blur
  int most_gain = 48;                     ///< [1/16]
};

/// Keeps a part of the picture well exposed, over exposure time first and analog gain after.
///
/// Each frame tells how bright the scene is per unit of light gathered, whatever settings it was
/// taken with. So the delay between command and effect cannot make the loop swing.
class ExposureController {
 public:
  /// @throw std::invalid_argument for values out of range
  explicit ExposureController(const ExposureParams& params);

  /// @param region [px] to look at; the whole image if empty
  /// @param taken_with settings in force when this frame was exposed
  /// @param commanded settings that were last sent
  /// @return settings to send, if they should change
  std::optional<LeapControls> update(const cv::Mat& image, const cv::Rect& region,
                                     const LeapControls& taken_with,
                                     const LeapControls& commanded) const;

  /// Share of pixels at the upper end.
  static double saturatedShare(const cv::Mat& image, const cv::Rect& region);

 private:
  LeapControls withLight(const LeapControls& controls, double light) const;

  ExposureParams params_;
};

}  // namespace leap_object_tracker
