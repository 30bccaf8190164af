#include "conversions.hpp"

#include <sensor_msgs/distortion_models.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

[[noreturn]] void complain(const std::string& eye, const std::string& what) {
  throw std::invalid_argument("camera_info of the " + eye + " eye: " + what);
}

template <class Numbers>
bool allFinite(const Numbers& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [](double x) { return std::isfinite(x); });
}

void setDistortion(CameraCalibration& camera, const sensor_msgs::CameraInfo& info,
                   const std::string& eye) {
  const std::string& model = info.distortion_model;
  const auto zero = [](double x) { return x == 0; };
  std::size_t least = 0, most = 0;
  if (model == sensor_msgs::distortion_models::PLUMB_BOB) {
    camera.distortion_model = DistortionModel::kPlumbBob;
    least = 4, most = 5;
  } else if (model == sensor_msgs::distortion_models::RATIONAL_POLYNOMIAL) {
    camera.distortion_model = DistortionModel::kRationalPolynomial;
    least = 8, most = 8;
  } else if (model == sensor_msgs::distortion_models::EQUIDISTANT || model == "fisheye") {
    camera.distortion_model = DistortionModel::kEquidistant;
    least = 4, most = 4;
  } else if (!model.empty() && model != "none") {
    complain(eye, "unknown distortion_model '" + model +
                      "'; known: plumb_bob, rational_polynomial, equidistant, none");
  }
  camera.distortion = info.D;
  while (camera.distortion.size() > most && zero(camera.distortion.back()))
    camera.distortion.pop_back();
  const std::size_t count = camera.distortion.size();
  if (camera.distortion_model == DistortionModel::kEquidistant) {
    if (count != 4) complain(eye, "equidistant needs 4 coefficients in D");
    return;
  }
  if (std::all_of(camera.distortion.begin(), camera.distortion.end(), zero)) {
    camera.distortion_model = DistortionModel::kNone;
    camera.distortion.clear();
  } else if (count < least || count > most) {
    complain(eye, "'" + model + "' with " + std::to_string(info.D.size()) +
                      " coefficients in D; expected " + std::to_string(most));
  }
}

template <class Numbers>
Eigen::Matrix3d rotationFrom(const Numbers& rows, const std::string& eye) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> rotation(rows.data());
  const double error = (rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (!(error < 1e-3) || rotation.determinant() < 0)
    complain(eye, "R is not a rotation: the pair is not calibrated as a stereo camera");
  return Eigen::Quaterniond(Eigen::Matrix3d(rotation)).normalized().toRotationMatrix();
}

CameraCalibration calibrationOf(const sensor_msgs::CameraInfo& info, const std::string& eye) {
  if (info.width == 0 || info.height == 0) complain(eye, "width and height are zero");
  if (!allFinite(info.K) || !allFinite(info.D) || !allFinite(info.R) || !allFinite(info.P))
    complain(eye, "holds numbers that are not finite");
  if (!(info.K[0] > 0) || !(info.K[4] > 0))
    complain(eye, "K has no focal length: the camera is not calibrated");

  CameraCalibration camera;
  const double bin_x = std::max(1U, info.binning_x), bin_y = std::max(1U, info.binning_y);
  const bool whole = info.roi.width == 0 || info.roi.height == 0;
  const double width = whole ? info.width : info.roi.width;
  const double height = whole ? info.height : info.roi.height;
  camera.size = cv::Size(static_cast<int>(width / bin_x), static_cast<int>(height / bin_y));
  camera.fx = info.K[0] / bin_x;
  camera.fy = info.K[4] / bin_y;
  camera.cx = (info.K[2] - info.roi.x_offset + 0.5) / bin_x - 0.5;
  camera.cy = (info.K[5] - info.roi.y_offset + 0.5) / bin_y - 0.5;
  setDistortion(camera, info, eye);

  camera.rectified_from_raw = rotationFrom(info.R, eye);
  return camera;
}

CameraCalibration calibrationOf(const LeapEyeCalibration& message, const LeapCalibration& pair,
                                const std::string& eye) {
  if (!allFinite(message.pixel_to_ray) || !allFinite(message.R) || !(message.fx > 0) ||
      !(message.fy > 0) || !std::isfinite(message.cx + message.cy + message.fx + message.fy))
    throw std::invalid_argument("calibration of the Leap, " + eye +
                                " eye: holds numbers that are not finite, or no focal length");
  CameraCalibration camera;
  camera.size = cv::Size(static_cast<int>(pair.width), static_cast<int>(pair.height));
  camera.fx = message.fx;
  camera.fy = message.fy;
  camera.cx = message.cx;
  camera.cy = message.cy;
  camera.distortion_model = DistortionModel::kLeapInverse;
  camera.distortion.assign(message.pixel_to_ray.begin(), message.pixel_to_ray.end());
  camera.rectified_from_raw = rotationFrom(message.R, eye);
  return camera;
}

/// Both eyes; one that is missing is like the other.
struct Twins {
  Twins(const sensor_msgs::CameraInfo* left_eye, const sensor_msgs::CameraInfo* right_eye)
      : left(left_eye != nullptr ? left_eye : right_eye),
        right(right_eye != nullptr ? right_eye : left_eye),
        one_eye(left_eye == nullptr || right_eye == nullptr) {
    if (left == nullptr) throw std::invalid_argument("camera_info: both eyes are missing");
  }

  double baseline() const {
    constexpr double kBaselineOfLeap = 0.04;
    if (!(left->P[0] > 0)) complain("left", "P has no focal length: the pair is not calibrated");
    if (!(right->P[0] > 0)) complain("right", "P has no focal length: the pair is not calibrated");
    if (one_eye) return left->P[3] < 0 ? -left->P[3] / left->P[0] : kBaselineOfLeap;
    const double baseline = left->P[3] / left->P[0] - right->P[3] / right->P[0];
    if (std::isfinite(baseline) && baseline > 1e-5) return baseline;
    std::ostringstream what;
    what << "the baseline is " << baseline << " m; it must be above zero: P[3] = -fx * baseline "
         << "of the right eye";
    if (baseline < -1e-5) what << " (are left and right exchanged?)";
    complain("right", what.str());
  }

  const sensor_msgs::CameraInfo* left;
  const sensor_msgs::CameraInfo* right;
  bool one_eye;
};

}  // namespace

Stamp stampFrom(const ros::Time& time) {
  return Stamp(std::chrono::nanoseconds(static_cast<std::int64_t>(time.toNSec())));
}

ros::Time timeFrom(Stamp stamp) {
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(stamp.time_since_epoch().count()));
  return time;
}

geometry_msgs::Pose messageFrom(const Pose& pose) {
  const Eigen::Quaterniond rotation(pose.linear());
  geometry_msgs::Pose message;
  message.position.x = pose.translation().x();
  message.position.y = pose.translation().y();
  message.position.z = pose.translation().z();
  message.orientation.x = rotation.x();
  message.orientation.y = rotation.y();
  message.orientation.z = rotation.z();
  message.orientation.w = rotation.w();
  return message;
}

Pose poseFrom(const geometry_msgs::Pose& message) {
  const Eigen::Quaterniond rotation(message.orientation.w, message.orientation.x,
                                    message.orientation.y, message.orientation.z);
  const Eigen::Vector3d position(message.position.x, message.position.y, message.position.z);
  if (!position.allFinite() || !rotation.coeffs().allFinite())
    throw std::invalid_argument("pose: holds numbers that are not finite");
  if (!(rotation.norm() > 1e-3))
    throw std::invalid_argument("pose: the quaternion has length zero");
  Pose pose = Pose::Identity();
  pose.translation() = position;
  pose.linear() = rotation.normalized().toRotationMatrix();
  return pose;
}

Pose poseFrom(const geometry_msgs::TransformStamped& message) {
  geometry_msgs::Pose pose;
  pose.position.x = message.transform.translation.x;
  pose.position.y = message.transform.translation.y;
  pose.position.z = message.transform.translation.z;
  pose.orientation = message.transform.rotation;
  return poseFrom(pose);
}

Pose poseFrom(const std::string& text) {
  std::istringstream numbers(text);
  geometry_msgs::Pose message;
  auto& p = message.position;
  auto& q = message.orientation;
  std::string rest;
  if (!(numbers >> p.x >> p.y >> p.z >> q.x >> q.y >> q.z >> q.w) || numbers >> rest)
    throw std::invalid_argument("pose '" + text +
                                "': expected seven numbers, \"x y z qx qy qz qw\" [m]");
  return poseFrom(message);
}

StereoCalibration calibrationFrom(const sensor_msgs::CameraInfo* left,
                                  const sensor_msgs::CameraInfo* right) {
  const Twins twins(left, right);
  StereoCalibration calibration;
  calibration.left = calibrationOf(*twins.left, left != nullptr ? "left" : "right");
  calibration.right = calibrationOf(*twins.right, right != nullptr ? "right" : "left");
  calibration.baseline = twins.baseline();
  return calibration;
}

bool holdsFor(const LeapCalibration& message, const sensor_msgs::CameraInfo& info) {
  return message.valid != 0 && message.width == info.width && message.height == info.height;
}

StereoCalibration calibrationFrom(const LeapCalibration& message) {
  StereoCalibration calibration;
  calibration.baseline = message.baseline;
  calibration.left = calibrationOf(message.left, message, "left");
  calibration.right = calibrationOf(message.right, message, "right");
  if (!std::isfinite(message.baseline) || !(message.baseline > 1e-5))
    throw std::invalid_argument("calibration of the Leap: the baseline must be above zero");
  return calibration;
}

RectifiedStereoCamera rectifiedCameraFrom(const sensor_msgs::CameraInfo* left,
                                          const sensor_msgs::CameraInfo* right) {
  const Twins twins(left, right);
  if (twins.left->width == 0 || twins.left->height == 0)
    complain("left", "width and height are zero");
  if (twins.left->width != twins.right->width || twins.left->height != twins.right->height)
    complain("right", "its size differs from that of the left eye");
  RectifiedStereoCamera camera;
  camera.baseline = twins.baseline();
  const auto& p = twins.left->P;
  camera.focal_length = p[0];
  camera.center_u = p[2];
  camera.center_v = p[6];
  camera.size = cv::Size(static_cast<int>(twins.left->width), static_cast<int>(twins.left->height));
  const double tolerance = 1e-3 * camera.focal_length;
  const auto matches = [&](const sensor_msgs::CameraInfo& info) {
    return std::abs(info.P[0] - p[0]) <= tolerance && std::abs(info.P[5] - p[0]) <= tolerance &&
           std::abs(info.P[2] - p[2]) <= tolerance && std::abs(info.P[6] - p[6]) <= tolerance;
  };
  if (!matches(*twins.left) || !matches(*twins.right))
    complain("left or right",
             "P must have square pixels and one centre for both eyes; use RectifyNodelet");
  return camera;
}

sensor_msgs::CameraInfo messageFrom(const RectifiedStereoCamera& camera, bool right_eye) {
  const double f = camera.focal_length, u = camera.center_u, v = camera.center_v;
  sensor_msgs::CameraInfo info;
  info.width = static_cast<std::uint32_t>(camera.size.width);
  info.height = static_cast<std::uint32_t>(camera.size.height);
  info.distortion_model = sensor_msgs::distortion_models::PLUMB_BOB;
  info.D.assign(5, 0.0);
  info.K = {f, 0, u, 0, f, v, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {f, 0, u, right_eye ? -f * camera.baseline : 0.0, 0, f, v, 0, 0, 0, 1, 0};
  return info;
}

bool sameCamera(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b) {
  return a.width == b.width && a.height == b.height && a.distortion_model == b.distortion_model &&
         a.D == b.D && a.K == b.K && a.R == b.R && a.P == b.P && a.binning_x == b.binning_x &&
         a.binning_y == b.binning_y && a.roi.x_offset == b.roi.x_offset &&
         a.roi.y_offset == b.roi.y_offset && a.roi.width == b.roi.width &&
         a.roi.height == b.roi.height;
}

bool sameCamera(const RectifiedStereoCamera& a, const RectifiedStereoCamera& b) {
  return a.size == b.size && a.focal_length == b.focal_length && a.center_u == b.center_u &&
         a.center_v == b.center_v && a.baseline == b.baseline;
}

cv::Mat imageFrom(const sensor_msgs::Image& message) {
  if (message.encoding != sensor_msgs::image_encodings::MONO8 &&
      message.encoding != sensor_msgs::image_encodings::TYPE_8UC1)
    throw std::invalid_argument("image: the encoding is '" + message.encoding +
                                "'; expected mono8");
  if (message.width == 0 || message.height == 0 || message.step < message.width ||
      message.data.size() < static_cast<std::size_t>(message.step) * message.height)
    throw std::invalid_argument("image: " + std::to_string(message.data.size()) +
                                " bytes do not hold " + std::to_string(message.width) + "x" +
                                std::to_string(message.height) + " pixels");
  return cv::Mat(static_cast<int>(message.height), static_cast<int>(message.width), CV_8UC1,
                 const_cast<std::uint8_t*>(message.data.data()), message.step);
}

}  // namespace leap_object_tracker
