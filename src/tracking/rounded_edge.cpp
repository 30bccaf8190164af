#include "tracking/rounded_edge.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kFlat = 0.05;      // [rad] half the angle between normals of one surface
constexpr float kMostRounding = 4;  // radii by which a crease's image may lie off

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
