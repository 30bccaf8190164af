// Prints what a Leap on the USB bus says of itself.
#include <cstdio>
#include <cstring>
#include <ctime>
#include <stdexcept>
#include <string>

#include "leap_object_tracker/leap/distortion_fit.hpp"
#include "leap_object_tracker/leap/leap_calibration.hpp"
#include "leap_object_tracker/leap/leap_device.hpp"

using namespace leap_object_tracker;

namespace {

constexpr char kUsage[] =
    "usage: leap_info [--serial SERIAL] [--frames]\n"
    "Prints serial number, firmware, calibration and modes of a Leap Motion. --frames also takes\n"
    "pictures for two seconds.\n";

void printEye(const char* side, const LeapEyeRecord& eye, const CameraCalibration& camera) {
  const DistortionFit fit = fitRationalPolynomial(camera, FitFreedom::kAll);
  std::printf("  %-5s  f %.3f px, centre (%.2f, %.2f) px of 640x480, p1 %.6f, p2 %.6f\n", side,
              eye.focal_length, 320 + eye.offset_u, 240 + eye.offset_v, eye.p1, eye.p2);
  std::printf("         k1..k6 %g %g %g %g %g %g, rotation %.6f %.6f %.6f\n", eye.radial[0],
              eye.radial[1], eye.radial[2], eye.radial[3], eye.radial[4], eye.radial[5],
              eye.rotation.x(), eye.rotation.y(), eye.rotation.z());
  std::printf("         rational_polynomial comes near it by %.2f px rms, %.2f px at most\n",
              fit.rms, fit.largest);
}

void printCalibration(const LeapIdentity& identity) {
  if (identity.calibration.empty()) {
    std::printf("calibration: unreadable, its checksum does not match\n");
    return;
  }
  const LeapCalibrationRecord record = parseCalibration(identity.calibration);
  const std::time_t time = record.unix_time;
  char date[32];
  std::strftime(date, sizeof date, "%Y-%m-%d", std::gmtime(&time));
  std::printf("calibration: version %d, of %s, score %d, baseline %.3f mm\n", record.version, date,
              record.score, record.baseline_mm);
  const StereoCalibration stereo =
      stereoCalibration(record, LeapMode::k640x480, CalibrationConvention::kRecommended);
  printEye("left", record.left, stereo.left);
  printEye("right", record.right, stereo.right);
  for (const std::string& warning : calibrationWarnings(record))
    std::printf("  warning: %s\n", warning.c_str());
}

void printModes(const LeapLayout& layout) {
  std::printf("modes:\n");
  for (const LeapModeInfo& mode : leapModes()) {
    const LeapLayout::Frame frame = layout.frame(mode.mode);
    std::printf("  %s  %.1f Hz\n", mode.name, 1e7 / frame.interval_100ns);
  }
}

/// @return whether pictures came
bool takePictures(LeapDevice& device) {
  device.start(LeapStreamParams(), LeapControls());
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(2);
  while (std::chrono::steady_clock::now() < end || device.counters().transfers.payloads == 0)
    device.grab(std::chrono::milliseconds(100));
  const LeapCounters counters = device.counters();
  std::printf("pictures: %llu whole, %llu torn, %llu missing in 2 s at 640x240\n",
              static_cast<unsigned long long>(counters.frames.good),
              static_cast<unsigned long long>(counters.frames.torn),
              static_cast<unsigned long long>(counters.missing));
  return counters.frames.good > 0;
}

}  // namespace

int main(int argument_count, char** arguments) {
  std::string serial;
  bool frames = false;
  for (int i = 1; i < argument_count; ++i) {
    if (std::strcmp(arguments[i], "--serial") == 0 && i + 1 < argument_count) {
      serial = arguments[++i];
    } else if (std::strcmp(arguments[i], "--frames") == 0) {
      frames = true;
    } else {
      const bool asked = std::strcmp(arguments[i], "--help") == 0;
      std::fputs(kUsage, asked ? stdout : stderr);
      return asked ? 0 : 2;
    }
  }
  try {
    UsbContext context;
    LeapDevice device(context, serial);
    const LeapIdentity& identity = device.identity();
    std::printf("Leap Motion at %s\nserial number: %s\nfirmware bytes:", identity.location.c_str(),
                identity.serial.empty() ? "unreadable" : identity.serial.c_str());
    for (const std::uint8_t byte : identity.firmware) std::printf(" %02x", byte);
    std::printf("\n");
    printCalibration(identity);
    printModes(identity.layout);
    return !frames || takePictures(device) ? 0 : 1;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "leap_info: %s\n", error.what());
    return 1;
  }
}
