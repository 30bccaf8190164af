#pragma once

#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/Vector3Stamped.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <string>

#include "leap_object_tracker/simulation/simulator.hpp"

namespace leap_object_tracker {

constexpr char kLeftFrame[] = "leap_left_optical_frame";
constexpr char kRightFrame[] = "leap_right_optical_frame";
constexpr char kFixedFrame[] = "base_link";

sensor_msgs::Image simulatedImage(const cv::Mat& image, const ros::Time& stamp, bool right_eye);

/// Both eyes with square pixels, the focal length and the size of the raw left eye, one centre.
sensor_msgs::CameraInfo simulatedCameraInfo(const StereoCalibration& calibration, bool right_eye);

geometry_msgs::PoseStamped truthMessage(const Pose& camera_from_body, const ros::Time& stamp);

/// Share of the object's visible side that each eye sees: x left, y right.
geometry_msgs::Vector3Stamped visibilityMessage(const SimulatedFrame& frame,
                                                const ros::Time& stamp);

/// Where a moving camera is in its fixed frame.
geometry_msgs::TransformStamped cameraTransform(const SimulatedFrame& frame,
                                                const ros::Time& stamp);

}  // namespace leap_object_tracker
