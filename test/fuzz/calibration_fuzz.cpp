// Input: one byte whose lowest bit says whether the checksum is put right, then the calibration.
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "leap_object_tracker/leap/distortion_fit.hpp"
#include "leap_object_tracker/leap/leap_calibration.hpp"
#include "support/emulated_leap_calibration.hpp"

using namespace leap_object_tracker;

namespace {

void requireUsable(const StereoCalibration& calibration) {
  for (const CameraCalibration* eye : {&calibration.left, &calibration.right}) {
    const double u = eye->size.width - 1, v = eye->size.height - 1;
    for (const Eigen::Vector2d& pixel :
         {Eigen::Vector2d(eye->cx, eye->cy), Eigen::Vector2d(0, 0), Eigen::Vector2d(u, v)})
      if (eye->distortion_model == DistortionModel::kLeapInverse &&
          !rayFromPixel(*eye, pixel).allFinite())
        std::abort();
    if (std::abs(eye->rectified_from_raw.determinant() - 1) > 1e-6) std::abort();
  }
  if (!(calibration.baseline > 0)) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  Bytes bytes(data + 1, data + size);
  if ((data[0] & 1) && bytes.size() == kCalibrationBytes) bytes = withChecksum(bytes);
  try {
    const LeapCalibrationRecord record = parseCalibration(bytes);
    calibrationWarnings(record);
    for (const LeapModeInfo& mode : leapModes())
      for (const auto convention :
           {CalibrationConvention::kRecommended, CalibrationConvention::kNone})
        requireUsable(stereoCalibration(record, mode.mode, convention));
  } catch (const std::invalid_argument&) {
  }
  return 0;
}
