#include "body_surface.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace leap_object_tracker {
namespace {

constexpr float kSmoothCosine = 0.82F;  // faces closer than 35 deg belong to one round surface

}  // namespace

BodySurface::BodySurface(const Mesh& mesh, double edge_radius)
    : triangles_(mesh.triangles), edge_radius_(static_cast<float>(edge_radius)) {
  for (const auto& vertex : mesh.vertices) {
    vertices_.push_back(vertex.cast<float>());
    radius_ = std::max(radius_, vertices_.back().norm());
  }
  findNormals();
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

void BodySurface::findNormals() {
  std::vector<std::vector<std::uint32_t>> faces_of(vertices_.size());
  std::vector<Eigen::Vector3f> weighted;  // length: twice the area
  for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
    const auto& t = triangles_[i];
    weighted.push_back(
        (vertices_[t[1]] - vertices_[t[0]]).cross(vertices_[t[2]] - vertices_[t[0]]));
    face_normals_.push_back(weighted.back().normalized());
    for (const auto vertex : t) faces_of[vertex].push_back(i);
  }
  for (std::uint32_t i = 0; i < triangles_.size(); ++i) {
    corner_normals_.emplace_back();
    for (std::size_t corner = 0; corner < 3; ++corner) {
      Eigen::Vector3f sum = Eigen::Vector3f::Zero();
      for (const auto face : faces_of[triangles_[i][corner]])
        if (face_normals_[face].dot(face_normals_[i]) > kSmoothCosine) sum += weighted[face];
      corner_normals_.back()[corner] = sum.normalized();
    }
  }
}

void BodySurface::findCreases() {
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
    if (face_normals_[a].dot(face_normals_[b]) > kSmoothCosine) {
      continued[a].push_back(b);
      continued[b].push_back(a);
      continue;
    }
    const Eigen::Vector3f start = vertices_[edge.first.first];
    const Eigen::Vector3f span = vertices_[edge.first.second] - start;
    const Crease crease{
        start, span.normalized(), span.norm(),
        (face_normals_[a] + face_normals_[b] + 1e-4F * face_normals_[a]).normalized()};
    own[a].push_back(crease);
    own[b].push_back(crease);
  }
  creases_ = own;
  for (std::uint32_t i = 0; i < triangles_.size(); ++i)
    for (const auto other : continued[i])
      creases_[i].insert(creases_[i].end(), own[other].begin(), own[other].end());
}

}  // namespace leap_object_tracker
