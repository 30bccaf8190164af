#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/tracking/contour_model.hpp"

namespace leap_object_tracker {

/// A straight piece of visible contour in the object frame [m].
struct ContourSegment {
  Eigen::Vector3d start, end;
  Eigen::Vector3d outward;  ///< as in ContourPoint
  double limb = 0;          ///< as in ContourPoint
  bool inner = false;       ///< as in ContourPoint
  /// As in ContourPoint.
  std::array<Eigen::Vector3d, 2> faces{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  Eigen::Vector3d hidden = Eigen::Vector3d::Zero();  ///< as in ContourPoint

  /// Puts the faces in their order.
  /// @param into from the segment into the first face
  void orderFaces(const Eigen::Vector3d& into);
};

/// Spreads the points of a view evenly over the length of its segments.
ContourView makeView(const std::vector<ContourSegment>& segments, int points);

/// Fills the scoring arrays of a view whose refinement points are there.
void fillArrays(ContourView& view, const std::vector<ContourPoint>& scored, int points);

/// An edge of a mesh and the triangles on both sides; -1 where there is none.
struct EdgeAdjacency {
  std::uint32_t start, end;
  std::array<std::int64_t, 2> triangles;
};
std::vector<EdgeAdjacency> adjacentTriangles(const Mesh& mesh);

/// Unit normal of a triangle.
Eigen::Vector3d triangleNormal(const Mesh& mesh, std::size_t triangle);

}  // namespace leap_object_tracker
