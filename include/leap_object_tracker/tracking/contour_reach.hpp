#pragma once

#include <Eigen/Dense>
#include <cstddef>

namespace leap_object_tracker {

/// How far the contour of a view reaches in the image.
struct ContourReach {
  static constexpr int kDirections = 16;  ///< 2 pi i / kDirections from +u towards +v
  /// Largest c x / z + s y / z by direction, c and s its cosine and sine.
  Eigen::Array<float, kDirections, 1> extents;
  float length = 0;  ///< of the contour inside the window, over its depth
};

/// @param arrays as in ContourView
/// @param stride entries of each array
/// @param count points that are looked at, a multiple of 16
/// @param origin, rotation of the view as the eye sees it [m]
/// @param nearest [m] points closer to the plane of the eye, or behind it, count as so far before
/// it
/// @param window of the image, as x / z and y / z
ContourReach reachOfContour(const float* arrays, std::size_t stride, std::size_t count,
                            const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation,
                            float nearest, const Eigen::AlignedBox2f& window);

}  // namespace leap_object_tracker
