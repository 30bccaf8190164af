#pragma once

#include <optional>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"

namespace leap_object_tracker {

struct EpipolarResidual {
  int matches = 0;
  double median = 0;  ///< [px] difference of rows after rectification, at the focal length fx
};

/// How well a calibration brings both eyes' rows together, measured on a frame with texture (ORB
/// features matched across the eyes).
/// @return nullopt if the frame has too few matches
std::optional<EpipolarResidual> epipolarResidual(const RawStereoFrame& frame,
                                                 const StereoCalibration& calibration);

}  // namespace leap_object_tracker
