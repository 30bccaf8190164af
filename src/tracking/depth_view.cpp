#include "depth_view.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr float kNearest = 0.01F;  // [m] of a vertex that is drawn

}  // namespace

void placeBody(const std::vector<Eigen::Vector3f>& vertices,
               const std::vector<std::array<std::uint32_t, 3>>& triangles,
               const Pose& camera_from_object, PlacedBody& body) {
  const Eigen::Matrix3f rotation = camera_from_object.linear().cast<float>();
  const Eigen::Vector3f origin = camera_from_object.translation().cast<float>();
  body.points.clear();
  body.points.reserve(vertices.size());
  for (const Eigen::Vector3f& vertex : vertices)
    body.points.emplace_back(rotation * vertex + origin);
  body.normals.clear();
  body.normals.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles)
    body.normals.emplace_back(
        (body.points[b] - body.points[a]).cross(body.points[c] - body.points[a]).normalized());
}

void drawDepths(const std::vector<Eigen::Vector3f>& points,
                const std::vector<std::array<std::uint32_t, 3>>& triangles,
                const RectifiedStereoCamera& camera, float eye_x, const cv::Rect& limits,
                float scale, DepthView& seen) {
  seen.scale = scale;
  thread_local std::vector<Eigen::Vector3f> image;  // u, v [px], 1/z [1/m]
  image.clear();
  const auto focal = static_cast<float>(camera.focal_length);
  Eigen::Array2f low = Eigen::Array2f::Constant(1e9F), high = -low;
  for (const Eigen::Vector3f& point : points) {
    if (point.z() < kNearest) {
      image.emplace_back(Eigen::Vector3f::Zero());
      continue;
    }
    const float near = 1 / point.z();
    image.emplace_back(
        scale * (static_cast<float>(camera.center_u) + focal * (point.x() - eye_x) * near),
        scale * (static_cast<float>(camera.center_v) + focal * point.y() * near), near);
    low = low.min(image.back().head<2>().array());
    high = high.max(image.back().head<2>().array());
  }
  const auto bounded = [](float value) { return static_cast<int>(std::clamp(value, -1e4F, 1e4F)); };
  seen.box = cv::Rect(cv::Point(bounded(low.x()) - 2, bounded(low.y()) - 2),
                      cv::Point(bounded(high.x()) + 3, bounded(high.y()) + 3)) &
             limits;
  const auto size = static_cast<std::size_t>(std::max(0, seen.box.area()));
  seen.nearness_memory.assign(size, 0);
  seen.triangle_memory.resize(size);
  seen.nearness = cv::Mat(seen.box.size(), CV_32FC1, seen.nearness_memory.data());
  seen.triangle = cv::Mat(seen.box.size(), CV_32SC1, seen.triangle_memory.data());
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const Eigen::Vector3f &a = image[triangles[t][0]], &b = image[triangles[t][1]],
                          &c = image[triangles[t][2]];
    if (a.z() <= 0 || b.z() <= 0 || c.z() <= 0) continue;
    const Eigen::Vector2f ab = (b - a).head<2>(), ac = (c - a).head<2>();
    const float area = ab.x() * ac.y() - ab.y() * ac.x();
    if (area >= -1e-6F) continue;  // counter-clockwise from outside: seen from behind
    // Shares of the corners b and c, linear in the image.
    const float second_u = ac.y() / area, second_v = -ac.x() / area;
    const float third_u = -ab.y() / area, third_v = ab.x() / area;
    const float slope_b = b.z() - a.z(), slope_c = c.z() - a.z();
    const auto [least_u, most_u] = std::minmax({a.x(), b.x(), c.x()});
    const auto [least_v, most_v] = std::minmax({a.y(), b.y(), c.y()});
    const int first_u = std::max(seen.box.x, bounded(std::ceil(least_u)));
    const int last_u = std::min(seen.box.x + seen.box.width - 1, bounded(std::floor(most_u)));
    const int first_v = std::max(seen.box.y, bounded(std::ceil(least_v)));
    const int last_v = std::min(seen.box.y + seen.box.height - 1, bounded(std::floor(most_v)));
    for (int v = first_v; v <= last_v; ++v) {
      auto* nearness = seen.nearness.ptr<float>(v - seen.box.y);
      auto* triangle = seen.triangle.ptr<int>(v - seen.box.y);
      for (int u = first_u; u <= last_u; ++u) {
        const float du = static_cast<float>(u) - a.x(), dv = static_cast<float>(v) - a.y();
        const float second = du * second_u + dv * second_v, third = du * third_u + dv * third_v;
        constexpr float kSlack = -1e-3F;
        if (second < kSlack || third < kSlack || 1 - second - third < kSlack) continue;
        const float near = a.z() + second * slope_b + third * slope_c;
        if (near <= nearness[u - seen.box.x]) continue;
        nearness[u - seen.box.x] = near;
        triangle[u - seen.box.x] = static_cast<int>(t);
      }
    }
  }
}

Eigen::Vector3f placeSeen(const DepthView& seen, const RectifiedStereoCamera& camera, float eye_x,
                          int u, int v) {
  const float depth = 1 / seen.nearness.at<float>(v, u);
  const auto focal = static_cast<float>(camera.focal_length);
  return {
      eye_x + (static_cast<float>(u + seen.box.x) - static_cast<float>(camera.center_u)) * depth /
                  focal,
      (static_cast<float>(v + seen.box.y) - static_cast<float>(camera.center_v)) * depth / focal,
      depth};
}

}  // namespace leap_object_tracker
