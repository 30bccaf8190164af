#include "driver_messages.hpp"

#include <sensor_msgs/distortion_models.h>

#include <algorithm>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

constexpr std::size_t kInverseCoefficients = 8;

LeapEyeCalibration eyeMessage(const CameraCalibration& eye) {
  LeapEyeCalibration message;
  message.fx = eye.fx;
  message.fy = eye.fy;
  message.cx = eye.cx;
  message.cy = eye.cy;
  std::copy_n(eye.distortion.begin(), kInverseCoefficients, message.pixel_to_ray.begin());
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(message.R.data()) =
      eye.rectified_from_raw;
  return message;
}

CameraCalibration eyeFrom(const LeapEyeCalibration& message, cv::Size size) {
  CameraCalibration eye;
  eye.size = size;
  eye.fx = message.fx;
  eye.fy = message.fy;
  eye.cx = message.cx;
  eye.cy = message.cy;
  eye.distortion_model = DistortionModel::kLeapInverse;
  eye.distortion.assign(message.pixel_to_ray.begin(), message.pixel_to_ray.end());
  eye.rectified_from_raw =
      Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(message.R.data());
  return eye;
}

}  // namespace

sensor_msgs::CameraInfo rawCameraInfo(const CameraCalibration& camera,
                                      const StereoCalibration& stereo, bool right_eye) {
  sensor_msgs::CameraInfo info;
  info.width = static_cast<std::uint32_t>(camera.size.width);
  info.height = static_cast<std::uint32_t>(camera.size.height);
  info.distortion_model = sensor_msgs::distortion_models::RATIONAL_POLYNOMIAL;
  info.D = camera.distortion;
  info.K = {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
  Eigen::Map<Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(info.R.data()) =
      camera.rectified_from_raw;
  const double f = stereo.left.fx;
  const double u = (camera.size.width - 1) / 2.0, v = (camera.size.height - 1) / 2.0;
  info.P = {f, 0, u, right_eye ? -f * stereo.baseline : 0.0, 0, f, v, 0, 0, 0, 1, 0};
  return info;
}

LeapCalibration messageFrom(const StereoCalibration& stereo) {
  LeapCalibration message;
  const auto is_exact = [](const CameraCalibration& eye) {
    return eye.distortion_model == DistortionModel::kLeapInverse &&
           eye.distortion.size() == kInverseCoefficients;
  };
  message.valid = is_exact(stereo.left) && is_exact(stereo.right);
  if (!message.valid) return message;
  message.width = static_cast<std::uint32_t>(stereo.left.size.width);
  message.height = static_cast<std::uint32_t>(stereo.left.size.height);
  message.baseline = stereo.baseline;
  message.left = eyeMessage(stereo.left);
  message.right = eyeMessage(stereo.right);
  return message;
}

StereoCalibration calibrationFrom(const LeapCalibration& message) {
  if (!message.valid || message.width == 0 || message.height == 0 || !(message.baseline > 0) ||
      !(message.left.fx > 0) || !(message.left.fy > 0) || !(message.right.fx > 0) ||
      !(message.right.fy > 0))
    throw std::invalid_argument("calibration message: it is not valid or lacks sizes");
  const cv::Size size(static_cast<int>(message.width), static_cast<int>(message.height));
  StereoCalibration calibration;
  calibration.left = eyeFrom(message.left, size);
  calibration.right = eyeFrom(message.right, size);
  calibration.baseline = message.baseline;
  return calibration;
}

LeapFrameInfo messageFrom(const LeapFrame& frame, bool lit, bool ambient_subtracted) {
  LeapFrameInfo message;
  message.lit = lit;
  message.exposure = static_cast<std::uint32_t>(frame.taken_with.exposure_us);
  message.analog_gain = static_cast<std::uint32_t>(frame.taken_with.analog_gain);
  message.digital_gain = static_cast<std::uint32_t>(frame.taken_with.digital_gain);
  message.ambient_subtracted = ambient_subtracted;
  message.label1 = static_cast<std::uint8_t>(frame.metadata.label1);
  message.label2 = static_cast<std::uint8_t>(frame.metadata.label2);
  message.device_time = frame.device_ms;
  message.transport = frame.transport;
  return message;
}

}  // namespace leap_object_tracker
