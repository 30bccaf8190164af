#include "leap_object_tracker/geometry/signed_distance.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>

namespace leap_object_tracker {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr int kMarginCells = 6;         // around a mesh; farther away the distance is extrapolated
constexpr int kBandCells = 2;           // around each triangle where its distance is computed
constexpr float kGradientStep = 5e-5F;  // [m]

/// Of a prism: distance across the axis `planar`, along it `axial`, both negative inside.
float ofExtrusion(float planar, float axial) {
  const float outside = std::hypot(std::max(planar, 0.0F), std::max(axial, 0.0F));
  return outside + std::min(std::max(planar, axial), 0.0F);
}

float boxDistance(const Vector3f& point, const Vector3f& half) {
  const Vector3f q = point.cwiseAbs() - half;
  return q.cwiseMax(0.0F).norm() + std::min(q.maxCoeff(), 0.0F);
}

/// Equilateral triangle about the origin with an apex towards +y: folded into one sixth.
float triangleDistance(Vector2f p, float side) {
  const float inner = side / (2 * std::sqrt(3.0F));  // [m] radius of the inscribed circle
  p.x() = std::abs(p.x());
  // The two sides at the apex have this outward normal after folding.
  const Vector2f normal(std::sqrt(3.0F) / 2, 0.5F);
  const float to_slope = p.dot(normal) - inner;
  const float to_base = -p.y() - inner;
  const float inside = std::max(to_slope, to_base);
  if (inside <= 0) return inside;
  // Nearest point on the slope or on the base, both bounded by the corners.
  const Vector2f apex(0, 2 * inner), corner(side / 2, -inner);
  const auto toSegment = [&p](const Vector2f& a, const Vector2f& b) {
    const Vector2f along = b - a;
    const float share = std::clamp((p - a).dot(along) / along.squaredNorm(), 0.0F, 1.0F);
    return (p - a - share * along).norm();
  };
  return std::min(toSegment(apex, corner), toSegment(Vector2f(0, -inner), corner));
}

/// Ericson 2005, Real-Time Collision Detection, section 5.1.5.
Vector3f nearestOnTriangle(const Vector3f& p, const Vector3f& a, const Vector3f& b,
                           const Vector3f& c) {
  const Vector3f ab = b - a, ac = c - a, ap = p - a;
  const float d1 = ab.dot(ap), d2 = ac.dot(ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vector3f bp = p - b;
  const float d3 = ab.dot(bp), d4 = ac.dot(bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const float vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return a + d1 / (d1 - d3) * ab;
  const Vector3f cp = p - c;
  const float d5 = ab.dot(cp), d6 = ac.dot(cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const float vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return a + d2 / (d2 - d6) * ac;
  const float va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 - d3 >= 0 && d5 - d6 >= 0)
    return b + (d4 - d3) / ((d4 - d3) + (d5 - d6)) * (c - b);
  const float sum = va + vb + vc;
  return a + vb / sum * ab + vc / sum * ac;
}

/// Nodes of a grid over a mesh, each with the triangle nearest to it.
class DistanceGrid {
 public:
  DistanceGrid(const Mesh& mesh, const Vector3f& origin, float cell,
               const std::array<int, 3>& nodes)
      : mesh_(mesh), origin_(origin), cell_(cell), nodes_(nodes) {
    const auto count = static_cast<std::size_t>(nodes[0]) * static_cast<std::size_t>(nodes[1]) *
                       static_cast<std::size_t>(nodes[2]);
    distance_.assign(count, std::numeric_limits<float>::infinity());
    nearest_.assign(count, -1);
    for (const auto& vertex : mesh.vertices) vertices_.push_back(vertex.cast<float>());
  }

  std::vector<float> signedDistances() {
    fillBand();
    for (int pass = 0; pass < 2; ++pass) {
      sweep(1);
      sweep(-1);
    }
    sign();
    return distance_;
  }

 private:
  std::size_t index(int x, int y, int z) const {
    return (static_cast<std::size_t>(z) * static_cast<std::size_t>(nodes_[1]) +
            static_cast<std::size_t>(y)) *
               static_cast<std::size_t>(nodes_[0]) +
           static_cast<std::size_t>(x);
  }
  Vector3f place(int x, int y, int z) const {
    return origin_ +
           cell_ * Vector3f(static_cast<float>(x), static_cast<float>(y), static_cast<float>(z));
  }
  const Vector3f& corner(int triangle, std::size_t i) const {
    return vertices_[mesh_.triangles[static_cast<std::size_t>(triangle)][i]];
  }

  void offer(int x, int y, int z, int triangle) {
    const Vector3f point = place(x, y, z);
    const float distance = (point - nearestOnTriangle(point, corner(triangle, 0),
                                                      corner(triangle, 1), corner(triangle, 2)))
                               .norm();
    const std::size_t node = index(x, y, z);
    if (distance >= distance_[node]) return;
    distance_[node] = distance;
    nearest_[node] = triangle;
  }

  void fillBand() {
    for (int t = 0; t < static_cast<int>(mesh_.triangles.size()); ++t) {
      const Vector3f low = corner(t, 0).cwiseMin(corner(t, 1)).cwiseMin(corner(t, 2));
      const Vector3f high = corner(t, 0).cwiseMax(corner(t, 1)).cwiseMax(corner(t, 2));
      std::array<int, 3> first{}, last{};
      for (int axis = 0; axis < 3; ++axis) {
        const auto a = static_cast<std::size_t>(axis);
        first[a] = std::max(
            0, static_cast<int>(std::floor((low[axis] - origin_[axis]) / cell_)) - kBandCells);
        last[a] = std::min(
            nodes_[a] - 1,
            static_cast<int>(std::ceil((high[axis] - origin_[axis]) / cell_)) + kBandCells);
      }
      for (int z = first[2]; z <= last[2]; ++z)
        for (int y = first[1]; y <= last[1]; ++y)
          for (int x = first[0]; x <= last[0]; ++x) offer(x, y, z, t);
    }
  }

  /// Hands the nearest triangle on to neighbours, forwards or backwards (Danielsson 1980).
  void sweep(int step) {
    const auto start = [&](std::size_t axis) { return step > 0 ? 0 : nodes_[axis] - 1; };
    const auto more = [&](std::size_t axis, int i) { return i >= 0 && i < nodes_[axis]; };
    for (int z = start(2); more(2, z); z += step)
      for (int y = start(1); more(1, y); y += step)
        for (int x = start(0); more(0, x); x += step) {
          if (more(0, x - step)) inherit(x, y, z, index(x - step, y, z));
          if (more(1, y - step)) inherit(x, y, z, index(x, y - step, z));
          if (more(2, z - step)) inherit(x, y, z, index(x, y, z - step));
        }
  }

  void inherit(int x, int y, int z, std::size_t from) {
    const int triangle = nearest_[from];
    if (triangle >= 0 && triangle != nearest_[index(x, y, z)]) offer(x, y, z, triangle);
  }

  /// Inside is where rays along most of the three axes cross the surface an odd number of times.
  void sign() {
    std::vector<std::uint8_t> votes(distance_.size(), 0);
    for (std::size_t axis = 0; axis < 3; ++axis) voteAlong(axis, votes);
    for (std::size_t i = 0; i < votes.size(); ++i)
      if (votes[i] >= 2) distance_[i] = -distance_[i];
  }

  void voteAlong(std::size_t axis, std::vector<std::uint8_t>& votes) {
    const std::size_t b = (axis + 1) % 3, c = (axis + 2) % 3;
    // A little beside the nodes, so that no ray runs along an edge of a body aligned with the grid.
    constexpr float kBesideB = 0.0137F, kBesideC = 0.0071F;  // [cells]
    std::vector<std::vector<float>> crossings(static_cast<std::size_t>(nodes_[b]) *
                                              static_cast<std::size_t>(nodes_[c]));
    const auto toCells = [&](const Vector3f& point, std::size_t along) {
      return (point[static_cast<int>(along)] - origin_[static_cast<int>(along)]) / cell_;
    };
    for (int t = 0; t < static_cast<int>(mesh_.triangles.size()); ++t) {
      std::array<Vector3f, 3> p;  // (b, c, axis) in cells
      for (std::size_t i = 0; i < 3; ++i)
        p[i] = Vector3f(toCells(corner(t, i), b) - kBesideB, toCells(corner(t, i), c) - kBesideC,
                        toCells(corner(t, i), axis));
      const Vector2f first = p[1].head<2>() - p[0].head<2>();
      const Vector2f second = p[2].head<2>() - p[0].head<2>();
      const float area = first.x() * second.y() - first.y() * second.x();
      if (area == 0) continue;
      const Vector3f low = p[0].cwiseMin(p[1]).cwiseMin(p[2]);
      const Vector3f high = p[0].cwiseMax(p[1]).cwiseMax(p[2]);
      for (int j = std::max(0, static_cast<int>(std::ceil(low.y())));
           j <= std::min(nodes_[c] - 1, static_cast<int>(std::floor(high.y()))); ++j)
        for (int i = std::max(0, static_cast<int>(std::ceil(low.x())));
             i <= std::min(nodes_[b] - 1, static_cast<int>(std::floor(high.x()))); ++i) {
          const Vector2f q =
              Vector2f(static_cast<float>(i), static_cast<float>(j)) - p[0].head<2>();
          const float s = (q.x() * second.y() - q.y() * second.x()) / area;
          const float r = (first.x() * q.y() - first.y() * q.x()) / area;
          if (s < 0 || r < 0 || s + r > 1) continue;
          crossings[static_cast<std::size_t>(j) * static_cast<std::size_t>(nodes_[b]) +
                    static_cast<std::size_t>(i)]
              .push_back(p[0].z() + s * (p[1].z() - p[0].z()) + r * (p[2].z() - p[0].z()));
        }
    }
    for (int j = 0; j < nodes_[c]; ++j)
      for (int i = 0; i < nodes_[b]; ++i) {
        auto& places = crossings[static_cast<std::size_t>(j) * static_cast<std::size_t>(nodes_[b]) +
                                 static_cast<std::size_t>(i)];
        std::sort(places.begin(), places.end());
        std::size_t passed = 0;
        for (int k = 0; k < nodes_[axis]; ++k) {
          while (passed < places.size() && places[passed] < static_cast<float>(k)) ++passed;
          if (passed % 2 == 0) continue;
          std::array<int, 3> node{};
          node[axis] = k;
          node[b] = i;
          node[c] = j;
          ++votes[index(node[0], node[1], node[2])];
        }
      }
  }

  const Mesh& mesh_;
  Vector3f origin_;
  float cell_;
  std::array<int, 3> nodes_;
  std::vector<Vector3f> vertices_;
  std::vector<float> distance_;
  std::vector<int> nearest_;
};

}  // namespace

SignedDistance::SignedDistance(const ObjectModel& object) : shape_(object.shape) {
  half_ = (0.5 * object.size).cast<float>();
  if (shape_ == Shape::kMesh) buildGrid(object.mesh);
}

void SignedDistance::buildGrid(const Mesh& mesh) {
  Vector3f low = mesh.vertices.front().cast<float>(), high = low;
  for (const auto& vertex : mesh.vertices) {
    low = low.cwiseMin(vertex.cast<float>());
    high = high.cwiseMax(vertex.cast<float>());
  }
  cell_ = std::max(1e-6F, (high - low).maxCoeff() / kGridCells);
  grid_origin_ = low - Vector3f::Constant(kMarginCells * cell_);
  for (int axis = 0; axis < 3; ++axis)
    cells_[static_cast<std::size_t>(axis)] =
        static_cast<int>(std::ceil((high[axis] - low[axis]) / cell_)) + 2 * kMarginCells + 1;
  grid_ = DistanceGrid(mesh, grid_origin_, cell_, cells_).signedDistances();
}

float SignedDistance::gridDistance(const Vector3f& point) const {
  const Vector3f wanted = (point - grid_origin_) / cell_;
  const Vector3f most(static_cast<float>(cells_[0]) - 1.001F,
                      static_cast<float>(cells_[1]) - 1.001F,
                      static_cast<float>(cells_[2]) - 1.001F);
  const Vector3f inside = wanted.cwiseMax(0.0F).cwiseMin(most);
  const Eigen::Vector3i node = inside.cast<int>();
  const Vector3f part = inside - node.cast<float>();
  const auto row = static_cast<std::size_t>(cells_[0]);
  const std::size_t plane = row * static_cast<std::size_t>(cells_[1]);
  const float* first = grid_.data() + static_cast<std::size_t>(node.z()) * plane +
                       static_cast<std::size_t>(node.y()) * row +
                       static_cast<std::size_t>(node.x());
  const auto along = [&](const float* p) { return p[0] + part.x() * (p[1] - p[0]); };
  const auto across = [&](const float* p) {
    const float near = along(p);
    return near + part.y() * (along(p + row) - near);
  };
  const float below = across(first);
  const float distance = below + part.z() * (across(first + plane) - below);
  return distance + cell_ * (wanted - inside).norm();
}

float SignedDistance::operator()(const Vector3f& point) const {
  switch (shape_) {
    case Shape::kBox:
      return boxDistance(point, half_);
    case Shape::kCylinder:  // size: radius, height
      return ofExtrusion(point.head<2>().norm() - 2 * half_.x(), std::abs(point.z()) - half_.y());
    case Shape::kPrism:  // size: side, height
      return ofExtrusion(triangleDistance(point.head<2>(), 2 * half_.x()),
                         std::abs(point.z()) - half_.y());
    case Shape::kMesh:
      break;
  }
  return gridDistance(point);
}

float SignedDistance::operator()(const Vector3f& point, Vector3f& gradient) const {
  const float step = shape_ == Shape::kMesh ? 0.5F * cell_ : kGradientStep;
  for (int axis = 0; axis < 3; ++axis) {
    const Vector3f shift = step * Vector3f::Unit(axis);
    gradient[axis] = (*this)(point + shift) - (*this)(point - shift);
  }
  const float length = gradient.norm();
  gradient = length > 0 ? Vector3f(gradient / length) : Vector3f::UnitZ();
  return (*this)(point);
}

}  // namespace leap_object_tracker
