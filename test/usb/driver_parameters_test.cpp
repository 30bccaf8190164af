#include "ros/driver_parameters.hpp"

#include <gtest/gtest.h>

#include "ros/driver_messages.hpp"
#include "support/emulated_leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

DriverNodeParams readText(const std::string& yaml) {
  ParameterReader reader(YAML::Load(yaml), "the test");
  return readDriverNodeParams(reader);
}

std::string refusal(const std::string& yaml) {
  try {
    readText(yaml);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(DriverParameters, shippedFileHoldsTheDefaults) {
  ParameterReader reader(loadYamlFile(LEAP_SOURCE_FOLDER "/config/driver.yaml"), "driver.yaml");
  const DriverNodeParams shipped = readDriverNodeParams(reader);
  const DriverNodeParams defaults = readText("{}");
  EXPECT_EQ(defaults.camera.stream.mode, shipped.camera.stream.mode);
  EXPECT_EQ(defaults.camera.stream.transfers, shipped.camera.stream.transfers);
  EXPECT_EQ(defaults.convention, shipped.convention);
  EXPECT_EQ(defaults.left_frame, shipped.left_frame);
  EXPECT_EQ(defaults.exposure.bright_level, shipped.exposure.bright_level);
  EXPECT_EQ(defaults.exposure.most_saturated_image, shipped.exposure.most_saturated_image);
  EXPECT_EQ(defaults.exposure.longest_exposure_us, shipped.exposure.longest_exposure_us);
  EXPECT_EQ(defaults.exposure.most_gain, shipped.exposure.most_gain);
}

TEST(DriverParameters, takeAllSixModes) {
  for (const LeapModeInfo& mode : leapModes())
    EXPECT_EQ(mode.mode, readText(std::string("{mode: ") + mode.name + "}").camera.stream.mode);
}

TEST(DriverParameters, refuseUnknownKeysAndValuesByName) {
  EXPECT_NE(std::string::npos, refusal("{modes: 640x240}").find("modes"));
  EXPECT_NE(std::string::npos, refusal("{mode: 320x240}").find("640x120"));
  EXPECT_NE(std::string::npos, refusal("{exposure: {most_gain: 100}}").find("most_gain"));
  EXPECT_NE(std::string::npos, refusal("{calibration_convention: mine}").find("leapuvc"));
}

TEST(DriverMessages, bringTheExactCalibrationAcross) {
  const StereoCalibration sent =
      stereoCalibration(parseCalibration(calibrationOfUnitB()), LeapMode::k752x240,
                        CalibrationConvention::kRecommended);
  const StereoCalibration received = calibrationFrom(messageFrom(sent));
  EXPECT_EQ(sent.baseline, received.baseline);
  EXPECT_EQ(sent.right.distortion, received.right.distortion);
  EXPECT_EQ(sent.left.size, received.left.size);
  EXPECT_TRUE(sent.left.rectified_from_raw.isApprox(received.left.rectified_from_raw, 1e-15));
  EXPECT_EQ(sent.left.cy, received.left.cy);
}

TEST(DriverMessages, markACalibrationThatIsNotExact) {
  const StereoCalibration other = stereoCalibration(
      parseCalibration(calibrationOfUnitA()), LeapMode::k640x480, CalibrationConvention::kLeapuvc);
  EXPECT_FALSE(messageFrom(other).valid);
  EXPECT_THROW(calibrationFrom(messageFrom(other)), std::invalid_argument);
}

}  // namespace
}  // namespace leap_object_tracker
