#pragma once

#include <Eigen/Dense>
#include <cstddef>

namespace leap_object_tracker {

/// How far the contour of a view reaches in the image.
struct ContourReach {
  static constexpr int kDirections = 16;  ///< 2 pi i / kDirections from +u towards +v
  /// Largest c x / z + s y / z by direction, c and s its cosine and sine.
  Eigen::Array<float, kDirections, 1> extents;
  float length = 0;      ///< of the contour over its depth
  bool in_front = true;  ///< all of it is at least `nearest` before the eye
};

/// @param arrays as in ContourView
/// @param stride entries of each array
/// @param count points that are looked at, a multiple of 16
/// @param origin, rotation of the view as the eye sees it [m]
/// @param nearest [m]
ContourReach reachOfContour(const float* arrays, std::size_t stride, std::size_t count,
                            const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation,
                            float nearest);

}  // namespace leap_object_tracker
