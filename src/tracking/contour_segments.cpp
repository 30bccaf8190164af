#include "contour_segments.hpp"

#include <algorithm>

namespace leap_object_tracker {
namespace {

/// Points at equal steps along the chain of all segments.
std::vector<ContourPoint> spread(const std::vector<ContourSegment>& segments, int count) {
  double total = 0;
  for (const auto& segment : segments) total += (segment.end - segment.start).norm();
  std::vector<ContourPoint> points;
  if (!(total > 0)) return points;
  points.reserve(static_cast<std::size_t>(count));
  const double step = total / count;
  double passed = 0;
  for (const auto& segment : segments) {
    const Eigen::Vector3d along = segment.end - segment.start;
    const double length = along.norm();
    while (static_cast<int>(points.size()) < count) {
      const double at = (static_cast<double>(points.size()) + 0.5) * step - passed;
      if (at > length) break;
      ContourPoint point;
      point.position = (segment.start + along * (at / length)).cast<float>();
      point.tangent = (along / length).cast<float>();
      point.outward = segment.outward.cast<float>();
      point.length = static_cast<float>(step);
      point.limb = static_cast<float>(segment.limb);
      point.inner = segment.inner ? 1.0F : 0.0F;
      for (std::size_t side = 0; side < 2; ++side)
        point.faces[side] = segment.faces[side].cast<float>();
      point.hidden = segment.hidden.cast<float>();
      points.push_back(point);
    }
    passed += length;
  }
  return points;
}

}  // namespace

void ContourSegment::orderFaces(const Eigen::Vector3d& into) {
  if (into.dot((end - start).cross(faces[0])) < 0) std::swap(faces[0], faces[1]);
}

void fillArrays(ContourView& view, const std::vector<ContourPoint>& scored, int points) {
  const auto n = static_cast<std::size_t>(points);
  view.arrays.assign(6 * n, 0.0F);
  for (std::size_t i = 0; i < n; ++i) {
    // Padding repeats a place with no length, so that it weighs nothing.
    const ContourPoint& point = scored[std::min(i, scored.size() - 1)];
    const float length = i < scored.size() ? point.length : 0.0F;
    // Every n/16-th point stands in one group of 16, so that any first groups are an even sample.
    const std::size_t groups = n / 16, slot = (i % groups) * 16 + i / groups;
    for (std::size_t k = 0; k < 3; ++k) {
      view.arrays[k * n + slot] = point.position[static_cast<Eigen::Index>(k)];
      view.arrays[(3 + k) * n + slot] = length * point.tangent[static_cast<Eigen::Index>(k)];
    }
  }
}

ContourView makeView(const std::vector<ContourSegment>& segments, int points) {
  ContourView view;
  view.points = spread(segments, 2 * points);
  const std::vector<ContourPoint> scored = spread(segments, points);
  if (!scored.empty()) fillArrays(view, scored, points);
  return view;
}

std::vector<EdgeAdjacency> adjacentTriangles(const Mesh& mesh) {
  struct HalfEdge {
    std::uint32_t low, high;
    std::int64_t triangle;
  };
  std::vector<HalfEdge> halves;
  halves.reserve(3 * mesh.triangles.size());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      halves.push_back({std::min(a, b), std::max(a, b), static_cast<std::int64_t>(t)});
    }
  std::sort(halves.begin(), halves.end(), [](const HalfEdge& a, const HalfEdge& b) {
    return std::tie(a.low, a.high, a.triangle) < std::tie(b.low, b.high, b.triangle);
  });
  std::vector<EdgeAdjacency> edges;
  for (std::size_t i = 0; i < halves.size();) {
    EdgeAdjacency edge{halves[i].low, halves[i].high, {halves[i].triangle, -1}};
    std::size_t next = i + 1;
    if (next < halves.size() && halves[next].low == edge.start && halves[next].high == edge.end)
      edge.triangles[1] = halves[next++].triangle;
    edges.push_back(edge);
    i = next;
  }
  return edges;
}

Eigen::Vector3d triangleNormal(const Mesh& mesh, std::size_t triangle) {
  const auto& t = mesh.triangles[triangle];
  return (mesh.vertices[t[1]] - mesh.vertices[t[0]])
      .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]])
      .normalized();
}

}  // namespace leap_object_tracker
