#pragma once

#include <string>

#include "leap_object_tracker/leap/exposure_controller.hpp"
#include "leap_object_tracker/leap/leap_calibration.hpp"
#include "leap_object_tracker/leap/leap_camera.hpp"
#include "parameters.hpp"

namespace leap_object_tracker {

struct DriverNodeParams {
  LeapCameraParams camera;
  CalibrationConvention convention = CalibrationConvention::kRecommended;
  std::string left_calibration_url;
  std::string right_calibration_url;
  std::string left_frame = "leap_left_optical_frame";
  std::string right_frame = "leap_right_optical_frame";
  ExposureParams exposure;
};

/// Leaves out the keys of config/LeapDriver.cfg.
/// @throw std::invalid_argument naming key, value and what is allowed
DriverNodeParams readDriverNodeParams(ParameterReader& reader);

}  // namespace leap_object_tracker
