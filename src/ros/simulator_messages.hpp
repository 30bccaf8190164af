#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Vector3Stamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/image_encodings.h>
#include <tf2_eigen/tf2_eigen.h>

#include <algorithm>
#include <string>
#include <vector>

#include "leap_object_tracker/simulation/simulator.hpp"

namespace leap_object_tracker {

constexpr char kLeftFrame[] = "leap_left_optical_frame";
constexpr char kRightFrame[] = "leap_right_optical_frame";
constexpr char kFixedFrame[] = "base_link";

inline ros::Time rosTime(Stamp stamp) {
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(stamp.time_since_epoch().count()));
  return time;
}

inline std_msgs::Header headerOf(const ros::Time& stamp, const std::string& frame) {
  std_msgs::Header header;
  header.stamp = stamp;
  header.frame_id = frame;
  return header;
}

inline sensor_msgs::Image imageMessage(const cv::Mat& image, const std_msgs::Header& header) {
  sensor_msgs::Image message;
  message.header = header;
  message.width = static_cast<std::uint32_t>(image.cols);
  message.height = static_cast<std::uint32_t>(image.rows);
  message.step = message.width;
  message.encoding = sensor_msgs::image_encodings::MONO8;
  message.data.assign(image.data, image.data + image.total());
  return message;
}

/// Square pixels, the focal length and the size of the raw left eye, the same centre for both.
inline sensor_msgs::CameraInfo cameraInfoMessage(const StereoCalibration& calibration, bool right) {
  const CameraCalibration& eye = right ? calibration.right : calibration.left;
  sensor_msgs::CameraInfo info;
  info.header.frame_id = right ? kRightFrame : kLeftFrame;
  info.width = static_cast<std::uint32_t>(eye.size.width);
  info.height = static_cast<std::uint32_t>(eye.size.height);
  info.distortion_model = "rational_polynomial";
  info.D = eye.distortion;
  info.K = {eye.fx, 0, eye.cx, 0, eye.fy, eye.cy, 0, 0, 1};
  const Eigen::Matrix<double, 3, 3, Eigen::RowMajor> rotation = eye.rectified_from_raw;
  std::copy(rotation.data(), rotation.data() + 9, info.R.begin());
  const double focal_length = calibration.left.fx;
  const double baseline_term = right ? -focal_length * calibration.baseline : 0.0;
  info.P = {focal_length,
            0,
            (eye.size.width - 1) / 2.0,
            baseline_term,
            0,
            focal_length,
            (eye.size.height - 1) / 2.0,
            0,
            0,
            0,
            1,
            0};
  return info;
}

inline geometry_msgs::PoseStamped truthMessage(const Pose& camera_from_body,
                                               const ros::Time& stamp) {
  geometry_msgs::PoseStamped message;
  message.header = headerOf(stamp, kLeftFrame);
  message.pose = tf2::toMsg(camera_from_body);
  return message;
}

/// Share of the object's visible side that each eye sees: x left, y right.
inline geometry_msgs::Vector3Stamped visibilityMessage(const SimulatedFrame& frame,
                                                       const ros::Time& stamp) {
  geometry_msgs::Vector3Stamped message;
  message.header = headerOf(stamp, kLeftFrame);
  message.vector.x = frame.left_visible;
  message.vector.y = frame.right_visible;
  return message;
}

inline geometry_msgs::TransformStamped transformMessage(const Pose& parent_from_child,
                                                        const ros::Time& stamp,
                                                        const std::string& parent,
                                                        const std::string& child) {
  geometry_msgs::TransformStamped message = tf2::eigenToTransform(parent_from_child);
  message.header = headerOf(stamp, parent);
  message.child_frame_id = child;
  return message;
}

}  // namespace leap_object_tracker
