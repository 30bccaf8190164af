#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"

namespace leap_object_tracker {

/// Normals of a mesh at the corners of each triangle: faces less than 35 deg apart are one round
/// surface.
std::vector<std::array<Eigen::Vector3d, 3>> cornerNormals(const Mesh& mesh);
/// Whether faces with these normals are one round surface.
bool smoothlyJoined(const Eigen::Vector3d& normal_a, const Eigen::Vector3d& normal_b);

/// A body whose edges and corners are pieces of cylinders and spheres.
struct RoundedBody {
  Mesh mesh;
  std::vector<Eigen::Vector3d> normals;  ///< unit, one a vertex
};

/// Rounds the edges of a convex body, of whose surfaces at most three meet in a corner: all that a
/// ball of this radius reaches while it stays inside (morphological opening).
/// @param radius [m] of the rounding
/// @return nothing for other bodies, and for those too small for it
std::optional<RoundedBody> roundEdges(const Mesh& mesh, double radius);

}  // namespace leap_object_tracker
