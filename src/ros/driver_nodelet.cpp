#include <diagnostic_updater/diagnostic_updater.h>
#include <dynamic_reconfigure/server.h>
#include <image_transport/image_transport.h>
#include <leap_object_tracker/LeapDriverConfig.h>
#include <nodelet/nodelet.h>
#include <pthread.h>
#include <sensor_msgs/RegionOfInterest.h>

#include <atomic>
#include <limits>
#include <pluginlib/class_list_macros.hpp>
#include <thread>

#include "conversions.hpp"
#include "driver_calibration.hpp"
#include "driver_messages.hpp"
#include "driver_parameters.hpp"
#include "leap_object_tracker/leap/dark_frames.hpp"
#include "leap_object_tracker/leap/epipolar_check.hpp"
#include "leap_object_tracker/leap/exposure_controller.hpp"
#include "message_pool.hpp"

namespace leap_object_tracker {
namespace {

constexpr std::chrono::milliseconds kGrabTimeout{100};
constexpr double kRegionLife = 0.5;     // [s]
constexpr double kCheckInterval = 5;    // [s] between attempts of the epipolar check
constexpr double kRateTolerance = 0.1;  // share; devices run 2 % slower than they say

/// The memory that a frame is assembled in is the message that is published.
struct ImagePair {
  sensor_msgs::ImagePtr left;
  sensor_msgs::ImagePtr right;
};

void prepare(sensor_msgs::Image& image, const cv::Size& size) {
  image.encoding = "mono8";
  image.width = image.step = static_cast<std::uint32_t>(size.width);
  image.height = static_cast<std::uint32_t>(size.height);
  image.data.resize(static_cast<std::size_t>(size.area()));
}

LeapControls controlsFrom(const LeapDriverConfig& config) {
  LeapControls controls;
  controls.exposure_us = config.exposure_us;
  controls.analog_gain = config.analog_gain;
  controls.digital_gain = config.digital_gain;
  controls.gamma = config.gamma;
  controls.hdr = config.hdr;
  controls.led_left = config.led_left;
  controls.led_centre = config.led_centre;
  controls.led_right = config.led_right;
  controls.dark_interval = config.dark_interval;
  return controls;
}

/// Where a part of the rectified left image lies in the raw one.
cv::Rect rawRegion(const sensor_msgs::RegionOfInterest& region,
                   const sensor_msgs::CameraInfo& rectified, const CameraCalibration& raw) {
  double left = std::numeric_limits<double>::max(), top = left, right = -left, bottom = -left;
  for (int i = 0; i <= 2; ++i)
    for (int k = 0; k <= 2; ++k) {
      const double u = region.x_offset + region.width * i / 2.0;
      const double v = region.y_offset + region.height * k / 2.0;
      const Eigen::Vector3d ray((u - rectified.K[2]) / rectified.K[0],
                                (v - rectified.K[5]) / rectified.K[4], 1);
      const Eigen::Vector2d pixel =
          pixelFromRay(raw, (raw.rectified_from_raw.transpose() * ray).hnormalized());
      if (!pixel.allFinite()) continue;
      left = std::min(left, pixel.x()), right = std::max(right, pixel.x());
      top = std::min(top, pixel.y()), bottom = std::max(bottom, pixel.y());
    }
  if (right < left) return {};
  return cv::Rect(cv::Point(static_cast<int>(left), static_cast<int>(top)),
                  cv::Point(static_cast<int>(right) + 1, static_cast<int>(bottom) + 1)) &
         cv::Rect(cv::Point(), raw.size);
}

}  // namespace

/// A Leap on the USB bus: left/image_raw, left/camera_info, right/..., frame_info and calibration.
/// Waits for a device that is absent; goes on when it comes back.
class DriverNodelet : public nodelet::Nodelet {
 public:
  ~DriverNodelet() override {
    running_ = false;
    if (thread_.joinable()) thread_.join();
  }

 private:
  void onInit() override {
    ros::NodeHandle& nh = getNodeHandle();
    ros::NodeHandle& private_nh = getPrivateNodeHandle();
    try {
      ParameterReader reader(parameterTree(private_nh), private_nh.getNamespace());
      params_ = readDriverNodeParams(reader);
      params_.camera.stream.buffers = [this](cv::Size size) { return emptyImages(size); };
      exposure_ = std::make_unique<ExposureController>(params_.exposure);
      calibration_ = std::make_unique<DriverCalibration>(nh, params_);
      camera_ = std::make_unique<LeapCamera>(params_.camera);
      NODELET_INFO_STREAM("parameters:\n" << reader.inForce());
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM(error.what());
      return;
    }
    image_transport::ImageTransport transport(nh);
    left_publisher_ = transport.advertiseCamera("left/image_raw", 2);
    right_publisher_ = transport.advertiseCamera("right/image_raw", 2);
    info_publisher_ = nh.advertise<LeapFrameInfo>("frame_info", 10);
    calibration_publisher_ = nh.advertise<LeapCalibration>("calibration", 1, true);
    region_subscriber_ = nh.subscribe("exposure_region", 1, &DriverNodelet::onRegion, this);

    reconfigure_ = std::make_unique<dynamic_reconfigure::Server<LeapDriverConfig>>(private_nh);
    reconfigure_->setCallback(
        [this](const LeapDriverConfig& config, std::uint32_t) { onConfig(config); });
    diagnostics_ = std::make_unique<diagnostic_updater::Updater>(nh, private_nh, getName());
    diagnostics_->setHardwareID("Leap Motion");
    diagnostics_->add("pictures", this, &DriverNodelet::diagnose);
    diagnostics_timer_ = nh.createWallTimer(
        ros::WallDuration(1), [this](const ros::WallTimerEvent&) { diagnostics_->force_update(); });
    check_timer_ = getMTNodeHandle().createWallTimer(
        ros::WallDuration(kCheckInterval), [this](const ros::WallTimerEvent&) { checkEpipolar(); });

    running_ = true;
    thread_ = std::thread([this] { run(); });
    pthread_setname_np(thread_.native_handle(), "leap_driver");
  }

  void run() {
    std::string told;
    while (running_) {
      try {
        if (auto frame = camera_->grab(kGrabTimeout)) publish(*frame);
        tell(told);
      } catch (const std::exception& error) {
        NODELET_ERROR_STREAM_THROTTLE(5, "frame left out: " << error.what());
      }
    }
  }

  /// Each state of the camera is told once.
  void tell(std::string& told) {
    const LeapStatus status = camera_->status();
    if (status.message == told) return;
    told = status.message;
    if (status.state == LeapState::kWaiting)
      NODELET_WARN_STREAM(told << "; waiting");
    else
      NODELET_INFO_STREAM(told);
  }

  /// Called on the thread that receives USB data.
  FrameBuffers emptyImages(const cv::Size& size) {
    auto pair = std::make_shared<ImagePair>();
    FrameBuffers buffers;
    const auto take = [&](sensor_msgs::ImagePtr& image) {
      image = images_.take();
      prepare(*image, size);
      return cv::Mat(size, CV_8UC1, image->data.data());
    };
    buffers.left = take(pair->left);
    buffers.right = take(pair->right);
    buffers.owner = pair;
    return buffers;
  }

  void publish(LeapFrame& frame) {
    followDevice();
    const LeapDriverConfig config = this->config();
    const bool dark =
        dark_detector_.isDark(frame.metadata, config.dark_interval >= 2 ? brightnessOf(frame) : 0,
                              frame.taken_with.dark_interval);
    const bool alternates = config.dark_interval >= 2;
    const bool judged = config.auto_exposure && !(alternates && dark);
    const bool subtracts = config.subtract_ambient && alternates;
    if (subtracts && dark) {
      ambient_.setDark(frame.images.left, frame.images.right, frame.taken_with);
      return;
    }
    if (judged && subtracts) adjustExposure(frame);
    send(frame, !dark,
         subtracts && ambient_.subtract(frame.images.left, frame.images.right, frame.taken_with));
    // Of pictures as they came, while others are at work on them.
    if (judged && !subtracts) adjustExposure(frame);
  }

  void send(const LeapFrame& frame, bool lit, bool subtracted) {
    const auto pair = std::static_pointer_cast<ImagePair>(frame.owner);
    const DriverCalibration::Infos infos = calibration_->infos();
    std_msgs::Header header;
    header.stamp = timeFrom(frame.images.stamp);
    const auto sendEye = [&](const image_transport::CameraPublisher& publisher,
                             const sensor_msgs::ImagePtr& image,
                             const sensor_msgs::CameraInfo& info, const std::string& frame_id) {
      header.frame_id = frame_id;
      image->header = header;
      const auto own_info = infos_.take();
      *own_info = info;
      own_info->header = header;
      publisher.publish(sensor_msgs::ImageConstPtr(image), own_info);
    };
    sendEye(left_publisher_, pair->left, infos.left, params_.left_frame);
    sendEye(right_publisher_, pair->right, infos.right, params_.right_frame);

    const auto frame_info = frame_infos_.take();
    *frame_info = messageFrom(frame, lit, subtracted);
    header.frame_id = params_.left_frame;
    frame_info->header = header;
    info_publisher_.publish(frame_info);

    const std::lock_guard<std::mutex> lock(mutex_);
    latest_ = {pair->left, pair->right};
    last_info_ = frame_info;
    ++sent_;
  }

  void followDevice() {
    const LeapStatus status = camera_->status();
    if (status.connections != connections_) {
      connections_ = status.connections;
      const std::string report = calibration_->setDevice(status.identity);
      NODELET_INFO_STREAM(report);
      const std::lock_guard<std::mutex> lock(mutex_);
      checked_ = false;
    }
    if (auto calibration = calibration_->changedCalibration()) {
      calibration->header.stamp = ros::Time::now();
      calibration->header.frame_id = params_.left_frame;
      calibration_publisher_.publish(*calibration);
    }
  }

  static double brightnessOf(const LeapFrame& frame) { return cv::mean(frame.images.left)[0]; }

  void adjustExposure(const LeapFrame& frame) {
    const LeapControls commanded = camera_->controls();
    if (const auto next =
            exposure_->update(frame.images.left, region(), frame.taken_with, commanded))
      camera_->setControls(*next);
  }

  /// Of the object in the raw left image; empty if none is tracked.
  cv::Rect region() {
    const std::lock_guard<std::mutex> lock(mutex_);
    const bool fresh = (ros::WallTime::now() - region_time_).toSec() < kRegionLife;
    return fresh ? region_ : cv::Rect();
  }

  /// In pixels of the rectified left image; rect/left/camera_info says what they look at.
  void onRegion(const sensor_msgs::RegionOfInterest& message) {
    const bool needs_camera =
        (ros::WallTime::now() - rectified_time_).toSec() > 2 && !rectified_subscriber_;
    if (needs_camera)
      rectified_subscriber_ = getNodeHandle().subscribe<sensor_msgs::CameraInfo>(
          "rect/left/camera_info", 1, [this](const sensor_msgs::CameraInfoConstPtr& info) {
            rectified_ = info;
            rectified_time_ = ros::WallTime::now();
            rectified_subscriber_.shutdown();
          });
    const auto stereo = calibration_->stereo();
    if (!rectified_ || !stereo || message.width == 0 || message.height == 0) return;
    const cv::Rect raw = rawRegion(message, *rectified_, stereo->left);
    const std::lock_guard<std::mutex> lock(mutex_);
    region_ = raw;
    region_time_ = ros::WallTime::now();
  }

  void onConfig(const LeapDriverConfig& config) {
    LeapControls controls = controlsFrom(config);
    const std::lock_guard<std::mutex> lock(mutex_);
    if (config.auto_exposure && configured_) {
      const LeapControls now = camera_->controls();
      controls.exposure_us = now.exposure_us;
      controls.analog_gain = now.analog_gain;
    }
    configured_ = true;
    config_ = config;
    camera_->setControls(controls);
    if (config.subtract_ambient && config.dark_interval < 2)
      NODELET_WARN("subtract_ambient has no effect: dark_interval must be 2 or more");
  }

  LeapDriverConfig config() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return config_;
  }

  /// Once for each device, as soon as a picture has enough to look at.
  void checkEpipolar() {
    ImagePair pair;
    {
      const std::lock_guard<std::mutex> lock(mutex_);
      if (checked_ || !latest_.left) return;
      pair = latest_;
    }
    const auto stereo = calibration_->stereo();
    if (!stereo) return;
    RawStereoFrame frame;
    frame.left = imageFrom(*pair.left);
    frame.right = imageFrom(*pair.right);
    const auto used = epipolarResidual(frame, *stereo);
    if (!used) return;
    std::ostringstream text;
    text.precision(2);
    text << "epipolar check: rows of both eyes differ by " << used->median << " px (median of "
         << used->matches << " matches)";
    for (const auto convention : {CalibrationConvention::kRecommended,
                                  CalibrationConvention::kLeapuvc, CalibrationConvention::kNone})
      if (const auto other = calibration_->byConvention(convention))
        if (const auto residual = epipolarResidual(frame, *other))
          text << "; by convention " << name(convention) << ": " << residual->median;
    NODELET_INFO_STREAM(text.str());
    const std::lock_guard<std::mutex> lock(mutex_);
    checked_ = true;
    epipolar_report_ = text.str();
  }

  void diagnose(diagnostic_updater::DiagnosticStatusWrapper& report) {
    using diagnostic_msgs::DiagnosticStatus;
    const LeapStatus status = camera_->status();
    const LeapModeInfo& mode = leapModeInfo(params_.camera.stream.mode);
    const ros::WallTime now = ros::WallTime::now();
    const std::uint64_t good = status.counters.frames.good;
    const double seconds = (now - diagnosed_).toSec();
    const double rate = seconds > 0 ? static_cast<double>(good - diagnosed_good_) / seconds : 0;
    diagnosed_ = now;
    diagnosed_good_ = good;

    if (status.state == LeapState::kWaiting)
      report.summary(DiagnosticStatus::ERROR, status.message);
    else if (rate < (1 - kRateTolerance) * mode.rate())
      report.summary(DiagnosticStatus::WARN, "fewer pictures than expected");
    else
      report.summary(DiagnosticStatus::OK, "pictures flow");
    report.add("serial number", status.identity.serial);
    report.add("mode", mode.name);
    report.add("rate [1/s]", rate);
    report.add("expected rate [1/s]", mode.rate());
    report.add("torn frames", status.counters.frames.torn);
    report.add("frames without an end", status.counters.frames.lost_end);
    report.add("missing frames", status.counters.missing);
    report.add("dropped frames", status.counters.dropped);
    report.add("transfer errors", status.counters.transfers.errors);
    report.add("halts", status.counters.transfers.halts);
    report.add("re-connections", std::max(0, status.connections - 1));
    const std::lock_guard<std::mutex> lock(mutex_);
    if (last_info_) {
      report.add("age of the last frame [s]",
                 (ros::Time::now() - last_info_->header.stamp).toSec());
      report.add("exposure [us]", last_info_->exposure);
      report.add("analog gain [1/16]", last_info_->analog_gain);
    }
    if (!epipolar_report_.empty()) report.add("calibration", epipolar_report_);
  }

  DriverNodeParams params_;
  std::unique_ptr<ExposureController> exposure_;
  std::unique_ptr<DriverCalibration> calibration_;
  MessagePool<sensor_msgs::Image> images_;      ///< of the USB thread
  MessagePool<sensor_msgs::CameraInfo> infos_;  ///< of thread_, like all down to connections_
  MessagePool<LeapFrameInfo> frame_infos_;
  DarkFrameDetector dark_detector_;
  AmbientSubtraction ambient_;
  int connections_ = 0;

  image_transport::CameraPublisher left_publisher_;
  image_transport::CameraPublisher right_publisher_;
  ros::Publisher info_publisher_;
  ros::Publisher calibration_publisher_;
  ros::Subscriber region_subscriber_;
  ros::Subscriber rectified_subscriber_;
  sensor_msgs::CameraInfoConstPtr rectified_;
  ros::WallTime rectified_time_;
  std::unique_ptr<dynamic_reconfigure::Server<LeapDriverConfig>> reconfigure_;
  std::unique_ptr<diagnostic_updater::Updater> diagnostics_;
  ros::WallTimer diagnostics_timer_;
  ros::WallTimer check_timer_;
  ros::WallTime diagnosed_ = ros::WallTime::now();
  std::uint64_t diagnosed_good_ = 0;

  mutable std::mutex mutex_;  ///< guards what several threads use:
  LeapDriverConfig config_;
  bool configured_ = false;
  cv::Rect region_;
  ros::WallTime region_time_;
  ImagePair latest_;
  LeapFrameInfoConstPtr last_info_;
  std::uint64_t sent_ = 0;
  bool checked_ = false;
  std::string epipolar_report_;

  std::unique_ptr<LeapCamera> camera_;
  std::atomic<bool> running_{false};
  std::thread thread_;
};

}  // namespace leap_object_tracker

PLUGINLIB_EXPORT_CLASS(leap_object_tracker::DriverNodelet, nodelet::Nodelet)
