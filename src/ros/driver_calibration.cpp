#include "driver_calibration.hpp"

#include <ros/console.h>

#include <sstream>
#include <stdexcept>

#include "conversions.hpp"
#include "leap_object_tracker/leap/distortion_fit.hpp"

namespace leap_object_tracker {
namespace {

ros::NodeHandle eyeHandle(ros::NodeHandle& nh, const char* eye) { return {nh, eye}; }

}  // namespace

DriverCalibration::DriverCalibration(ros::NodeHandle& nh, const DriverNodeParams& params)
    : params_(params),
      left_manager_(eyeHandle(nh, "left"), "leap_left", params.left_calibration_url),
      right_manager_(eyeHandle(nh, "right"), "leap_right", params.right_calibration_url) {}

std::string DriverCalibration::setDevice(const LeapIdentity& identity) {
  const LeapModeInfo& mode = leapModeInfo(params_.camera.stream.mode);
  const std::string name =
      "leap_" + (identity.serial.empty() ? "unknown" : identity.serial) + "_" + mode.name;
  left_manager_.setCameraName(name + "_left");
  right_manager_.setCameraName(name + "_right");
  from_memory_ = {};
  for (sensor_msgs::CameraInfo* info : {&from_memory_.left, &from_memory_.right}) {
    info->width = static_cast<std::uint32_t>(mode.size.width);
    info->height = static_cast<std::uint32_t>(mode.size.height);
  }
  record_.reset();
  device_is_new_ = true;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stereo_.reset();
  }
  std::string report;
  takeFromMemory(identity, report);
  Infos own;
  if (usersOwn(own)) report = "calibration: a file of your own, for camera " + name;
  return report;
}

void DriverCalibration::takeFromMemory(const LeapIdentity& identity, std::string& report) {
  try {
    if (identity.calibration.empty())
      throw std::invalid_argument(
          "calibration in the device's memory: its checksum does not match, three times; another "
          "program may use the device, or the firmware is another one");
    record_ = parseCalibration(identity.calibration);
  } catch (const std::invalid_argument& error) {
    report = std::string(error.what()) +
             ". Pictures come without calibration; calibrate it with camera_calibration";
    return;
  }
  const StereoCalibration exact =
      stereoCalibration(*record_, params_.camera.stream.mode, params_.convention);
  const DistortionFit left = fitRationalPolynomial(exact.left, FitFreedom::kAll);
  const DistortionFit right = fitRationalPolynomial(exact.right, FitFreedom::kAll);
  from_memory_.left = rawCameraInfo(left.camera, exact, false);
  from_memory_.right = rawCameraInfo(right.camera, exact, true);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stereo_ = std::make_shared<StereoCalibration>(exact);
  }
  std::ostringstream text;
  text.precision(2);
  text << "calibration: from the device's memory, convention " << name(params_.convention)
       << "; camera_info comes near it by " << left.rms << " and " << right.rms
       << " px rms (left, right), at most " << left.largest << " and " << right.largest
       << " px in the corners; topic calibration has it exactly";
  for (const std::string& warning : calibrationWarnings(*record_)) text << "; " << warning;
  report = text.str();
}

bool DriverCalibration::usersOwn(Infos& infos) {
  if (!left_manager_.isCalibrated() || !right_manager_.isCalibrated()) return false;
  infos = {left_manager_.getCameraInfo(), right_manager_.getCameraInfo()};
  const cv::Size size = leapModeInfo(params_.camera.stream.mode).size;
  const auto fits = [&](const sensor_msgs::CameraInfo& info) {
    return static_cast<int>(info.width) == size.width &&
           static_cast<int>(info.height) == size.height;
  };
  if (fits(infos.left) && fits(infos.right)) return true;
  if (!size_warned_)
    ROS_WARN_STREAM("your calibration files are for "
                    << infos.left.width << "x" << infos.left.height << ", the pictures are "
                    << size.width << "x" << size.height << ": the device's calibration is used");
  size_warned_ = true;
  return false;
}

DriverCalibration::Infos DriverCalibration::infos() {
  Infos own;
  return usersOwn(own) ? own : from_memory_;
}

std::optional<LeapCalibration> DriverCalibration::changedCalibration() {
  Infos own;
  const bool is_own = usersOwn(own);
  const bool valid = !is_own && record_.has_value();
  if (!device_is_new_ && announced_valid_ == valid) return std::nullopt;
  device_is_new_ = false;
  announced_valid_ = valid;
  LeapCalibration message;
  try {
    const StereoCalibration stereo = is_own ? calibrationFrom(&own.left, &own.right)
                                            : (valid ? *this->stereo() : StereoCalibration());
    if (valid) message = messageFrom(stereo);
    const std::lock_guard<std::mutex> lock(mutex_);
    stereo_ = is_own ? std::make_shared<StereoCalibration>(stereo) : stereo_;
  } catch (const std::invalid_argument& error) {
    ROS_ERROR_STREAM("your calibration files: " << error.what());
  }
  return message;
}

std::shared_ptr<const StereoCalibration> DriverCalibration::stereo() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return stereo_;
}

std::optional<StereoCalibration> DriverCalibration::byConvention(
    CalibrationConvention convention) const {
  if (!record_) return std::nullopt;
  return stereoCalibration(*record_, params_.camera.stream.mode, convention);
}

}  // namespace leap_object_tracker
