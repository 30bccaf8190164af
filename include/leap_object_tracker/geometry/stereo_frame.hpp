#pragma once

#include <opencv2/core.hpp>

#include "leap_object_tracker/geometry/pose.hpp"

namespace leap_object_tracker {

/// Both eyes as the sensor saw them: 8-bit grey (CV_8UC1), equal sizes, lens distortion included.
struct RawStereoFrame {
  Stamp stamp;  ///< middle of the exposure
  cv::Mat left;
  cv::Mat right;
};

/// Both eyes of an ideal pinhole pair: 8-bit grey (CV_8UC1), equal sizes, rows aligned.
/// One eye may be empty where the camera did not deliver it.
struct RectifiedStereoFrame {
  Stamp stamp;  ///< middle of the exposure
  cv::Mat left;
  cv::Mat right;
};

}  // namespace leap_object_tracker
