#pragma once

#include <image_transport/image_transport.h>
#include <ros/callback_queue_interface.h>
#include <ros/node_handle.h>

#include <array>
#include <functional>
#include <memory>
#include <string>

#include "pair_queue.hpp"
#include "stereo_matcher.hpp"

namespace leap_object_tracker {

/// Subscribes to a stereo camera and hands on the pairs of equal stamps, as PairQueue does: late
/// ones are dropped and counted. Says so when pairs fail to come.
///
/// All happens in the callback queue of the node handle, which must be one that a single thread
/// serves at a time.
class StereoSubscriber {
 public:
  using Callback = std::function<void(const StereoMessages&)>;

  /// @param prefix what stands before left/... and right/..., empty or ending with a slash
  /// @param image_name name of the images below left/ and right/
  /// @param name for messages to the user
  StereoSubscriber(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                   const std::string& prefix, const std::string& image_name, Eyes eyes,
                   const std::string& name, Callback callback);
  ~StereoSubscriber();
  StereoSubscriber(const StereoSubscriber&) = delete;
  StereoSubscriber& operator=(const StereoSubscriber&) = delete;

  void subscribe();
  void unsubscribe();
  bool subscribed() const { return subscribed_; }

  /// Pairs that gave way to newer ones.
  std::uint32_t dropped() const { return queue_.dropped(); }

 private:
  class HandOn;
  enum Topic { kLeftImage, kRightImage, kLeftInfo, kRightInfo, kTopics };

  bool wanted(Topic topic) const;
  void take(Topic topic, const ros::Time& stamp, const StereoMessages& part);
  void askToHandOn();
  void handOn();
  void watch();

  ros::NodeHandle nh_;
  ros::NodeHandle private_nh_;
  Eyes eyes_;
  std::string name_;
  Callback callback_;
  std::array<std::string, kTopics> topics_;
  image_transport::ImageTransport transport_;
  std::array<image_transport::Subscriber, 2> images_;
  std::array<ros::Subscriber, 2> infos_;
  bool subscribed_ = false;

  StereoMatcher matcher_;
  PairQueue queue_;
  bool waits_to_hand_on_ = false;
  ros::WallTime finished_;  ///< when the last pair was done with

  ros::WallTimer watch_timer_;
  std::array<int, kTopics> received_{};
  std::array<ros::Time, kTopics> last_stamp_{};
  int pairs_ = 0;
};

}  // namespace leap_object_tracker
