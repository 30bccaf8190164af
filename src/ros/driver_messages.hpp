#pragma once

#include <leap_object_tracker/LeapCalibration.h>
#include <leap_object_tracker/LeapFrameInfo.h>
#include <sensor_msgs/CameraInfo.h>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/leap/leap_device.hpp"

namespace leap_object_tracker {

/// The camera_info of a raw eye. No header.
/// @param camera of model kRationalPolynomial
/// @param stereo the pair that it belongs to: gives P a common camera and the right eye its
/// baseline
sensor_msgs::CameraInfo rawCameraInfo(const CameraCalibration& camera,
                                      const StereoCalibration& stereo, bool right_eye);

/// The exact map. No header. `stereo` must be of model kLeapInverse, or the message says that it is
/// not valid.
LeapCalibration messageFrom(const StereoCalibration& stereo);

/// @throw std::invalid_argument if the message is not valid or incomplete
StereoCalibration calibrationFrom(const LeapCalibration& message);

/// No header.
LeapFrameInfo messageFrom(const LeapFrame& frame, bool lit, bool ambient_subtracted);

}  // namespace leap_object_tracker
