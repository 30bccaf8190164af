#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <cstdint>
#include <string>

namespace leap_object_tracker {

/// A distortion-free eye of 64 x 48 px, focal length 100 px, baseline 0.1 m.
inline sensor_msgs::CameraInfo smallCamera(bool right_eye, const ros::Time& stamp = {}) {
  sensor_msgs::CameraInfo info;
  info.header.stamp = stamp;
  info.header.frame_id = right_eye ? "leap_right_optical_frame" : "leap_left_optical_frame";
  info.width = 64;
  info.height = 48;
  info.distortion_model = "plumb_bob";
  info.D.assign(5, 0.0);
  info.K = {100, 0, 31.5, 0, 100, 23.5, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {100, 0, 31.5, right_eye ? -10.0 : 0.0, 0, 100, 23.5, 0, 0, 0, 1, 0};
  return info;
}

inline sensor_msgs::Image grayImage(std::uint32_t width, std::uint32_t height, std::uint8_t gray,
                                    const ros::Time& stamp = {}) {
  sensor_msgs::Image image;
  image.header.stamp = stamp;
  image.header.frame_id = "leap_left_optical_frame";
  image.encoding = "mono8";
  image.width = image.step = width;
  image.height = height;
  image.data.assign(static_cast<std::size_t>(width) * height, gray);
  return image;
}

}  // namespace leap_object_tracker
