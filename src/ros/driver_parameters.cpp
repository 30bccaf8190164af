#include "driver_parameters.hpp"

namespace leap_object_tracker {

DriverNodeParams readDriverNodeParams(ParameterReader& reader) {
  DriverNodeParams params;
  std::vector<std::pair<std::string, LeapMode>> modes;
  for (const LeapModeInfo& mode : leapModes()) modes.emplace_back(mode.name, mode.mode);
  std::vector<std::pair<std::string, CalibrationConvention>> conventions;
  for (const auto convention : {CalibrationConvention::kRecommended,
                                CalibrationConvention::kLeapuvc, CalibrationConvention::kNone})
    conventions.emplace_back(name(convention), convention);

  LeapStreamParams& stream = params.camera.stream;
  reader.read("serial", params.camera.serial);
  reader.read("mode", stream.mode, modes);
  reader.read("calibration_convention", params.convention, conventions);
  reader.read("left_calibration_url", params.left_calibration_url);
  reader.read("right_calibration_url", params.right_calibration_url);
  reader.read("left_frame", params.left_frame);
  reader.read("right_frame", params.right_frame);
  reader.read("stamp_offset", stream.stamp_offset, {-1, 1});
  reader.read("transfers", stream.transfers, {4, 256});
  reader.section("exposure", [&](ParameterReader& section) {
    ExposureParams& exposure = params.exposure;
    section.read("bright_level", exposure.bright_level, {20, 240});
    section.read("bright_share", exposure.bright_share, {0.01, 0.99});
    section.read("bright_share_image", exposure.bright_share_image, {0.01, 0.9999});
    section.read("most_saturated", exposure.most_saturated, {0.00001, 0.5});
    section.read("most_saturated_image", exposure.most_saturated_image, {0.00001, 0.5});
    section.read("longest_exposure_us", exposure.longest_exposure_us,
                 {kShortestExposureUs, kLongestExposureUs});
    section.read("most_gain", exposure.most_gain, {kLeastAnalogGain, kMostAnalogGain});
  });
  for (const char* key :
       {"auto_exposure", "exposure_us", "analog_gain", "digital_gain", "gamma", "hdr", "led_left",
        "led_centre", "led_right", "dark_interval", "subtract_ambient"})
    reader.ignore(key);
  reader.finish();
  return params;
}

}  // namespace leap_object_tracker
