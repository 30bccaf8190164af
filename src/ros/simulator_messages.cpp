#include "simulator_messages.hpp"

#include <sensor_msgs/image_encodings.h>
#include <tf2_eigen/tf2_eigen.h>

#include <algorithm>

#include "conversions.hpp"

namespace leap_object_tracker {
namespace {

std_msgs::Header headerOf(const ros::Time& stamp, const char* frame) {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = frame;
  return header;
}

}  // namespace

sensor_msgs::Image simulatedImage(const cv::Mat& image, const ros::Time& stamp, bool right_eye) {
  sensor_msgs::Image message;
  message.header = headerOf(stamp, right_eye ? kRightFrame : kLeftFrame);
  message.width = message.step = static_cast<std::uint32_t>(image.cols);
  message.height = static_cast<std::uint32_t>(image.rows);
  message.encoding = sensor_msgs::image_encodings::MONO8;
  message.data.assign(image.data, image.data + image.total());
  return message;
}

sensor_msgs::CameraInfo simulatedCameraInfo(const StereoCalibration& calibration, bool right_eye) {
  const CameraCalibration& eye = right_eye ? calibration.right : calibration.left;
  sensor_msgs::CameraInfo info;
  info.header.frame_id = right_eye ? kRightFrame : kLeftFrame;
  info.width = static_cast<std::uint32_t>(eye.size.width);
  info.height = static_cast<std::uint32_t>(eye.size.height);
  info.distortion_model = "rational_polynomial";
  info.D = eye.distortion;
  info.K = {eye.fx, 0, eye.cx, 0, eye.fy, eye.cy, 0, 0, 1};
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation = eye.rectified_from_raw;
  std::copy(rotation.data(), rotation.data() + rotation.size(), info.R.begin());
  const double focal_length = calibration.left.fx;
  info.P = {focal_length,
            0,
            (eye.size.width - 1) / 2.0,
            0,
            0,
            focal_length,
            (eye.size.height - 1) / 2.0,
            0,
            0,
            0,
            1,
            0};
  if (right_eye) info.P[3] = -focal_length * calibration.baseline;
  return info;
}

geometry_msgs::PoseStamped truthMessage(const Pose& camera_from_body, const ros::Time& stamp) {
  geometry_msgs::PoseStamped message;
  message.header = headerOf(stamp, kLeftFrame);
  message.pose = messageFrom(camera_from_body);
  return message;
}

geometry_msgs::Vector3Stamped visibilityMessage(const SimulatedFrame& frame,
                                                const ros::Time& stamp) {
  geometry_msgs::Vector3Stamped message;
  message.header = headerOf(stamp, kLeftFrame);
  message.vector.x = frame.left_visible;
  message.vector.y = frame.right_visible;
  return message;
}

geometry_msgs::TransformStamped cameraTransform(const SimulatedFrame& frame,
                                                const ros::Time& stamp) {
  geometry_msgs::TransformStamped message = tf2::eigenToTransform(frame.fixed_from_camera);
  message.header = headerOf(stamp, kFixedFrame);
  message.child_frame_id = kLeftFrame;
  return message;
}

}  // namespace leap_object_tracker
