#include "body_surface.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "rounded_body.hpp"

namespace leap_object_tracker {

BodySurface::BodySurface(const Mesh& mesh, double edge_radius)
    : edge_radius_(static_cast<float>(edge_radius)) {
  const auto rounded = edge_radius > 0 ? roundEdges(mesh, edge_radius) : std::nullopt;
  const Mesh& shape = rounded ? rounded->mesh : mesh;
  triangles_ = shape.triangles;
  for (const auto& vertex : shape.vertices) {
    vertices_.push_back(vertex.cast<float>());
    radius_ = std::max(radius_, vertices_.back().norm());
  }
  if (rounded) {
    for (const auto& t : triangles_)
      corner_normals_.push_back({rounded->normals[t[0]].cast<float>(),
                                 rounded->normals[t[1]].cast<float>(),
                                 rounded->normals[t[2]].cast<float>()});
    return;
  }
  for (const auto& corners : cornerNormals(mesh))
    corner_normals_.push_back(
        {corners[0].cast<float>(), corners[1].cast<float>(), corners[2].cast<float>()});
  if (edge_radius_ > 0) findCreases();
}

Eigen::Vector3f BodySurface::point(std::uint32_t triangle, float u, float v) const {
  const auto& t = triangles_[triangle];
  return (1 - u - v) * vertices_[t[0]] + u * vertices_[t[1]] + v * vertices_[t[2]];
}

Eigen::Vector3f BodySurface::normal(std::uint32_t triangle, float u, float v) const {
  const auto& corners = corner_normals_[triangle];
  Eigen::Vector3f normal =
      ((1 - u - v) * corners[0] + u * corners[1] + v * corners[2]).normalized();
  if (creases_.empty()) return normal;
  const Eigen::Vector3f at = point(triangle, u, v);
  for (const Crease& crease : creases_[triangle]) {
    const float along = std::clamp((at - crease.start).dot(crease.direction), 0.0F, crease.length);
    const float distance = (at - crease.start - along * crease.direction).norm();
    if (distance >= edge_radius_) continue;
    const float share = distance / edge_radius_;
    normal = (share * normal + (1 - share) * crease.normal).normalized();
  }
  return normal;
}

void BodySurface::findCreases() {
  std::vector<Eigen::Vector3f> face_normals;
  for (const auto& t : triangles_)
    face_normals.push_back(
        (vertices_[t[1]] - vertices_[t[0]]).cross(vertices_[t[2]] - vertices_[t[0]]).normalized());
  std::map<std::pair<std::uint32_t, std::uint32_t>, std::vector<std::uint32_t>> faces_of_edge;
  for (std::uint32_t i = 0; i < triangles_.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) {
      const auto ends = std::minmax(triangles_[i][k], triangles_[i][(k + 1) % 3]);
      faces_of_edge[{ends.first, ends.second}].push_back(i);
    }

  // A crease rounds its own two triangles and those that continue them smoothly.
  std::vector<std::vector<Crease>> own(triangles_.size());
  std::vector<std::vector<std::uint32_t>> continued(triangles_.size());
  for (const auto& edge : faces_of_edge) {
    if (edge.second.size() != 2) continue;
    const auto a = edge.second[0], b = edge.second[1];
    if (smoothlyJoined(face_normals[a].cast<double>(), face_normals[b].cast<double>())) {
      continued[a].push_back(b);
      continued[b].push_back(a);
      continue;
    }
    const Eigen::Vector3f start = vertices_[edge.first.first];
    const Eigen::Vector3f span = vertices_[edge.first.second] - start;
    const Crease crease{start, span.normalized(), span.norm(),
                        (face_normals[a] + face_normals[b] + 1e-4F * face_normals[a]).normalized()};
    own[a].push_back(crease);
    own[b].push_back(crease);
  }
  creases_ = own;
  for (std::uint32_t i = 0; i < triangles_.size(); ++i)
    for (const auto other : continued[i])
      creases_[i].insert(creases_[i].end(), own[other].begin(), own[other].end());
}

}  // namespace leap_object_tracker
