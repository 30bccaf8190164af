#include <image_transport/image_transport.h>
#include <nodelet/nodelet.h>
#include <tf2_ros/transform_broadcaster.h>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <thread>

#include "conversions.hpp"
#include "parameters.hpp"
#include "simulator_messages.hpp"

namespace leap_object_tracker {

/// A scene in the device's place: left/image_raw and right/image_raw with their camera_info, and
/// the truth. Frames come at the scene's rate, or later if the machine is slower: the scene then
/// runs in slow motion, and stamps are always the clock's. Rests while nobody listens.
class SimulatorNodelet : public nodelet::Nodelet {
 public:
  ~SimulatorNodelet() override {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  void onInit() override {
    std::string scene_path;
    SceneOverrides overrides;
    std::unique_ptr<Scene> scene;
    try {
      ParameterReader reader(parameterTree(getPrivateNodeHandle()),
                             getPrivateNodeHandle().getNamespace());
      reader.read("scene", scene_path);
      reader.read("object", overrides.object_path);
      reader.read("loop", loop_);
      reader.finish();
      if (scene_path.empty())
        throw std::invalid_argument("the parameter 'scene' is missing; expected a scene file");
      scene = std::make_unique<Scene>(loadScene(scene_path, overrides));
      simulator_ = std::make_unique<Simulator>(*scene);
      NODELET_INFO_STREAM("scene " << scene_path << ", parameters:\n" << reader.inForce());
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(error.what());
      return;
    }
    const StereoCalibration calibration = fitCalibration(scene->unit, scene->mode).calibration;
    left_info_ = simulatedCameraInfo(calibration, false);
    right_info_ = simulatedCameraInfo(calibration, true);

    ros::NodeHandle& nh = getNodeHandle();
    image_transport::ImageTransport transport(nh);
    left_ = transport.advertiseCamera("left/image_raw", 1);
    right_ = transport.advertiseCamera("right/image_raw", 1);
    truth_ = nh.advertise<geometry_msgs::PoseStamped>("/ground_truth/pose", 10);
    visible_ = nh.advertise<geometry_msgs::Vector3Stamped>("/ground_truth/visible", 10);
    for (std::size_t i = 1; i < scene->bodies.size(); ++i) {
      const auto& body = scene->bodies[i];
      if (body.is_object)
        other_truths_[body.name] =
            nh.advertise<geometry_msgs::PoseStamped>("/ground_truth/" + body.name + "/pose", 10);
    }
    thread_ = std::thread([this] { work(); });
  }

  bool wanted() const {
    return left_.getNumSubscribers() > 0 || right_.getNumSubscribers() > 0 ||
           truth_.getNumSubscribers() > 0;
  }

  void work() {
    constexpr std::chrono::milliseconds kLook(100);
    Stamp simulated;
    auto due = std::chrono::steady_clock::now();
    while (!stop_) {
      if (!wanted()) {
        std::this_thread::sleep_for(kLook);
        continue;
      }
      const auto frame = simulator_->next();
      if (!frame) {
        if (!loop_) {
          NODELET_INFO("the scene is over");
          return;
        }
        simulator_->rewind();
        continue;
      }
      // In the pace of the scene; after a pause or a slow frame, at once.
      if (simulated != Stamp()) due += frame->raw.stamp - simulated;
      simulated = frame->raw.stamp;
      const auto now = std::chrono::steady_clock::now();
      if (due < now) due = now;
      std::this_thread::sleep_until(due);
      publish(*frame, ros::Time::now());
    }
  }

  void publish(const SimulatedFrame& frame, const ros::Time& stamp) {
    if (simulator_->cameraMoves()) broadcaster_.sendTransform(cameraTransform(frame, stamp));
    truth_.publish(truthMessage(frame.camera_from_object, stamp));
    visible_.publish(visibilityMessage(frame, stamp));
    for (const auto& other : frame.others) {
      const auto found = other_truths_.find(other.name);
      if (found != other_truths_.end())
        found->second.publish(truthMessage(other.camera_from_body, stamp));
    }
    publishEye(left_, simulatedImage(frame.raw.left, stamp, false), left_info_);
    publishEye(right_, simulatedImage(frame.raw.right, stamp, true), right_info_);
  }

  static void publishEye(const image_transport::CameraPublisher& publisher,
                         sensor_msgs::Image&& image, const sensor_msgs::CameraInfo& camera_info) {
    const auto message = boost::make_shared<sensor_msgs::Image>(std::move(image));
    const auto info = boost::make_shared<sensor_msgs::CameraInfo>(camera_info);
    info->header.stamp = message->header.stamp;
    publisher.publish(message, info);
  }

  bool loop_ = true;
  std::unique_ptr<Simulator> simulator_;
  sensor_msgs::CameraInfo left_info_, right_info_;
  image_transport::CameraPublisher left_, right_;
  ros::Publisher truth_, visible_;
  std::map<std::string, ros::Publisher> other_truths_;
  tf2_ros::TransformBroadcaster broadcaster_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace leap_object_tracker

PLUGINLIB_EXPORT_CLASS(leap_object_tracker::SimulatorNodelet, nodelet::Nodelet)
