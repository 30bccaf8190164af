#pragma once

#include <ros/ros.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <string>

#include "ros/stereo_matcher.hpp"

namespace leap_object_tracker {

/// Publishes stereo pairs in the place of a camera.
class StereoCameraPlayer {
 public:
  explicit StereoCameraPlayer(ros::NodeHandle& nh, const std::string& image_name = "image_raw",
                              const std::string& prefix = "/leap/")
      : left_(nh.advertise<sensor_msgs::Image>(prefix + "left/" + image_name, 5)),
        right_(nh.advertise<sensor_msgs::Image>(prefix + "right/" + image_name, 5)),
        left_info_(nh.advertise<sensor_msgs::CameraInfo>(prefix + "left/camera_info", 5)),
        right_info_(nh.advertise<sensor_msgs::CameraInfo>(prefix + "right/camera_info", 5)) {}

  /// Whether somebody listens to all four topics.
  bool heard() const {
    return left_.getNumSubscribers() > 0 && right_.getNumSubscribers() > 0 &&
           left_info_.getNumSubscribers() > 0 && right_info_.getNumSubscribers() > 0;
  }
  bool unheard() const { return left_.getNumSubscribers() == 0 && right_.getNumSubscribers() == 0; }

  void publish(const StereoMessages& pair) {
    if (pair.left_info) left_info_.publish(pair.left_info);
    if (pair.right_info) right_info_.publish(pair.right_info);
    if (pair.left) left_.publish(pair.left);
    if (pair.right) right_.publish(pair.right);
  }

 private:
  ros::Publisher left_, right_, left_info_, right_info_;
};

}  // namespace leap_object_tracker
