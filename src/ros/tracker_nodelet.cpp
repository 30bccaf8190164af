#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <leap_object_tracker/StartTracking.h>
#include <leap_object_tracker/TrackerStatus.h>
#include <nodelet/nodelet.h>
#include <sensor_msgs/RegionOfInterest.h>
#include <std_srvs/Trigger.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <visualization_msgs/MarkerArray.h>

#include <pluginlib/class_list_macros.hpp>

#include "conversions.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "overlay.hpp"
#include "parameters.hpp"
#include "stereo_subscriber.hpp"
#include "tracker_messages.hpp"
#include "tracker_words.hpp"

namespace leap_object_tracker {

/// Rectified pairs in (rect/left/image_rect ...), the pose of one object out.
class TrackerNodelet : public nodelet::Nodelet {
 private:
  void onInit() override {
    try {
      ParameterReader reader(parameterTree(getPrivateNodeHandle()),
                             getPrivateNodeHandle().getNamespace());
      params_ = readTrackerNodeParams(reader);
      if (params_.object.empty())
        throw std::invalid_argument(getPrivateNodeHandle().getNamespace() +
                                    ": 'object' must name an object file (config/objects)");
      object_ = loadObject(params_.object);
      if (params_.object_frame.empty()) params_.object_frame = object_.name;
      order_ = orderFrom(params_.start);
      NODELET_INFO_STREAM("parameters:\n" << reader.inForce());
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(error.what());
      return;
    }
    advertise();
    subscribe();
  }

  void advertise() {
    ros::NodeHandle& nh = getPrivateNodeHandle();
    image_transport::ImageTransport transport(nh);
    pose_publisher_ = nh.advertise<geometry_msgs::PoseWithCovarianceStamped>("pose", 1);
    status_publisher_ = nh.advertise<TrackerStatus>("status", 10);
    marker_publisher_ = nh.advertise<visualization_msgs::MarkerArray>("markers", 1, true);
    particle_publisher_ = nh.advertise<geometry_msgs::PoseArray>("particles", 1);
    overlay_publisher_ = transport.advertise("overlay", 1);
    region_publisher_ =
        getNodeHandle().advertise<sensor_msgs::RegionOfInterest>("exposure_region", 1);
    start_service_ = nh.advertiseService("start", &TrackerNodelet::onStart, this);
    restart_service_ = nh.advertiseService("restart", &TrackerNodelet::onRestart, this);
    stop_service_ = nh.advertiseService("stop", &TrackerNodelet::onStop, this);
    broadcaster_ = std::make_unique<tf2_ros::TransformBroadcaster>();
    transforms_ = std::make_unique<tf2_ros::Buffer>();
    listener_ = std::make_unique<tf2_ros::TransformListener>(*transforms_);
  }

  void subscribe() {
    start_subscriber_ = getNodeHandle().subscribe<geometry_msgs::PoseWithCovarianceStamped>(
        "initialpose", 1, [this](const geometry_msgs::PoseWithCovarianceStampedConstPtr& message) {
          startAt(message->header, message->pose.pose);
        });
    subscriber_ = std::make_unique<StereoSubscriber>(
        getNodeHandle(), getPrivateNodeHandle(), "rect/", "image_rect", params_.tracker.eyes,
        getName(), [this](const StereoMessages& pair) { onPair(pair); });
    subscriber_->subscribe();
  }

  void onPair(const StereoMessages& pair) {
    const auto begin = ros::WallTime::now();
    try {
      followCamera(pair);
      const RectifiedStereoFrame frame{stampFrom(pair.header().stamp), pictureOf(pair.left),
                                       pictureOf(pair.right)};
      followTime(pair.header().stamp);
      const auto estimate = tracker_->track(frame, fixedFromCamera(pair.header()));
      if (estimate) {
        last_pose_ = estimate->camera_from_object;
        publishPose(*estimate, pair.header());
      }
      publishStatus(pair.header(), (ros::WallTime::now() - begin).toSec());
      publishPictures(frame, estimate, pair.header());
    } catch (const std::invalid_argument& error) {
      NODELET_WARN_STREAM_THROTTLE(5, "frame left out: " << error.what());
    }
  }

  /// Builds the tracker for the camera of the images. When the camera becomes another one, it goes
  /// on from its pose, or else with the last order.
  void followCamera(const StereoMessages& pair) {
    const RectifiedStereoCamera camera =
        rectifiedCameraFrom(pair.left_info.get(), pair.right_info.get());
    camera_frame_ = pair.header().frame_id;
    if (tracker_ && sameCamera(camera, tracker_->camera())) return;
    TrackerOrder order = order_;
    if (tracker_ && tracker_->report().state == TrackerState::kTracking && last_pose_)
      order = {TrackerOrder::Kind::kStart, *last_pose_};
    tracker_.reset();
    tracker_ = std::make_unique<Tracker>(params_.tracker, object_, camera);
    NODELET_INFO_STREAM("tracks '" << object_.name << "' (symmetry: " << describe(object_.symmetry)
                                   << ") in images of " << camera.size);
    carryOut(order);
  }

  /// The pixels of an eye; none of an eye that is not there.
  cv::Mat pictureOf(const sensor_msgs::ImageConstPtr& message) const {
    if (!message) return {};
    const cv::Mat picture = imageFrom(*message);
    if (picture.size() != tracker_->camera().size)
      throw std::invalid_argument("image: its size is not that of its camera_info");
    return picture;
  }

  void followTime(const ros::Time& stamp) {
    if (stamp < last_stamp_) {
      NODELET_WARN_STREAM("time jumped back by " << (last_stamp_ - stamp).toSec()
                                                 << " s: a new run begins");
      transforms_->clear();
    }
    last_stamp_ = stamp;
  }

  std::optional<Pose> fixedFromCamera(const std_msgs::Header& header) {
    if (params_.fixed_frame.empty()) return std::nullopt;
    try {
      return poseFrom(transforms_->lookupTransform(
          params_.fixed_frame, header.frame_id, header.stamp, ros::Duration(params_.tf_patience)));
    } catch (const tf2::TransformException& error) {
      NODELET_WARN_STREAM_THROTTLE(5, "no transform to '" << params_.fixed_frame
                                                          << "', the camera is taken to be at "
                                                             "rest: "
                                                          << error.what());
      return std::nullopt;
    }
  }

  void publishPose(const PoseEstimate& estimate, const std_msgs::Header& header) {
    broadcaster_->sendTransform(transformMessage(estimate, header, params_.object_frame));
    pose_publisher_.publish(poseMessage(estimate, header));
    if (region_publisher_.getNumSubscribers() > 0)
      region_publisher_.publish(
          regionMessage(tracker_->camera(), object_, estimate.camera_from_object));
  }

  void publishStatus(const std_msgs::Header& header, double total_seconds) {
    auto status = statusMessage(tracker_->report(), header, object_.name);
    status->total_ms = 1e3 * total_seconds;
    status->age = (ros::Time::now() - header.stamp).toSec();
    status->dropped = subscriber_->dropped();
    status_publisher_.publish(status);
    if (status->unclear)
      NODELET_INFO_STREAM_THROTTLE(
          5, "sees '" << object_.name << "', but not which way it is turned: no pose yet");
    const bool shown = tracker_->report().state == TrackerState::kTracking;
    if (shown == mesh_shown_) return;
    mesh_shown_ = shown;
    marker_publisher_.publish(meshMessage(object_, params_.object_frame, shown));
  }

  void publishPictures(const RectifiedStereoFrame& frame,
                       const std::optional<PoseEstimate>& estimate,
                       const std_msgs::Header& header) {
    if (particle_publisher_.getNumSubscribers() > 0)
      particle_publisher_.publish(
          particlesMessage(tracker_->particles(), params_.shown_particles, header));
    const ros::WallTime now = ros::WallTime::now();
    if (overlay_publisher_.getNumSubscribers() == 0 || params_.overlay_rate <= 0 ||
        std::abs((now - last_overlay_).toSec()) < 1 / params_.overlay_rate)
      return;
    last_overlay_ = now;
    const auto pose =
        estimate ? std::make_optional(estimate->camera_from_object) : std::optional<Pose>();
    overlay_publisher_.publish(imageMessage(drawOverlay(frame, *tracker_, pose), header));
  }

  void carryOut(const TrackerOrder& order) {
    order_ = order;
    if (!tracker_) return;
    if (order.kind == TrackerOrder::Kind::kStart)
      tracker_->start(order.camera_from_object);
    else if (order.kind == TrackerOrder::Kind::kSearch)
      tracker_->search();
    else
      tracker_->stop();
  }

  /// @return what is wrong, or nothing
  std::string startAt(const std_msgs::Header& header, const geometry_msgs::Pose& message) {
    try {
      Pose camera_from_object = poseFrom(message);
      if (!header.frame_id.empty() && header.frame_id != camera_frame_)
        camera_from_object =
            poseFrom(transforms_->lookupTransform(camera_frame_, header.frame_id, header.stamp)) *
            camera_from_object;
      carryOut({TrackerOrder::Kind::kStart, camera_from_object});
      return "";
    } catch (const std::exception& error) {
      NODELET_WARN_STREAM("start pose refused: " << error.what());
      return error.what();
    }
  }

  bool onStart(StartTracking::Request& request, StartTracking::Response& response) {
    response.message = startAt(request.pose.header, request.pose.pose);
    response.success = response.message.empty();
    return true;
  }

  bool onRestart(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    carryOut({TrackerOrder::Kind::kSearch, Pose::Identity()});
    response.success = true;
    return true;
  }

  bool onStop(std_srvs::Trigger::Request&, std_srvs::Trigger::Response& response) {
    carryOut({TrackerOrder::Kind::kStop, Pose::Identity()});
    response.success = true;
    return true;
  }

  TrackerNodeParams params_;
  ObjectModel object_;
  TrackerOrder order_;
  std::unique_ptr<Tracker> tracker_;
  std::optional<Pose> last_pose_;
  std::string camera_frame_;
  ros::Time last_stamp_;
  ros::WallTime last_overlay_;
  bool mesh_shown_ = false;

  ros::Publisher pose_publisher_, status_publisher_, marker_publisher_, particle_publisher_,
      region_publisher_;
  image_transport::Publisher overlay_publisher_;
  ros::ServiceServer start_service_, restart_service_, stop_service_;
  std::unique_ptr<tf2_ros::TransformBroadcaster> broadcaster_;
  std::unique_ptr<tf2_ros::Buffer> transforms_;
  std::unique_ptr<tf2_ros::TransformListener> listener_;
  ros::Subscriber start_subscriber_;
  std::unique_ptr<StereoSubscriber> subscriber_;
};

}  // namespace leap_object_tracker

PLUGINLIB_EXPORT_CLASS(leap_object_tracker::TrackerNodelet, nodelet::Nodelet)
