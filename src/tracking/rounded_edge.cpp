#include "tracking/rounded_edge.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kFlat = 0.05;      // [rad] half the angle between normals of one surface
constexpr float kMostRounding = 4;  // radii by which a crease's image may lie off
constexpr float kLeastLit = 0.15F;  // of the light, on a face that is hardly lit

/// Radii by which the outline of a rounded edge lies inside of the sharp one, along the bisector.
double insideShare(double half_angle) {
  return (std::tan(half_angle) - half_angle) / std::sin(half_angle);
}

}  // namespace

Eigen::Vector3d roundedOutlineShift(const Eigen::Vector3d& normal_a,
                                    const Eigen::Vector3d& normal_b, double radius) {
  const double half = 0.5 * std::acos(std::clamp(normal_a.dot(normal_b), -1.0, 1.0));
  if (half < kFlat) return Eigen::Vector3d::Zero();
  return -(normal_a + normal_b).normalized() * (radius * insideShare(half));
}

Eigen::Vector3f roundedOutlineShown(const Eigen::Vector3f& seen, const Eigen::Vector3f& hidden,
                                    const Eigen::Vector3f& tangent, const Eigen::Vector3f& to_eye,
                                    const Eigen::Vector3f& light, float radius) {
  const float cosine = seen.dot(hidden);
  const float half = 0.5F * std::acos(std::clamp(cosine, -1.0F, 1.0F));
  if (half < static_cast<float>(kFlat)) return Eigen::Vector3f::Zero();
  const Eigen::Vector3f sight = (to_eye - tangent.dot(to_eye) * tangent).normalized();
  Eigen::Vector3f end = tangent.cross(sight);
  if (end.dot(hidden - cosine * seen) < 0) end = -end;
  const float sin_a = std::max(0.0F, seen.dot(sight)), cos_a = seen.dot(end);
  const float a = std::atan2(sin_a, cos_a);
  const float cos_l = light.dot(end), sin_l = light.dot(sight);  // times the light
  const float brightness =
      std::max(cos_a * cos_l + sin_a * sin_l, kLeastLit * std::hypot(cos_l, sin_l));
  const float left = 0.25F * (cos_l - (cos_a * cos_a - sin_a * sin_a) * cos_l -
                              2 * sin_a * cos_a * sin_l + 2 * a * sin_l);
  const float dark =
      brightness > 0 ? std::clamp(1 - cos_a - left / brightness, -1 + cos_a, 1 - cos_a) : 0;
  const float middle = (seen + hidden).dot(end);
  const float average =
      static_cast<float>(insideShare(static_cast<double>(half))) * middle / (2 * std::cos(half));
  const float inside = middle / (1 + cosine) - 1 + dark;
  return radius * (average - inside) * end;
}

Eigen::Vector3f roundedCreaseShift(const Eigen::Vector3f& normal_a, const Eigen::Vector3f& normal_b,
                                   const Eigen::Vector3f& tangent, const Eigen::Vector3f& to_light,
                                   float radius) {
  const float half = 0.5F * std::acos(std::clamp(normal_a.dot(normal_b), -1.0F, 1.0F));
  if (half < static_cast<float>(kFlat)) return Eigen::Vector3f::Zero();
  Eigen::Vector3f across = tangent.cross(to_light).normalized();
  if (across.dot(normal_b - normal_a) < 0) across = -across;
  const Eigen::Vector3f light = (to_light - tangent.dot(to_light) * tangent).normalized();
  const float sin_a = across.dot(normal_a), cos_a = light.dot(normal_a);
  const float sin_b = across.dot(normal_b), cos_b = light.dot(normal_b);
  const float from_centre =
      1 / std::cos(half) - static_cast<float>(insideShare(static_cast<double>(half)));
  const float line = from_centre * (sin_a + sin_b) / (2 * std::cos(half));
  const float step = cos_a - cos_b;
  const float excess = half + 0.5F * (sin_a * cos_a - sin_b * cos_b) - line * step;
  const float least = excess / kMostRounding;
  return radius * excess * step / std::max(step * step, least * least) * across;
}

}  // namespace leap_object_tracker
