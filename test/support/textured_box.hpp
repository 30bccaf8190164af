#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/core.hpp>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"

namespace leap_object_tracker {

/// Grey value of a spot of a painted body: blotches of two sizes, always the same.
inline double paintAt(const Eigen::Vector3d& spot) {
  const auto noise = [](int x, int y, int z) {
    std::uint32_t hash = static_cast<std::uint32_t>(x) * 73856093U ^
                         static_cast<std::uint32_t>(y) * 19349663U ^
                         static_cast<std::uint32_t>(z) * 83492791U;
    hash = (hash ^ (hash >> 13)) * 1274126177U;
    return static_cast<double>((hash ^ (hash >> 16)) & 0xFFFFU) / 65535.0;
  };
  double value = 0;
  for (const double cell : {0.0035, 0.0015}) {
    const Eigen::Vector3d place = spot / cell + Eigen::Vector3d::Constant(100.37);
    value += 0.5 * noise(static_cast<int>(place.x()), static_cast<int>(place.y()),
                         static_cast<int>(place.z()));
  }
  return 40 + 180 * value;
}

/// A painted box before a black background, as an ideal pair sees it, four samples a pixel.
inline RectifiedStereoFrame paintedBox(const Eigen::Vector3d& size, const Pose& camera_from_object,
                                       const RectifiedStereoCamera& camera) {
  const Pose object_from_camera = camera_from_object.inverse();
  RectifiedStereoFrame frame;
  for (int eye = 0; eye < 2; ++eye) {
    const Eigen::Vector3d origin =
        object_from_camera * Eigen::Vector3d(eye == 0 ? 0 : camera.baseline, 0, 0);
    cv::Mat image(camera.size, CV_8UC1, cv::Scalar(5));
    for (int v = 0; v < image.rows; ++v)
      for (int u = 0; u < image.cols; ++u) {
        double sum = 0;
        for (const double du : {-0.25, 0.25})
          for (const double dv : {-0.25, 0.25}) {
            const Eigen::Vector3d ray =
                object_from_camera.linear() *
                Eigen::Vector3d((u + du - camera.center_u) / camera.focal_length,
                                (v + dv - camera.center_v) / camera.focal_length, 1);
            const Eigen::Vector3d a = (-0.5 * size - origin).cwiseQuotient(ray);
            const Eigen::Vector3d b = (0.5 * size - origin).cwiseQuotient(ray);
            const double enter = a.cwiseMin(b).maxCoeff(), leave = a.cwiseMax(b).minCoeff();
            sum += enter > 0 && enter < leave ? paintAt(origin + enter * ray) : 5;
          }
        image.at<unsigned char>(v, u) = cv::saturate_cast<unsigned char>(sum / 4);
      }
    (eye == 0 ? frame.left : frame.right) = image;
  }
  return frame;
}

}  // namespace leap_object_tracker
