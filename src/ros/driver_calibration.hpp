#pragma once

#include <camera_info_manager/camera_info_manager.h>
#include <ros/node_handle.h>

#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "driver_messages.hpp"
#include "driver_parameters.hpp"

namespace leap_object_tracker {

/// Which calibration holds for the pair: files of the user before the memory of the device.
class DriverCalibration {
 public:
  DriverCalibration(ros::NodeHandle& nh, const DriverNodeParams& params);

  /// To be called for each device that is connected. @return what to tell the user
  std::string setDevice(const LeapIdentity& identity);

  struct Infos {
    sensor_msgs::CameraInfo left, right;  ///< no header
  };
  /// As it holds now: the user may set another one at any time.
  Infos infos();

  /// The exact map, if that is what infos() comes from; to be announced when it has changed.
  std::optional<LeapCalibration> changedCalibration();

  /// Raw pixels to rays by what holds now; null without any calibration.
  std::shared_ptr<const StereoCalibration> stereo() const;
  /// What the memory says by another convention.
  std::optional<StereoCalibration> byConvention(CalibrationConvention convention) const;

 private:
  void takeFromMemory(const LeapIdentity& identity, std::string& report);
  bool usersOwn(Infos& infos);

  DriverNodeParams params_;
  camera_info_manager::CameraInfoManager left_manager_;
  camera_info_manager::CameraInfoManager right_manager_;
  Infos from_memory_;
  std::optional<LeapCalibrationRecord> record_;
  std::optional<bool> announced_valid_;
  bool device_is_new_ = false;
  bool size_warned_ = false;

  mutable std::mutex mutex_;  ///< guards what other threads read:
  std::shared_ptr<const StereoCalibration> stereo_;
};

}  // namespace leap_object_tracker
