#include "stereo_subscriber.hpp"

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kWatchPeriod = 5.0;  // [s]
constexpr double kRest = 0.0005;      // [s] in which messages that wait would have come
/// Messages that one topic keeps while a pair is at work: enough for the others to catch up.
constexpr std::uint32_t kQueue = 16;

}  // namespace

/// Runs behind all messages that are in the callback queue already, so that all pairs are known.
class StereoSubscriber::HandOn : public ros::CallbackInterface {
 public:
  explicit HandOn(StereoSubscriber& owner) : owner_(owner) {}
  CallResult call() override {
    owner_.handOn();
    return Success;
  }

 private:
  StereoSubscriber& owner_;
};

StereoSubscriber::StereoSubscriber(const ros::NodeHandle& nh, const ros::NodeHandle& private_nh,
                                   const std::string& prefix, const std::string& image_name,
                                   Eyes eyes, const std::string& name, Callback callback)
    : nh_(nh),
      private_nh_(private_nh),
      eyes_(eyes),
      name_(name),
      callback_(std::move(callback)),
      topics_{prefix + "left/" + image_name, prefix + "right/" + image_name,
              prefix + "left/camera_info", prefix + "right/camera_info"},
      transport_(nh),
      matcher_(eyes) {
  watch_timer_ = nh_.createWallTimer(
      ros::WallDuration(kWatchPeriod), [this](const ros::WallTimerEvent&) { watch(); }, false,
      false);
}

StereoSubscriber::~StereoSubscriber() {
  unsubscribe();
  nh_.getCallbackQueue()->removeByID(reinterpret_cast<std::uint64_t>(this));
}

void StereoSubscriber::subscribe() {
  if (subscribed_) return;
  subscribed_ = true;
  const image_transport::TransportHints hints("raw", ros::TransportHints().tcpNoDelay(),
                                              private_nh_);
  const auto onImage = [this](Topic topic) {
    return [this, topic](const sensor_msgs::ImageConstPtr& image) {
      StereoMessages part;
      (topic == kLeftImage ? part.left : part.right) = image;
      take(topic, image->header.stamp, part);
    };
  };
  const auto onInfo = [this](Topic topic) {
    return [this, topic](const sensor_msgs::CameraInfoConstPtr& info) {
      StereoMessages part;
      (topic == kLeftInfo ? part.left_info : part.right_info) = info;
      take(topic, info->header.stamp, part);
    };
  };
  for (const Topic topic : {kLeftInfo, kRightInfo})
    if (wanted(topic))
      infos_[topic - kLeftInfo] = nh_.subscribe<sensor_msgs::CameraInfo>(
          topics_[topic], kQueue, onInfo(topic), ros::VoidConstPtr(),
          ros::TransportHints().tcpNoDelay());
  for (const Topic topic : {kLeftImage, kRightImage})
    if (wanted(topic))
      images_[topic] =
          transport_.subscribe(topics_[topic], kQueue, onImage(topic), ros::VoidPtr(), hints);
  received_.fill(0);
  pairs_ = 0;
  watch_timer_.start();
}

void StereoSubscriber::unsubscribe() {
  if (!subscribed_) return;
  subscribed_ = false;
  watch_timer_.stop();
  for (auto& subscriber : images_) subscriber.shutdown();
  for (auto& subscriber : infos_) subscriber.shutdown();
}

bool StereoSubscriber::wanted(Topic topic) const {
  const bool left = topic == kLeftImage || topic == kLeftInfo;
  return eyes_ == Eyes::kBoth || (left == (eyes_ == Eyes::kLeft));
}

void StereoSubscriber::take(Topic topic, const ros::Time& stamp, const StereoMessages& part) {
  ++received_[topic];
  last_stamp_[topic] = stamp;
  const auto pair = matcher_.add(stamp, part);
  if (!pair) return;
  ++pairs_;
  queue_.push(*pair);
  // Whoever was at rest until now has no other messages waiting; else they are looked at first.
  const bool rested = ros::WallTime::now() - finished_ > ros::WallDuration(kRest);
  if (rested && !waits_to_hand_on_)
    handOn();
  else
    askToHandOn();
}

void StereoSubscriber::askToHandOn() {
  if (waits_to_hand_on_) return;
  waits_to_hand_on_ = true;
  nh_.getCallbackQueue()->addCallback(boost::make_shared<HandOn>(*this),
                                      reinterpret_cast<std::uint64_t>(this));
}

void StereoSubscriber::handOn() {
  waits_to_hand_on_ = false;
  if (const auto pair = queue_.next()) callback_(*pair);
  finished_ = ros::WallTime::now();
  // Behind the messages that came meanwhile.
  if (!queue_.empty()) askToHandOn();
}

void StereoSubscriber::watch() {
  const int most = *std::max_element(received_.begin(), received_.end());
  std::string silent;
  for (int topic = 0; topic < kTopics; ++topic)
    if (wanted(static_cast<Topic>(topic)) && received_[topic] == 0)
      silent += "\n  " + nh_.resolveName(topics_[topic]);
  if (most == 0) {
    ROS_WARN_STREAM_THROTTLE_NAMED(60, name_, name_ << ": no messages yet on" << silent);
  } else if (pairs_ == 0 && !silent.empty()) {
    ROS_WARN_STREAM_NAMED(name_, name_ << ": messages come, but none on" << silent);
  } else if (pairs_ == 0) {
    double apart = 0;
    for (int a = 0; a < kTopics; ++a)
      for (int b = 0; b < a; ++b)
        if (wanted(static_cast<Topic>(a)) && wanted(static_cast<Topic>(b)))
          apart = std::max(apart, std::abs((last_stamp_[a] - last_stamp_[b]).toSec()));
    ROS_WARN_STREAM_NAMED(
        name_, name_ << ": images and camera_infos of both eyes come, but their stamps never "
                        "agree; the last ones are up to "
                     << 1e3 * apart << " ms apart. Both eyes and their infos must carry the same "
                     << "stamp");
  }
  received_.fill(0);
  pairs_ = 0;
}

}  // namespace leap_object_tracker
