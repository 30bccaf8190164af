#include "stereo_bag.hpp"

#include <geometry_msgs/PoseStamped.h>
#include <rosbag/view.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>

#include "conversions.hpp"

namespace leap_object_tracker {
namespace {

/// More images than this without their other eye, and the pair is given up.
constexpr std::size_t kMostWaiting = 64;

}  // namespace

StereoBag::StereoBag(const std::string& path, const StereoBagTopics& topics, Eyes eyes)
    : path_(path), topics_(topics), eyes_(eyes) {
  try {
    bag_.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagUnindexedException&) {
    complain("has no index: the recording was cut off; try `rosbag reindex`");
  } catch (const rosbag::BagException& error) {
    complain(std::string("cannot be read: ") + error.what());
  }
  const std::size_t left = count(topics_.left_image), right = count(topics_.right_image);
  if (left == 0 && eyes != Eyes::kRight) complain("has no images on " + topics_.left_image);
  if (right == 0 && eyes != Eyes::kLeft) complain("has no images on " + topics_.right_image);
  most_pairs_ = eyes == Eyes::kLeft ? left : eyes == Eyes::kRight ? right : std::min(left, right);
  readCalibration();
}

void StereoBag::complain(const std::string& what) const {
  throw std::runtime_error("bag '" + path_ + "': " + what);
}

std::size_t StereoBag::count(const std::string& topic) const {
  return rosbag::View(bag_, rosbag::TopicQuery(topic)).size();
}

std::optional<sensor_msgs::CameraInfo> StereoBag::firstInfo(const std::string& topic) const {
  rosbag::View view(bag_, rosbag::TopicQuery(topic));
  if (view.size() == 0) return std::nullopt;
  const auto info = view.begin()->instantiate<sensor_msgs::CameraInfo>();
  if (!info) complain(topic + " holds no sensor_msgs/CameraInfo");
  return *info;
}

void StereoBag::readCalibration() {
  const auto left = firstInfo(topics_.left_info), right = firstInfo(topics_.right_info);
  if (!left && eyes_ != Eyes::kRight) complain("has no messages on " + topics_.left_info);
  if (!right && eyes_ != Eyes::kLeft) complain("has no messages on " + topics_.right_info);
  left_info_ = left ? *left : *right;
  right_info_ = right ? *right : *left;
  camera_frame_ = left_info_.header.frame_id;
  try {
    calibration_ = calibrationFrom(left ? &*left : nullptr, right ? &*right : nullptr);
    rosbag::View exact(bag_, rosbag::TopicQuery(topics_.calibration));
    const auto message = exact.size() > 0 ? exact.begin()->instantiate<LeapCalibration>() : nullptr;
    if (message && holdsFor(*message, left_info_)) calibration_ = calibrationFrom(*message);
  } catch (const std::invalid_argument& error) {
    complain(error.what());
  }
}

StampedPose StereoBag::truthFrom(const rosbag::MessageInstance& entry) const {
  const auto message = entry.instantiate<geometry_msgs::PoseStamped>();
  if (!message) complain(topics_.truth + " holds no geometry_msgs/PoseStamped");
  try {
    return {stampFrom(message->header.stamp), poseFrom(message->pose), {}};
  } catch (const std::invalid_argument& error) {
    complain(topics_.truth + ": " + error.what());
  }
}

Trajectory StereoBag::truth() const {
  Trajectory truth;
  for (const auto& entry : rosbag::View(bag_, rosbag::TopicQuery(topics_.truth)))
    truth.push_back(truthFrom(entry));
  return truth;
}

std::optional<StampedPose> StereoBag::firstTruth() const {
  rosbag::View view(bag_, rosbag::TopicQuery(topics_.truth));
  if (view.size() == 0) return std::nullopt;
  return truthFrom(*view.begin());
}

std::unique_ptr<tf2::BufferCore> StereoBag::transforms() const {
  auto buffer = std::make_unique<tf2::BufferCore>(ros::Duration(1e6));
  for (const std::string& topic : std::vector<std::string>{"/tf", "/tf_static"})
    for (const auto& entry : rosbag::View(bag_, rosbag::TopicQuery(topic))) {
      const auto message = entry.instantiate<tf2_msgs::TFMessage>();
      if (!message) complain(topic + " holds no tf2_msgs/TFMessage");
      for (const auto& transform : message->transforms)
        buffer->setTransform(transform, path_, topic == "/tf_static");
    }
  return buffer;
}

StereoBag::Rest StereoBag::forEachPair(
    const std::function<void(const RawStereoFrame&)>& use) const {
  using ImagePtr = sensor_msgs::Image::ConstPtr;
  std::deque<ImagePtr> left_waiting, right_waiting;
  Rest rest;
  std::size_t& alone = rest.images_left_alone;
  std::size_t pairs = 0;
  double smallest_difference = std::numeric_limits<double>::infinity();

  const auto pixels = [&](const ImagePtr& image, const std::string& topic) {
    if (!image) return cv::Mat();
    try {
      const cv::Mat mat = imageFrom(*image);
      if (mat.size() != calibration_.left.size)
        complain(topic + ": an image at " + std::to_string(image->header.stamp.toSec()) + " s is " +
                 std::to_string(mat.cols) + "x" + std::to_string(mat.rows) + "; camera_info says " +
                 std::to_string(calibration_.left.size.width) + "x" +
                 std::to_string(calibration_.left.size.height));
      return mat;
    } catch (const std::invalid_argument& error) {
      complain(topic + ": " + error.what());
    }
  };
  const auto deliver = [&](const ImagePtr& left, const ImagePtr& right) {
    ++pairs;
    use({stampFrom((left ? left : right)->header.stamp), pixels(left, topics_.left_image),
         pixels(right, topics_.right_image)});
  };
  const auto pairUp = [&](std::deque<ImagePtr>& own, std::deque<ImagePtr>& others,
                          const ImagePtr& image, bool is_left) {
    for (std::size_t i = 0; i < others.size(); ++i) {
      const ImagePtr other = others[i];
      const double difference = std::abs((other->header.stamp - image->header.stamp).toSec());
      smallest_difference = std::min(smallest_difference, difference);
      if (other->header.stamp != image->header.stamp) continue;
      alone += i + own.size();
      others.erase(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(i) + 1);
      own.clear();
      deliver(is_left ? image : other, is_left ? other : image);
      return;
    }
    own.push_back(image);
    if (own.size() > kMostWaiting) {
      own.pop_front();
      ++alone;
    }
  };

  std::vector<std::string> topics{topics_.left_info, topics_.right_info, topics_.truth};
  if (eyes_ != Eyes::kRight) topics.push_back(topics_.left_image);
  if (eyes_ != Eyes::kLeft) topics.push_back(topics_.right_image);
  try {
    for (const auto& entry : rosbag::View(bag_, rosbag::TopicQuery(topics))) {
      const std::string& topic = entry.getTopic();
      if (topic == topics_.truth) {
        rest.truth.push_back(truthFrom(entry));
        continue;
      }
      if (topic == topics_.left_info || topic == topics_.right_info) {
        const auto info = entry.instantiate<sensor_msgs::CameraInfo>();
        if (!info || !sameCamera(*info, topic == topics_.left_info ? left_info_ : right_info_))
          complain(topic + ": the camera changes in mid-recording, at " +
                   std::to_string(entry.getTime().toSec()) + " s");
        continue;
      }
      const auto image = entry.instantiate<sensor_msgs::Image>();
      if (!image) complain(topic + " holds no sensor_msgs/Image");
      const bool is_left = topic == topics_.left_image;
      if (eyes_ != Eyes::kBoth)
        deliver(is_left ? image : nullptr, is_left ? nullptr : image);
      else
        pairUp(is_left ? left_waiting : right_waiting, is_left ? right_waiting : left_waiting,
               image, is_left);
    }
  } catch (const rosbag::BagException& error) {
    complain(std::string("is damaged: ") + error.what());
  }
  if (pairs == 0)
    complain("no left and right image have the same stamp; the nearest two are " +
             std::to_string(1e3 * smallest_difference) + " ms apart");
  alone += left_waiting.size() + right_waiting.size();
  return rest;
}

}  // namespace leap_object_tracker
