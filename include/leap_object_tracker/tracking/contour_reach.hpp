#pragma once

#include <Eigen/Dense>
#include <cstddef>

#include "leap_object_tracker/tracking/bright_regions.hpp"

namespace leap_object_tracker {

/// How far points reach in the image.
struct PointReach {
  /// Largest c x / z + s y / z by direction of BrightRegion, c and s its cosine and sine.
  BrightRegion::Extents extents;
  /// Number of the point that reaches so far.
  Eigen::Array<int, BrightRegion::kDirections, 1> farthest;
};

/// @param arrays `count` x, then y, then z [m]
/// @param count a multiple of 16
/// @param origin, rotation of the points as the eye sees them [m]
/// @param nearest [m] points closer to the plane of the eye, or behind it, count as so far before
/// it
PointReach reachOfPoints(const float* arrays, std::size_t count, const Eigen::Vector3f& origin,
                         const Eigen::Matrix3f& rotation, float nearest);

/// Length of the contour of a view inside a window of the image, over its depth.
/// @param arrays as in ContourView
/// @param stride entries of each array
/// @param count points that are looked at, a multiple of 16
/// @param window as x / z and y / z
float contourLengthInside(const float* arrays, std::size_t stride, std::size_t count,
                          const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation,
                          float nearest, const Eigen::AlignedBox2f& window);

}  // namespace leap_object_tracker
