#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <deque>
#include <optional>

#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// What belongs to one exposure. The messages of an eye that is not wanted are null.
struct StereoMessages {
  sensor_msgs::ImageConstPtr left, right;
  sensor_msgs::CameraInfoConstPtr left_info, right_info;

  const std_msgs::Header& header() const { return (left ? left : right)->header; }
};

/// Puts messages of equal stamps together, in the order in which they arrive: time may jump.
class StereoMatcher {
 public:
  explicit StereoMatcher(Eyes eyes) : eyes_(eyes) {}

  /// @param part one message, the others null
  /// @return all that belongs to its exposure, if it was the last one missing
  std::optional<StereoMessages> add(const ros::Time& stamp, const StereoMessages& part);

 private:
  static constexpr std::size_t kMostWaiting = 16;
  struct Waiting {
    ros::Time stamp;
    StereoMessages messages;
  };

  bool complete(const StereoMessages& messages) const;

  Eyes eyes_;
  std::deque<Waiting> waiting_;
};

}  // namespace leap_object_tracker
