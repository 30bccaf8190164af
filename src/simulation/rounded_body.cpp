#include "rounded_body.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace leap_object_tracker {
namespace {

constexpr double kSmoothCosine = 0.82;  // faces closer than 35 deg belong to one round surface
constexpr double kSameNormal = 1e-6;
constexpr double kFacet = 0.15;  // [rad] of a rounding that one flat piece stands for

/// Direction at a share of the way from one unit vector to another, along the great circle.
Eigen::Vector3d between(const Eigen::Vector3d& a, const Eigen::Vector3d& b, double share) {
  return Eigen::Quaterniond::Identity().slerp(share, Eigen::Quaterniond::FromTwoVectors(a, b)) * a;
}

double angleBetweenUnits(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::acos(std::clamp(a.dot(b), -1.0, 1.0));
}

/// One vertex of the sharp body: where the ball's centre comes to rest, and the surfaces that meet.
struct Corner {
  Eigen::Vector3d center;
  std::vector<Eigen::Vector3d> normals;

  void addSurface(const Eigen::Vector3d& normal) {
    if (std::none_of(normals.begin(), normals.end(), [&](const Eigen::Vector3d& known) {
          return (known - normal).squaredNorm() < kSameNormal;
        }))
      normals.push_back(normal);
  }
};

class Rounder {
 public:
  Rounder(const Mesh& mesh, double radius)
      : mesh_(mesh),
        radius_(radius),
        corner_normals_(cornerNormals(mesh)),
        corners_(mesh.vertices.size()) {}

  std::optional<RoundedBody> round() {
    if (!placeCenters() || !addFaces() || !addEdges()) return std::nullopt;
    for (const Corner& corner : corners_)
      if (corner.normals.size() == 3) addCorner(corner);
    return std::move(body_);
  }

 private:
  bool placeCenters() {
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        corners_[mesh_.triangles[t][k]].addSurface(corner_normals_[t][k]);
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      Corner& corner = corners_[i];
      const auto count = static_cast<Eigen::Index>(corner.normals.size());
      if (count > 3) return false;
      Eigen::MatrixXd normals(count, 3);
      for (Eigen::Index row = 0; row < count; ++row)
        normals.row(row) = corner.normals[static_cast<std::size_t>(row)];
      const auto solver = normals.completeOrthogonalDecomposition();
      if (solver.rank() < count) return false;
      corner.center = mesh_.vertices[i] + solver.solve(Eigen::VectorXd::Constant(count, -radius_));
    }
    return true;
  }

  std::uint32_t add(const Eigen::Vector3d& center, const Eigen::Vector3d& normal) {
    body_.mesh.vertices.push_back(center + radius_ * normal);
    body_.normals.push_back(normal);
    return static_cast<std::uint32_t>(body_.mesh.vertices.size() - 1);
  }

  bool addFaces() {
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const auto& corners = mesh_.triangles[t];
      std::array<std::uint32_t, 3> triangle;
      for (std::size_t k = 0; k < 3; ++k)
        triangle[k] = add(corners_[corners[k]].center, corner_normals_[t][k]);
      const auto& v = body_.mesh.vertices;
      const Eigen::Vector3d turned =
          (v[triangle[1]] - v[triangle[0]]).cross(v[triangle[2]] - v[triangle[0]]);
      if (turned.dot(faceNormal(t)) <= 0) return false;  // smaller than the rounding
      body_.mesh.triangles.push_back(triangle);
    }
    return true;
  }

  Eigen::Vector3d faceNormal(std::size_t triangle) const {
    const auto& t = mesh_.triangles[triangle];
    const auto& v = mesh_.vertices;
    return (v[t[1]] - v[t[0]]).cross(v[t[2]] - v[t[0]]).normalized();
  }

  bool addEdges() {
    struct Side {
      std::size_t triangle, corner;  // of the end where it begins
    };
    std::map<std::pair<std::uint32_t, std::uint32_t>, Side> sides;
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t)
      for (std::size_t k = 0; k < 3; ++k)
        sides[{mesh_.triangles[t][k], mesh_.triangles[t][(k + 1) % 3]}] = {t, k};
    for (const auto& [ends, here] : sides) {
      const auto other = sides.find({ends.second, ends.first});
      if (other == sides.end()) return false;  // open
      const Side there = other->second;
      const Eigen::Vector3d normal = faceNormal(here.triangle);
      const std::uint32_t beyond = mesh_.triangles[there.triangle][(there.corner + 2) % 3];
      constexpr double kFlat = 1e-9;  // [m]
      if (normal.dot(mesh_.vertices[beyond] - mesh_.vertices[ends.first]) > kFlat) return false;
      if (ends.first > ends.second || smoothlyJoined(normal, faceNormal(there.triangle))) continue;
      addStrip(corners_[ends.first].center, corners_[ends.second].center,
               {corner_normals_[here.triangle][here.corner],
                corner_normals_[here.triangle][(here.corner + 1) % 3]},
               {corner_normals_[there.triangle][(there.corner + 1) % 3],
                corner_normals_[there.triangle][there.corner]});
    }
    return true;
  }

  /// @param from, to the normals of both faces at the two ends
  void addStrip(const Eigen::Vector3d& start, const Eigen::Vector3d& end,
                const std::array<Eigen::Vector3d, 2>& from,
                const std::array<Eigen::Vector3d, 2>& to) {
    const int steps =
        std::max(1, static_cast<int>(std::ceil(angleBetweenUnits(from[0], to[0]) / kFacet)));
    std::array<std::uint32_t, 2> before{};
    for (int step = 0; step <= steps; ++step) {
      const double share = static_cast<double>(step) / steps;
      const std::array<std::uint32_t, 2> now{add(start, between(from[0], to[0], share)),
                                             add(end, between(from[1], to[1], share))};
      if (step > 0) {
        body_.mesh.triangles.push_back({before[0], now[0], now[1]});
        body_.mesh.triangles.push_back({before[0], now[1], before[1]});
      }
      before = now;
    }
  }

  /// A triangle of a sphere in rows.
  void addCorner(const Corner& corner) {
    const Eigen::Vector3d& a = corner.normals[0];
    Eigen::Vector3d b = corner.normals[1], c = corner.normals[2];
    if (a.dot(b.cross(c)) < 0) std::swap(b, c);
    const double widest =
        std::max({angleBetweenUnits(a, b), angleBetweenUnits(b, c), angleBetweenUnits(c, a)});
    const int steps = std::max(1, static_cast<int>(std::ceil(widest / kFacet)));
    std::vector<std::uint32_t> before;
    for (int row = 0; row <= steps; ++row) {
      const double down = static_cast<double>(row) / steps;
      const Eigen::Vector3d left = between(a, b, down), right = between(a, c, down);
      std::vector<std::uint32_t> now;
      for (int i = 0; i <= row; ++i)
        now.push_back(
            add(corner.center, between(left, right, row > 0 ? static_cast<double>(i) / row : 0)));
      for (std::size_t i = 0; i + 1 < now.size(); ++i) {
        body_.mesh.triangles.push_back({before[i], now[i], now[i + 1]});
        if (i + 1 < before.size())
          body_.mesh.triangles.push_back({before[i], now[i + 1], before[i + 1]});
      }
      before = now;
    }
  }

  const Mesh& mesh_;
  const double radius_;
  const std::vector<std::array<Eigen::Vector3d, 3>> corner_normals_;
  std::vector<Corner> corners_;
  RoundedBody body_;
};

}  // namespace

bool smoothlyJoined(const Eigen::Vector3d& normal_a, const Eigen::Vector3d& normal_b) {
  return normal_a.dot(normal_b) > kSmoothCosine;
}

std::vector<std::array<Eigen::Vector3d, 3>> cornerNormals(const Mesh& mesh) {
  std::vector<std::vector<std::size_t>> faces_of(mesh.vertices.size());
  std::vector<Eigen::Vector3d> weighted, unit;  // length: twice the area
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    const auto& t = mesh.triangles[i];
    weighted.push_back((mesh.vertices[t[1]] - mesh.vertices[t[0]])
                           .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]));
    unit.push_back(weighted.back().normalized());
    for (const auto vertex : t) faces_of[vertex].push_back(i);
  }
  std::vector<std::array<Eigen::Vector3d, 3>> normals(mesh.triangles.size());
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i)
    for (std::size_t corner = 0; corner < 3; ++corner) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      for (const auto face : faces_of[mesh.triangles[i][corner]])
        if (smoothlyJoined(unit[face], unit[i])) sum += weighted[face];
      normals[i][corner] = sum.normalized();
    }
  return normals;
}

std::optional<RoundedBody> roundEdges(const Mesh& mesh, double radius) {
  return Rounder(mesh, radius).round();
}

}  // namespace leap_object_tracker
