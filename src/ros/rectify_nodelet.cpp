#include <nodelet/nodelet.h>

#include <pluginlib/class_list_macros.hpp>

#include "conversions.hpp"
#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "message_pool.hpp"
#include "parameters.hpp"
#include "stereo_subscriber.hpp"

namespace leap_object_tracker {

/// Raw pairs in (left/image_raw ...), rectified pairs out (rect/left/image_rect ...), only while
/// somebody listens. The exact map on the topic `calibration` goes before camera_info.
class RectifyNodelet : public nodelet::Nodelet {
 private:
  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    try {
      ParameterReader reader(parameterTree(private_nh), private_nh.getNamespace());
      params_ = readRectifyNodeParams(reader);
      NODELET_INFO_STREAM("parameters:\n" << reader.inForce());
    } catch (const std::invalid_argument& error) {
      NODELET_FATAL_STREAM(error.what());
      return;
    }
    image_transport::ImageTransport transport(nh);
    const image_transport::SubscriberStatusCallback image_change =
        [this](const image_transport::SingleSubscriberPublisher&) { followListeners(); };
    const ros::SubscriberStatusCallback info_change =
        [this](const ros::SingleSubscriberPublisher&) { followListeners(); };
    for (const char* eye : {"left", "right"})
      publishers_.push_back(transport.advertiseCamera(std::string("rect/") + eye + "/image_rect", 1,
                                                      image_change, image_change, info_change,
                                                      info_change));
    subscriber_ =
        std::make_unique<StereoSubscriber>(nh, private_nh, "", "image_raw", params_.eyes, getName(),
                                           [this](const StereoMessages& pair) { onPair(pair); });
    calibration_subscriber_ = nh.subscribe<LeapCalibration>(
        "calibration", 1, [this](const LeapCalibrationConstPtr& message) {
          exact_ = message;
          rectifier_.reset();
        });
    // Listeners that came before the queue of this nodelet was open.
    late_look_ = nh.createWallTimer(ros::WallDuration(1.0),
                                    [this](const ros::WallTimerEvent&) { followListeners(); });
  }

  void followListeners() {
    if (!subscriber_) return;
    const bool wanted =
        publishers_[0].getNumSubscribers() > 0 || publishers_[1].getNumSubscribers() > 0;
    if (wanted)
      subscriber_->subscribe();
    else
      subscriber_->unsubscribe();
  }

  void onPair(const StereoMessages& pair) {
    try {
      followCamera(pair);
      const RawStereoFrame raw{stampFrom(pair.header().stamp),
                               pair.left ? imageFrom(*pair.left) : cv::Mat(),
                               pair.right ? imageFrom(*pair.right) : cv::Mat()};
      const auto left = emptyImage(pair.left), right = emptyImage(pair.right);
      RectifiedStereoFrame rectified{raw.stamp, left ? imageFrom(*left) : cv::Mat(),
                                     right ? imageFrom(*right) : cv::Mat()};
      rectifier_->rectify(raw, rectified);
      publish(publishers_[0], left, false);
      publish(publishers_[1], right, true);
    } catch (const std::invalid_argument& error) {
      NODELET_WARN_STREAM_THROTTLE(5, "frame left out: " << error.what());
    }
  }

  /// Builds the tables anew when the camera is another one.
  void followCamera(const StereoMessages& pair) {
    const auto same = [](const sensor_msgs::CameraInfoConstPtr& a,
                         const sensor_msgs::CameraInfoConstPtr& b) {
      return a == b || (a && b && sameCamera(*a, *b));
    };
    if (rectifier_ && same(pair.left_info, left_info_) && same(pair.right_info, right_info_))
      return;
    rectifier_.reset();
    left_info_ = pair.left_info;
    right_info_ = pair.right_info;
    const auto& info = left_info_ ? left_info_ : right_info_;
    const StereoCalibration calibration =
        exact_ && info && holdsFor(*exact_, *info)
            ? calibrationFrom(*exact_)
            : calibrationFrom(left_info_.get(), right_info_.get());
    const RectifiedStereoCamera camera = rectifiedCamera(calibration, params_.rectification);
    rectifier_ = std::make_unique<StereoRectifier>(calibration, camera);
    NODELET_INFO_STREAM("rectifies " << calibration.left.size << " to " << camera.size
                                     << ", focal length " << camera.focal_length << " px, baseline "
                                     << camera.baseline << " m");
  }

  /// A message to write the pixels into; null for an eye that is not there.
  sensor_msgs::ImagePtr emptyImage(const sensor_msgs::ImageConstPtr& raw) {
    if (!raw) return nullptr;
    const cv::Size size = rectifier_->camera().size;
    const auto image = images_.take();
    image->header = raw->header;
    image->encoding = "mono8";
    image->width = image->step = static_cast<std::uint32_t>(size.width);
    image->height = static_cast<std::uint32_t>(size.height);
    image->data.resize(static_cast<std::size_t>(size.area()));
    return image;
  }

  void publish(const image_transport::CameraPublisher& publisher,
               const sensor_msgs::ImagePtr& image, bool right_eye) {
    if (!image) return;
    const auto info = infos_.take();
    *info = messageFrom(rectifier_->camera(), right_eye);
    info->header = image->header;
    publisher.publish(image, info);
  }

  RectifyNodeParams params_;
  std::vector<image_transport::CameraPublisher> publishers_;
  MessagePool<sensor_msgs::Image> images_;
  MessagePool<sensor_msgs::CameraInfo> infos_;
  std::unique_ptr<StereoRectifier> rectifier_;
  LeapCalibrationConstPtr exact_;  ///< of a Leap that says its own
  ros::Subscriber calibration_subscriber_;
  sensor_msgs::CameraInfoConstPtr left_info_;
  sensor_msgs::CameraInfoConstPtr right_info_;
  std::unique_ptr<StereoSubscriber> subscriber_;
  ros::WallTimer late_look_;
};

}  // namespace leap_object_tracker

PLUGINLIB_EXPORT_CLASS(leap_object_tracker::RectifyNodelet, nodelet::Nodelet)
