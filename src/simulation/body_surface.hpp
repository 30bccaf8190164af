#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"

namespace leap_object_tracker {

/// What the renderer needs to know of a mesh: its triangles with rounded edges, smooth normals on
/// round parts. Of bodies that roundEdges() does not know the edges are rounded in shading only.
class BodySurface {
 public:
  /// @param edge_radius [m] of the rounding
  BodySurface(const Mesh& mesh, double edge_radius);

  Eigen::Vector3f point(std::uint32_t triangle, float u, float v) const;
  /// Unit normal in the body frame.
  Eigen::Vector3f normal(std::uint32_t triangle, float u, float v) const;

  const std::vector<Eigen::Vector3f>& vertices() const { return vertices_; }
  const std::vector<std::array<std::uint32_t, 3>>& triangles() const { return triangles_; }
  /// Largest distance of a vertex from the origin [m].
  float radius() const { return radius_; }

 private:
  /// A sharp edge close to a triangle, and the normal that its rounding has in the middle.
  struct Crease {
    Eigen::Vector3f start, direction;
    float length;
    Eigen::Vector3f normal;
  };

  void findCreases();

  std::vector<Eigen::Vector3f> vertices_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::vector<std::array<Eigen::Vector3f, 3>> corner_normals_;
  std::vector<std::vector<Crease>> creases_;  ///< one list a triangle
  float edge_radius_;
  float radius_ = 0;
};

}  // namespace leap_object_tracker
