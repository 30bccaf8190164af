#include "leap_object_tracker/geometry/mesh.hpp"

#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <numeric>
#include <stdexcept>
#include <tuple>

namespace leap_object_tracker {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

/// Two ends at z = -half and +half, joined by quads; the outline is counter-clockwise from above.
Mesh extrude(const std::vector<Eigen::Vector2d>& outline, double height) {
  Mesh mesh;
  const auto n = static_cast<std::uint32_t>(outline.size());
  for (const double z : {-height / 2, height / 2})
    for (const auto& point : outline) mesh.vertices.emplace_back(point.x(), point.y(), z);
  for (std::uint32_t i = 0; i < n; ++i) {
    const std::uint32_t next = (i + 1) % n;
    mesh.triangles.push_back({i, next, n + next});
    mesh.triangles.push_back({i, n + next, n + i});
  }
  for (std::uint32_t i = 1; i + 1 < n; ++i) {
    mesh.triangles.push_back({0, i + 1, i});
    mesh.triangles.push_back({n, n + i, n + i + 1});
  }
  return mesh;
}

bool degenerate(const Mesh& mesh, const Triangle& t) {
  const Eigen::Vector3d normal =
      (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cross(mesh.vertices[t[2]] - mesh.vertices[t[0]]);
  return !(normal.norm() > 1e-14);
}

}  // namespace

Mesh makeBox(const Eigen::Vector3d& size) {
  const double x = size.x() / 2, y = size.y() / 2;
  return extrude({{-x, -y}, {x, -y}, {x, y}, {-x, y}}, size.z());
}

Mesh makeCylinder(double radius, double height, int segments) {
  std::vector<Eigen::Vector2d> outline;
  for (int i = 0; i < segments; ++i) {
    const double angle = 2 * M_PI * i / segments;
    outline.emplace_back(radius * std::cos(angle), radius * std::sin(angle));
  }
  return extrude(outline, height);
}

Mesh makePrism(double side, double height) {
  const double to_apex = side / std::sqrt(3.0);
  return extrude({{-side / 2, -to_apex / 2}, {side / 2, -to_apex / 2}, {0, to_apex}}, height);
}

Mesh loadMesh(const std::string& path, double scale) {
  if (!std::ifstream(path)) throw std::runtime_error("mesh '" + path + "': cannot open the file");
  Assimp::Importer importer;
  const aiScene* scene = importer.ReadFile(
      path, aiProcess_Triangulate | aiProcess_PreTransformVertices | aiProcess_SortByPType);
  if (scene == nullptr)
    throw std::runtime_error("mesh '" + path + "': " + importer.GetErrorString());

  Mesh mesh;
  std::map<std::tuple<float, float, float>, std::uint32_t> known;
  for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
    const aiMesh& part = *scene->mMeshes[m];
    if ((part.mPrimitiveTypes & aiPrimitiveType_TRIANGLE) == 0) continue;
    std::vector<std::uint32_t> index(part.mNumVertices);
    for (unsigned i = 0; i < part.mNumVertices; ++i) {
      const aiVector3D& v = part.mVertices[i];
      if (!std::isfinite(v.x) || !std::isfinite(v.y) || !std::isfinite(v.z))
        throw std::runtime_error("mesh '" + path + "': a vertex is not a finite number");
      const auto key = std::make_tuple(v.x, v.y, v.z);
      const auto found = known.emplace(key, static_cast<std::uint32_t>(mesh.vertices.size()));
      if (found.second) mesh.vertices.emplace_back(scale * v.x, scale * v.y, scale * v.z);
      index[i] = found.first->second;
    }
    for (unsigned i = 0; i < part.mNumFaces; ++i) {
      const aiFace& face = part.mFaces[i];
      if (face.mNumIndices != 3) continue;
      const Triangle triangle{index[face.mIndices[0]], index[face.mIndices[1]],
                              index[face.mIndices[2]]};
      if (!degenerate(mesh, triangle)) mesh.triangles.push_back(triangle);
    }
  }
  if (mesh.triangles.empty())
    throw std::runtime_error("mesh '" + path + "': holds no triangle with an area");
  return mesh;
}

double radiusOf(const Mesh& mesh) {
  double largest = 0;
  for (const auto& vertex : mesh.vertices) largest = std::max(largest, vertex.norm());
  return largest;
}

double diameterOf(const Mesh& mesh) {
  // The diameter's ends are extreme along some direction: try a dense set of directions.
  double largest = 0;
  constexpr int kDirections = 256;
  for (int i = 0; i < kDirections; ++i) {
    const double z = (i + 0.5) / kDirections;
    const double ring = std::sqrt(1 - z * z), angle = i * M_PI * (3 - std::sqrt(5.0));
    const Eigen::Vector3d direction(ring * std::cos(angle), ring * std::sin(angle), z);
    const Eigen::Vector3d *low = nullptr, *high = nullptr;
    double lowest = 0, highest = 0;
    for (const auto& vertex : mesh.vertices) {
      const double along = direction.dot(vertex);
      if (low == nullptr || along < lowest) lowest = along, low = &vertex;
      if (high == nullptr || along > highest) highest = along, high = &vertex;
    }
    if (low != nullptr) largest = std::max(largest, (*high - *low).norm());
  }
  return largest;
}

Eigen::Vector3d evenDirection(int i, int count) {
  const double z = 1 - (2 * i + 1.0) / count, ring = std::sqrt(1 - z * z);
  const double angle = i * M_PI * (3 - std::sqrt(5.0));
  return {ring * std::cos(angle), ring * std::sin(angle), z};
}

std::vector<Eigen::Vector3d> pointsOn(const Mesh& mesh, int count) {
  std::vector<double> areas;
  for (const auto& t : mesh.triangles)
    areas.push_back((mesh.vertices[t[1]] - mesh.vertices[t[0]])
                        .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]])
                        .norm());
  const double step = std::accumulate(areas.begin(), areas.end(), 0.0) / count;
  std::vector<Eigen::Vector3d> points;
  if (!(step > 0)) return points;
  // One a share of the area.
  double due = 0.5 * step;
  for (std::size_t i = 0; i < areas.size(); ++i) {
    const auto& t = mesh.triangles[i];
    for (; due < areas[i]; due += step) {
      const auto number = static_cast<double>(points.size());
      double a = std::fmod(0.7548776662466927 * number, 1.0);
      double b = std::fmod(0.5698402909980532 * number, 1.0);
      if (a + b > 1) a = 1 - a, b = 1 - b;
      const Eigen::Vector3d& origin = mesh.vertices[t[0]];
      points.push_back(origin + a * (mesh.vertices[t[1]] - origin) +
                       b * (mesh.vertices[t[2]] - origin));
    }
    due -= areas[i];
  }
  return points;
}

ShadowArea shadowAreaOf(const Mesh& mesh) {
  constexpr int kPoints = 6000, kDirections = 60, kCells = 40;  // along the diameter
  const std::vector<Eigen::Vector3d> points = pointsOn(mesh, kPoints);
  if (points.empty()) return {};
  const double radius = radiusOf(mesh), cell = 2 * radius / kCells;
  ShadowArea shadow;
  shadow.least = std::numeric_limits<double>::infinity();
  std::vector<bool> covered;
  for (int i = -3; i < kDirections; ++i) {
    // The axes first: along them bodies are often smallest or largest.
    const Eigen::Vector3d direction =
        i < 0 ? Eigen::Vector3d::Unit(i + 3) : evenDirection(i, kDirections);
    const Eigen::Matrix3d turn =
        Eigen::Quaterniond::FromTwoVectors(direction, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    covered.assign((kCells + 1) * (kCells + 1), false);
    for (const auto& point : points) {
      const Eigen::Vector3d seen = turn * point;
      const auto column = static_cast<std::size_t>((seen.x() + radius) / cell);
      const auto row = static_cast<std::size_t>((seen.y() + radius) / cell);
      covered[row * (kCells + 1) + column] = true;
    }
    // Cells at the border are half covered.
    double inside = 0;
    for (std::size_t row = 1; row < kCells; ++row)
      for (std::size_t column = 1; column < kCells; ++column) {
        const auto at = [&](std::size_t r, std::size_t c) { return covered[r * (kCells + 1) + c]; };
        if (!at(row, column)) continue;
        const int free_sides = !at(row - 1, column) + !at(row + 1, column) + !at(row, column - 1) +
                               !at(row, column + 1);
        inside += free_sides > 0 ? 0.5 : 1;
      }
    const double area = inside * cell * cell;
    shadow.least = std::min(shadow.least, area);
    shadow.largest = std::max(shadow.largest, area);
    if (i >= 0) shadow.mean += area / kDirections;
  }
  return shadow;
}

}  // namespace leap_object_tracker
