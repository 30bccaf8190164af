#include "leap_object_tracker/rectification/stereo_rectifier.hpp"

#include <tbb/parallel_for.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

namespace leap_object_tracker {
namespace {

constexpr int kLargestSide = 4096;

/// The image as the table wants it. @throw std::invalid_argument
cv::Mat checked(const cv::Mat& raw, const cv::Size& expected) {
  if (raw.empty()) return {};
  if (raw.type() != CV_8UC1 || raw.size() != expected)
    throw std::invalid_argument(
        "rectify: the image is " + std::to_string(raw.cols) + "x" + std::to_string(raw.rows) +
        (raw.type() == CV_8UC1 ? "" : ", not 8-bit grey") + "; the calibration is for " +
        std::to_string(expected.width) + "x" + std::to_string(expected.height) + " 8-bit grey");
  return raw.isContinuous() ? raw : raw.clone();
}

}  // namespace

RectifiedStereoCamera rectifiedCamera(const StereoCalibration& calibration,
                                      const RectificationParams& params) {
  const CameraCalibration& raw = calibration.left;
  if (raw.size.area() <= 0 || calibration.right.size != raw.size)
    throw std::invalid_argument("calibration: image sizes are zero or differ between the eyes");
  if (!(raw.fx > 0) || !(raw.fy > 0) || !(calibration.right.fx > 0) || !(calibration.right.fy > 0))
    throw std::invalid_argument("calibration: focal lengths must be above zero (uncalibrated?)");
  if (!(calibration.baseline > 0))
    throw std::invalid_argument(
        "calibration: the baseline must be above zero (P[3] = -fx * baseline of the right eye)");
  if (params.width < 0 || params.height < 0 || params.width > kLargestSide ||
      params.height > kLargestSide || params.focal_length < 0 || params.horizontal_fov_deg < 0 ||
      params.horizontal_fov_deg >= 175)
    throw std::invalid_argument(
        "rectification: width and height must be 0 to 4096, focal_length at least 0, "
        "horizontal_fov_deg 0 to 175");

  RectifiedStereoCamera camera;
  camera.baseline = calibration.baseline;
  camera.size.width = params.width > 0 ? params.width : raw.size.width;
  // Rows may be binned: square pixels need as many times more of them.
  camera.size.height =
      params.height > 0
          ? params.height
          : static_cast<int>(std::lround(raw.size.height * std::max(1.0, raw.fx / raw.fy)));
  camera.focal_length =
      params.horizontal_fov_deg > 0
          ? camera.size.width / (2 * std::tan(params.horizontal_fov_deg * M_PI / 360))
      : params.focal_length > 0 ? params.focal_length
                                : std::max(raw.fx, raw.fy) * camera.size.width / raw.size.width;
  camera.center_u = (camera.size.width - 1) / 2.0;
  camera.center_v = (camera.size.height - 1) / 2.0;
  return camera;
}

StereoRectifier::StereoRectifier(const StereoCalibration& calibration,
                                 const RectifiedStereoCamera& target)
    : target_(target),
      left_(makeTable(calibration.left, target)),
      right_(makeTable(calibration.right, target)) {}

RemapTable StereoRectifier::makeTable(const CameraCalibration& raw,
                                      const RectifiedStereoCamera& target) {
  constexpr float kUnseen = std::numeric_limits<float>::quiet_NaN();
  cv::Mat map_u(target.size, CV_32FC1), map_v(target.size, CV_32FC1);
  for (int v = 0; v < target.size.height; ++v)
    for (int u = 0; u < target.size.width; ++u) {
      const Eigen::Vector3d rectified((u - target.center_u) / target.focal_length,
                                      (v - target.center_v) / target.focal_length, 1);
      const Eigen::Vector3d ray = raw.rectified_from_raw.transpose() * rectified;
      Eigen::Vector2f pixel(kUnseen, kUnseen);
      if (ray.z() > 1e-3) pixel = pixelFromRay(raw, ray.hnormalized()).cast<float>();
      map_u.at<float>(v, u) = pixel.x();
      map_v.at<float>(v, u) = pixel.y();
    }
  return RemapTable(map_u, map_v, raw.size);
}

RectifiedStereoFrame StereoRectifier::rectify(const RawStereoFrame& frame) const {
  RectifiedStereoFrame rectified;
  rectify(frame, rectified);
  return rectified;
}

void StereoRectifier::rectify(const RawStereoFrame& frame, RectifiedStereoFrame& rectified) const {
  constexpr int kStripes = 4;  // of an eye
  const cv::Mat left = checked(frame.left, left_.sourceSize());
  const cv::Mat right = checked(frame.right, right_.sourceSize());
  rectified.stamp = frame.stamp;
  for (const auto& eye : {std::make_pair(&left, &rectified.left), {&right, &rectified.right}})
    if (eye.first->empty())
      eye.second->release();
    else
      eye.second->create(target_.size, CV_8UC1);
  tbb::parallel_for(0, 2 * kStripes, [&](int stripe) {
    const bool is_left = stripe < kStripes;
    const cv::Mat& raw = is_left ? left : right;
    if (raw.empty()) return;
    const int part = stripe % kStripes, rows = target_.size.height;
    (is_left ? left_ : right_)
        .fillRows(raw, is_left ? rectified.left : rectified.right, rows * part / kStripes,
                  rows * (part + 1) / kStripes);
  });
}

}  // namespace leap_object_tracker
