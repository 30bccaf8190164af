#pragma once

#include <geometry_msgs/Pose.h>
#include <geometry_msgs/TransformStamped.h>
#include <leap_object_tracker/LeapCalibration.h>
#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"

namespace leap_object_tracker {

Stamp stampFrom(const ros::Time& time);
ros::Time timeFrom(Stamp stamp);

geometry_msgs::Pose messageFrom(const Pose& pose);
/// @throw std::invalid_argument for numbers that are not finite and for a quaternion of length
/// zero.
Pose poseFrom(const geometry_msgs::Pose& message);
Pose poseFrom(const geometry_msgs::TransformStamped& message);
/// "x y z qx qy qz qw" [m]. @throw std::invalid_argument
Pose poseFrom(const std::string& text);

/// An eye may be null: one eye alone has no use for the other. Its place is then filled with a
/// twin of the eye that is there, at the baseline of a Leap if no other is known.
/// @throw std::invalid_argument for an uncalibrated pair, an unknown distortion model, a baseline
/// that is not above zero; the message says which eye and which field.
StereoCalibration calibrationFrom(const sensor_msgs::CameraInfo* left,
                                  const sensor_msgs::CameraInfo* right);

/// Whether the exact map is the one to use for images of this camera.
bool holdsFor(const LeapCalibration& message, const sensor_msgs::CameraInfo& info);

/// The exact map of a Leap's lenses. @throw std::invalid_argument as above.
StereoCalibration calibrationFrom(const LeapCalibration& message);

/// The ideal pair that two camera_infos of rectified images describe; null as above.
/// @throw std::invalid_argument as above, and where the pair is not rectified to one common camera.
RectifiedStereoCamera rectifiedCameraFrom(const sensor_msgs::CameraInfo* left,
                                          const sensor_msgs::CameraInfo* right);

/// What belongs to a rectified image: K and P of the camera, D zero, R identity. No header.
sensor_msgs::CameraInfo messageFrom(const RectifiedStereoCamera& camera, bool right_eye);

/// Whether both describe the same camera, whatever their headers.
bool sameCamera(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b);

bool sameCamera(const RectifiedStereoCamera& a, const RectifiedStereoCamera& b);

/// Looks at the pixels of the message, which must outlive the result.
/// @throw std::invalid_argument if they are not mono8 or fewer than announced.
cv::Mat imageFrom(const sensor_msgs::Image& message);

}  // namespace leap_object_tracker
