#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/leap/byte_view.hpp"
#include "leap_object_tracker/leap/leap_protocol.hpp"

namespace leap_object_tracker {

constexpr std::size_t kCalibrationBytes = 156;

/// One eye as the device's memory describes it, for the 640x480 grid.
struct LeapEyeRecord {
  double focal_length = 0;                                ///< [px]
  double offset_u = 0, offset_v = 0;                      ///< principal point from (320, 240) [px]
  double p1 = 0, p2 = 0;                                  ///< tangential
  std::array<double, 6> radial = {};                      ///< k1 k2 k3 / k4 k5 k6
  double rectified_focal_length = 0;                      ///< [px]
  double rectified_offset_u = 0, rectified_offset_v = 0;  ///< [px]
  Eigen::Vector3d rotation = Eigen::Vector3d::Zero();     ///< as stored; see CalibrationConvention
};

/// The calibration in the device's memory.
struct LeapCalibrationRecord {
  int version = 0;
  int score = 0;
  std::uint32_t unix_time = 0;  ///< [s] when it was calibrated
  double baseline_mm = 0;       ///< [mm]
  double center_shift = 0;      ///< (right - left rectified centre) / baseline [px/mm]
  LeapEyeRecord left;
  LeapEyeRecord right;
};

/// How the stored numbers are read; the maker never documented rotation and tangential part.
enum class CalibrationConvention {
  kRecommended,  ///< rotation by |rho| about (-x, y, -z), tangential part from pixel to ray
  kLeapuvc,      ///< as the maker's Python example: Cayley map of -rho, tangential as in OpenCV
  kNone,         ///< radial part only
};
std::optional<CalibrationConvention> calibrationConventionFromName(const std::string& name);
const char* name(CalibrationConvention convention);

/// Sum modulo 2^32 of the little-endian words before the last one, which holds the same number.
bool calibrationChecksumHolds(ByteView bytes);

/// @throw std::invalid_argument naming the check that failed
LeapCalibrationRecord parseCalibration(ByteView bytes);

/// What is unusual about a record that is still good to use.
std::vector<std::string> calibrationWarnings(const LeapCalibrationRecord& record);

/// The pair in a mode: windows of 752 columns are centred, rows are binned.
StereoCalibration stereoCalibration(const LeapCalibrationRecord& record, LeapMode mode,
                                    CalibrationConvention convention);

}  // namespace leap_object_tracker
