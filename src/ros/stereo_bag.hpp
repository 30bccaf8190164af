#pragma once

#include <rosbag/bag.h>
#include <sensor_msgs/CameraInfo.h>
#include <tf2/buffer_core.h>

#include <functional>
#include <optional>
#include <string>

#include "leap_object_tracker/evaluation/trajectory.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// Where a bag keeps what the tracker needs.
struct StereoBagTopics {
  std::string left_image = "/leap/left/image_raw";
  std::string right_image = "/leap/right/image_raw";
  std::string left_info = "/leap/left/camera_info";
  std::string right_info = "/leap/right/camera_info";
  std::string calibration = "/leap/calibration";  ///< exact map, if there
  std::string truth = "/ground_truth/pose";
};

/// A recorded stereo camera. Every member throws std::runtime_error naming the bag and what is
/// wrong with it.
class StereoBag {
 public:
  /// @param eyes an eye that is not wanted may be missing
  StereoBag(const std::string& path, const StereoBagTopics& topics, Eyes eyes);

  const StereoCalibration& calibration() const { return calibration_; }
  /// Frame of the left images' headers.
  const std::string& cameraFrame() const { return camera_frame_; }
  /// Pairs that the bag can hold at most.
  std::size_t mostPairs() const { return most_pairs_; }

  /// All true poses, by a walk through the whole bag; empty if it has none.
  Trajectory truth() const;
  /// The first true pose, if the bag has any.
  std::optional<StampedPose> firstTruth() const;

  /// All transforms of the bag.
  std::unique_ptr<tf2::BufferCore> transforms() const;

  /// What a walk through the whole bag brings beside the pairs.
  struct Rest {
    Trajectory truth;                   ///< empty if the bag has none
    std::size_t images_left_alone = 0;  ///< whose other eye was missing
  };
  /// Calls `use` once for every pair of equal stamps, in the order of the bag.
  Rest forEachPair(const std::function<void(const RawStereoFrame&)>& use) const;

 private:
  [[noreturn]] void complain(const std::string& what) const;
  std::size_t count(const std::string& topic) const;
  std::optional<sensor_msgs::CameraInfo> firstInfo(const std::string& topic) const;
  void readCalibration();
  StampedPose truthFrom(const rosbag::MessageInstance& entry) const;

  std::string path_;
  StereoBagTopics topics_;
  Eyes eyes_;
  rosbag::Bag bag_;
  StereoCalibration calibration_;
  sensor_msgs::CameraInfo left_info_;
  sensor_msgs::CameraInfo right_info_;
  std::string camera_frame_;
  std::size_t most_pairs_ = 0;
};

}  // namespace leap_object_tracker
