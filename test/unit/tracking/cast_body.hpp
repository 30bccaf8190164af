#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"

namespace leap_object_tracker {

inline constexpr double kLamps[] = {-0.015, 0.02, 0.055};  // [m] along the baseline

struct Hit {
  double distance = std::numeric_limits<double>::infinity();
  Eigen::Vector3d normal = Eigen::Vector3d::Zero();
};

/// Nearest triangle along a ray (Moller and Trumbore 1997).
inline Hit cast(const std::vector<std::array<Eigen::Vector3d, 3>>& triangles,
                const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  Hit hit;
  for (const auto& [a, b, c] : triangles) {
    const Eigen::Vector3d ab = b - a, ac = c - a, p = direction.cross(ac);
    const double scale = ab.dot(p);
    if (std::abs(scale) < 1e-15) continue;
    const Eigen::Vector3d to = from - a;
    const double u = to.dot(p) / scale, v = direction.dot(to.cross(ab)) / scale;
    const double distance = ac.dot(to.cross(ab)) / scale;
    if (u < 0 || v < 0 || u + v > 1 || distance < 1e-6 || distance >= hit.distance) continue;
    hit = {distance, ab.cross(ac).normalized()};
  }
  return hit;
}

struct Look {
  bool shadows = true;
  double scale = 0.6;  ///< grey levels of a white surface square to a lamp, times metres squared
  double checks = 0;   ///< [m] of squares, every other one darker; 0: plain
  int in_eyes = 2;
  int rays = 1;  ///< along each side of a pixel
};

/// What a ray of an eye meets of a matt body at a pose, lit by three lamps [grey levels].
inline double castLight(const std::vector<std::array<Eigen::Vector3d, 3>>& triangles,
                        const Pose& pose, const Eigen::Vector3d& origin, const Eigen::Vector3d& ray,
                        const Look& look) {
  const Hit hit = cast(triangles, origin, ray);
  if (std::isinf(hit.distance)) return 0;
  const Eigen::Vector3d at = origin + hit.distance * ray;
  double light = 0;
  for (const double lamp : kLamps) {
    const Eigen::Vector3d to = Eigen::Vector3d(lamp, 0, 0) - at;
    const double cosine = hit.normal.dot(to.normalized());
    if (cosine <= 0) continue;
    if (look.shadows && cast(triangles, at + 1e-5 * hit.normal, to).distance < 1) continue;
    light += look.scale * cosine / to.squaredNorm();
  }
  if (look.checks > 0) {
    const Eigen::Vector3d own = pose.inverse() * at / look.checks;
    const auto cell = [](double x) { return static_cast<int>(std::floor(x + 0.01)); };
    if (((cell(own.x()) + cell(own.y()) + cell(own.z())) & 1) != 0) light *= 0.25;
  }
  return light;
}

/// A picture of the body, by ray casting; what lies outside the middle of the image stays dark.
inline RectifiedStereoFrame castFrame(const Mesh& mesh, const Pose& pose,
                                      const RectifiedStereoCamera& camera, const Look& look = {}) {
  std::vector<std::array<Eigen::Vector3d, 3>> triangles;
  for (const auto& t : mesh.triangles)
    triangles.push_back(
        {pose * mesh.vertices[t[0]], pose * mesh.vertices[t[1]], pose * mesh.vertices[t[2]]});
  RectifiedStereoFrame frame;
  frame.stamp = stampFromSeconds(1);
  for (int eye = 0; eye < look.in_eyes; ++eye) {
    cv::Mat& image = eye == 0 ? frame.left : frame.right;
    image = cv::Mat(camera.size, CV_8UC1, cv::Scalar(4));
    const Eigen::Vector3d origin(eye * camera.baseline, 0, 0);
    for (int v = 160; v < 320; ++v)
      for (int u = 220; u < 420; ++u) {
        double light = 0;
        for (int part = 0; part < look.rays * look.rays; ++part) {
          const double du = (part % look.rays + 0.5) / look.rays - 0.5;
          const double dv = (part / look.rays + 0.5) / look.rays - 0.5;
          const Eigen::Vector3d ray((u + du - camera.center_u) / camera.focal_length,
                                    (v + dv - camera.center_v) / camera.focal_length, 1);
          light += castLight(triangles, pose, origin, ray, look);
        }
        light /= look.rays * look.rays;
        image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(std::min(255.0, 4 + light));
      }
    cv::GaussianBlur(image, image, cv::Size(7, 7), 0.78, 1.08);
  }
  return frame;
}

}  // namespace leap_object_tracker
