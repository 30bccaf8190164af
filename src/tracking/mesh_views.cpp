#include "mesh_views.hpp"

#include <tbb/parallel_for.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include "contour_segments.hpp"
#include "sight_lines.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

/// Places of views in radii of the mesh. Between neighbours the part of a sphere that is seen
/// changes by 7 to 14 deg, about as much as between neighbouring directions.
constexpr std::array<double, 6> kDistances{0.6, 0.85, 1.2, 1.6, 2.3, 5.0};
constexpr double kNearestEver = 0.5;  ///< [radii]
constexpr double kClearance = 1.03;   ///< no eye is nearer to the convex hull, in hull distances

constexpr double kSharp = 30 * M_PI / 180;   ///< [rad] between normals; more is a crease
constexpr double kFlat = 0.05 * M_PI / 180;  ///< [rad] less is no edge at all
constexpr double kPieceAngle = 1.5 / 120;    ///< length of a piece [radii], seen across
constexpr double kBeside = 0.02;             ///< of an outline is looked for other parts [radii]
constexpr double kOffSurface = 1e-4;  ///< where rays start [radii], to miss their own surface

/// Vertices of an icosahedron whose triangles are split in four, three times: 642 directions, about
/// 8 deg apart.
std::vector<Vector3f> viewDirections() {
  const double golden = (1 + std::sqrt(5.0)) / 2;
  std::vector<Vector3d> vertices;
  for (const double a : {-1.0, 1.0})
    for (const double b : {-golden, golden})
      for (int axis = 0; axis < 3; ++axis) {
        Vector3d v = Vector3d::Zero();
        v[axis] = a;
        v[(axis + 1) % 3] = b;
        vertices.push_back(v.normalized());
      }
  std::vector<std::array<std::size_t, 3>> triangles;
  const double edge = 2 / std::sqrt(1 + golden * golden);
  const auto joined = [&](std::size_t i, std::size_t j) {
    return std::abs((vertices[i] - vertices[j]).norm() - edge) < 1e-6;
  };
  for (std::size_t i = 0; i < 12; ++i)
    for (std::size_t j = i + 1; j < 12; ++j)
      for (std::size_t k = j + 1; k < 12; ++k)
        if (joined(i, j) && joined(j, k) && joined(i, k)) triangles.push_back({i, j, k});

  for (int round = 0; round < 3; ++round) {
    std::map<std::pair<std::size_t, std::size_t>, std::size_t> middles;
    const auto middle = [&](std::size_t i, std::size_t j) {
      const auto [found, added] = middles.emplace(std::minmax(i, j), vertices.size());
      if (added) vertices.push_back((vertices[i] + vertices[j]).normalized());
      return found->second;
    };
    std::vector<std::array<std::size_t, 3>> finer;
    for (const auto& [i, j, k] : triangles) {
      const std::size_t ij = middle(i, j), jk = middle(j, k), ki = middle(k, i);
      finer.insert(finer.end(), {{i, ij, ki}, {ij, j, jk}, {ki, jk, k}, {ij, jk, ki}});
    }
    triangles = std::move(finer);
  }
  std::vector<Vector3f> directions;
  for (const Vector3d& v : vertices) directions.push_back(v.cast<float>());
  return directions;
}

/// Distance of the convex hull from the origin in each direction [m]; zero where the origin is
/// outside of it.
std::vector<double> hullDistances(const Mesh& mesh, const std::vector<Vector3f>& directions) {
  std::vector<double> support(directions.size(), 0);
  tbb::parallel_for(std::size_t{0}, directions.size(), [&](std::size_t i) {
    const Vector3d direction = directions[i].cast<double>();
    for (const Vector3d& vertex : mesh.vertices)
      support[i] = std::max(support[i], direction.dot(vertex));
  });
  std::vector<double> distances(directions.size());
  for (std::size_t i = 0; i < directions.size(); ++i) {
    distances[i] = std::numeric_limits<double>::max();
    for (std::size_t j = 0; j < directions.size(); ++j) {
      const double cosine = directions[i].cast<double>().dot(directions[j].cast<double>());
      if (cosine > 1e-3) distances[i] = std::min(distances[i], support[j] / cosine);
    }
  }
  return distances;
}

/// Each triangle once, whichever way round it is given.
Mesh withoutRepeatedTriangles(const Mesh& mesh) {
  std::vector<std::size_t> order(mesh.triangles.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::vector<std::array<std::uint32_t, 3>> keys = mesh.triangles;
  for (auto& key : keys) std::sort(key.begin(), key.end());
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return keys[a] != keys[b] ? keys[a] < keys[b] : a < b;
  });
  Mesh clean;
  clean.vertices = mesh.vertices;
  for (std::size_t i = 0; i < order.size(); ++i)
    if (i == 0 || keys[order[i]] != keys[order[i - 1]])
      clean.triangles.push_back(mesh.triangles[order[i]]);
  return clean;
}

/// Finds the visible contour from any place. Nothing depends on which way round triangles are
/// given.
class ContourFinder {
 public:
  explicit ContourFinder(const Mesh& mesh)
      : mesh_(withoutRepeatedTriangles(mesh)), radius_(radiusOf(mesh)), sight_(mesh_) {
    for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
      const Vector3d normal = triangleNormal(mesh_, t);
      const Vector3d& corner = mesh_.vertices[mesh_.triangles[t][0]];
      normals_.push_back(normal);
      planes_.emplace_back(normal.x(), normal.y(), normal.z(), -normal.dot(corner));
    }
    findEdges();
  }

  std::vector<ContourSegment> segmentsFrom(const Vector3d& eye) const {
    std::vector<ContourSegment> segments;
    std::uint32_t blocker = 0, backdrop = 0;  // hit last: likely to be hit again
    for (std::size_t patch = 0; patch < patches_.size(); ++patch) {
      if (patches_[patch].looksOneWay(eye)) continue;
      const std::size_t first = patch * kPatchEdges;
      for (std::size_t i = first; i < std::min(first + kPatchEdges, sides_.size()); ++i) {
        const Sides& sides = sides_[i];
        const bool outline =
            (facesEye(sides.first, eye) != facesEye(sides.second, eye)) != sides.flipped;
        if (outline || sides.always)
          addVisible(edges_[i], outline, eye, blocker, backdrop, segments);
      }
    }
    return segments;
  }

 private:
  enum class Kind : std::uint8_t {
    kSmooth,    ///< contour only where one triangle hides the other
    kSharp,     ///< always contour
    kOpen,      ///< one triangle: always contour, with nothing of the mesh beyond it
    kBranching  ///< more than two triangles: always contour, with the mesh on either side
  };
  struct Edge {
    Vector3d start, end;
    std::array<std::uint32_t, 2> triangles{};
    std::array<Vector3d, 2> apexes;  ///< third corners of the triangles
    Kind kind = Kind::kSmooth;
    bool opposed = false;  ///< the triangles are given in opposite turns
  };

  /// What decides whether an edge is contour, apart from the rest: many edges are asked for every
  /// view. It is outline if one of the two triangles looks at the eye, or, if flipped, both or
  /// none.
  struct Sides {
    std::uint32_t first, second;
    bool flipped, always;
  };

  static constexpr std::size_t kPatchEdges = 32;

  /// Bounds of the planes at neighbouring edges: for most eyes all look at it, or none, and no edge
  /// is outline.
  struct Patch {
    Vector3d center = Vector3d::Zero(), normal = Vector3d::Zero();
    double spread = 0;               ///< of the normals about the mean one
    double lowest = 0, highest = 0;  ///< [m] of the planes below the centre
    double margin = 0;               ///< [m] of rounding
    bool never_skipped = false;      ///< holds edges that do not depend on that

    bool looksOneWay(const Vector3d& eye) const {
      const Vector3d way = eye - center;
      const double height = normal.dot(way), doubt = spread * way.norm() + margin;
      return !never_skipped && (height - doubt + lowest > 0 || height + doubt + highest < 0);
    }
  };

  bool facesEye(std::uint32_t triangle, const Vector3d& eye) const {
    const Eigen::Vector4d& plane = planes_[triangle];
    return plane.head<3>().dot(eye) + plane.w() > 0;
  }

  void findPatches() {
    for (std::size_t first = 0; first < sides_.size(); first += kPatchEdges) {
      const std::size_t end = std::min(first + kPatchEdges, sides_.size());
      std::vector<std::uint32_t> triangles;
      Patch patch;
      for (std::size_t i = first; i < end; ++i) {
        patch.never_skipped = patch.never_skipped || sides_[i].always || sides_[i].flipped;
        patch.center +=
            (edges_[i].start + edges_[i].end) / (2.0 * static_cast<double>(end - first));
        triangles.insert(triangles.end(), {sides_[i].first, sides_[i].second});
      }
      for (const std::uint32_t t : triangles)
        patch.normal += normals_[t] / static_cast<double>(triangles.size());
      patch.lowest = std::numeric_limits<double>::max();
      patch.highest = std::numeric_limits<double>::lowest();
      for (const std::uint32_t t : triangles) {
        const double below = normals_[t].dot(patch.center) + planes_[t].w();
        patch.spread = std::max(patch.spread, (normals_[t] - patch.normal).norm());
        patch.lowest = std::min(patch.lowest, below);
        patch.highest = std::max(patch.highest, below);
      }
      patch.margin = 1e-9 * radius_;
      patches_.push_back(patch);
    }
  }

  bool forwards(std::size_t triangle, std::uint32_t start, std::uint32_t end) const {
    const auto& t = mesh_.triangles[triangle];
    return (t[0] == start && t[1] == end) || (t[1] == start && t[2] == end) ||
           (t[2] == start && t[0] == end);
  }

  const Vector3d& apexOf(std::size_t triangle, std::uint32_t start, std::uint32_t end) const {
    for (const std::uint32_t corner : mesh_.triangles[triangle])
      if (corner != start && corner != end) return mesh_.vertices[corner];
    return mesh_.vertices[start];
  }

  void findEdges() {
    const std::vector<EdgeAdjacency> all = adjacentTriangles(mesh_);
    const auto sameEdge = [](const EdgeAdjacency& a, const EdgeAdjacency& b) {
      return a.start == b.start && a.end == b.end;
    };
    for (std::size_t i = 0; i < all.size();) {
      std::size_t next = i + 1;
      while (next < all.size() && sameEdge(all[i], all[next])) ++next;
      addEdge(all[i], next - i > 1);
      i = next;
    }
    sortByPlace();
  }

  void addEdge(const EdgeAdjacency& adjacency, bool branching) {
    Edge edge;
    edge.start = mesh_.vertices[adjacency.start];
    edge.end = mesh_.vertices[adjacency.end];
    const bool open = adjacency.triangles[1] < 0;
    for (std::size_t side = 0; side < 2; ++side) {
      const auto triangle = static_cast<std::size_t>(adjacency.triangles[open ? 0 : side]);
      edge.triangles[side] = static_cast<std::uint32_t>(triangle);
      edge.apexes[side] = apexOf(triangle, adjacency.start, adjacency.end);
    }
    if (open) {
      edge.kind = Kind::kOpen;
    } else if (branching) {
      edge.kind = Kind::kBranching;
    } else {
      edge.opposed = forwards(edge.triangles[0], adjacency.start, adjacency.end) ==
                     forwards(edge.triangles[1], adjacency.start, adjacency.end);
      const Vector3d first = normals_[edge.triangles[0]];
      const Vector3d second = (edge.opposed ? -1 : 1) * normals_[edge.triangles[1]];
      const double angle = std::atan2(first.cross(second).norm(), first.dot(second));
      if (angle < kFlat) return;
      if (angle > kSharp) edge.kind = Kind::kSharp;
    }
    edges_.push_back(edge);
  }

  /// Neighbours next to each other (Morton order), so that points at equal steps along the list
  /// spread evenly over the body.
  void sortByPlace() {
    const auto code = [this](const Edge& edge) {
      const Vector3d middle = (edge.start + edge.end) / 2;
      std::uint64_t bits = 0;
      for (int level = 9; level >= 0; --level)
        for (int axis = 0; axis < 3; ++axis) {
          const auto cell = static_cast<std::uint32_t>(
              std::clamp((middle[axis] / radius_ + 1) * 512, 0.0, 1023.0));
          bits = bits << 1 | (cell >> level & 1U);
        }
      return bits;
    };
    std::vector<std::pair<std::uint64_t, std::size_t>> order;
    for (std::size_t i = 0; i < edges_.size(); ++i) order.emplace_back(code(edges_[i]), i);
    std::sort(order.begin(), order.end());
    std::vector<Edge> sorted;
    for (const auto& [bits, i] : order) sorted.push_back(edges_[i]);
    edges_ = std::move(sorted);
    for (const Edge& edge : edges_) {
      const bool branching = edge.kind == Kind::kBranching;
      sides_.push_back({edge.triangles[0], edge.triangles[branching ? 0 : 1],
                        edge.kind == Kind::kOpen || (edge.opposed && !branching),
                        edge.kind != Kind::kSmooth});
    }
    findPatches();
  }

  /// Cuts an edge into pieces short enough to be wholly visible or wholly hidden.
  void addVisible(const Edge& edge, bool outline, const Vector3d& eye, std::uint32_t& blocker,
                  std::uint32_t& backdrop, std::vector<ContourSegment>& segments) const {
    const Vector3d along = edge.end - edge.start;
    const Vector3d to_eye = eye - (edge.start + edge.end) / 2;
    const double seen_across = along.cross(to_eye).norm() / to_eye.norm();
    const double near = std::max(to_eye.norm() - along.norm() / 2, 0.1 * to_eye.norm());
    const double piece = kPieceAngle * radius_ * std::min(1.0, near / eye.norm());
    const int pieces = std::clamp(static_cast<int>(std::ceil(seen_across / piece)), 1, 1000);
    for (int i = 0; i < pieces; ++i) {
      const Vector3d start = edge.start + along * (static_cast<double>(i) / pieces);
      const Vector3d end = edge.start + along * (static_cast<double>(i + 1) / pieces);
      const Vector3d middle = (start + end) / 2;
      const Vector3d ray = (eye - middle).normalized();
      const Vector3d free = freeSide(edge, outline, ray);
      const Vector3d from = middle + kOffSurface * radius_ * (free + ray);
      if (sight_.blocked(from.cast<float>(), eye.cast<float>(), blocker)) continue;
      bool inner = false;
      if (outline) {
        const Vector3d beside = middle + kBeside * radius_ * awayInImage(edge, ray);
        const Vector3d behind = beside - 4 * radius_ * ray;
        inner = sight_.blocked(beside.cast<float>(), behind.cast<float>(), backdrop);
      }
      if (outline && edge.kind == Kind::kSmooth) {
        addLimb(edge, start, end, ray, inner, segments);
        continue;
      }
      ContourSegment segment{start, end, outline ? awayFromFace(edge, ray) : Vector3d::Zero()};
      segment.inner = inner;
      for (std::size_t side = 0; side < 2; ++side) {
        if (side == 1 && edge.kind == Kind::kOpen) continue;
        const Vector3d& normal = normals_[edge.triangles[side]];
        if (!outline || normal.dot(ray) > 0)
          segment.faces[side] = normal.dot(ray) > 0 ? normal : Vector3d(-normal);
      }
      if (!outline && edge.kind == Kind::kSharp) segment.orderFaces(edge.apexes[0] - edge.start);
      segments.push_back(segment);
    }
  }

  /// Unit vector from the edge into the open: across the image for outlines, else between the
  /// faces.
  Vector3d freeSide(const Edge& edge, bool outline, const Vector3d& ray) const {
    if (outline) return awayInImage(edge, ray);
    Vector3d sum = Vector3d::Zero();
    for (const std::uint32_t triangle : edge.triangles)
      sum += normals_[triangle] * (normals_[triangle].dot(ray) > 0 ? 1 : -1);
    return sum.squaredNorm() > 1e-12 ? sum.normalized() : ray;
  }

  /// Across edge and ray, away from the triangles of an outline.
  static Vector3d awayInImage(const Edge& edge, const Vector3d& ray) {
    const Vector3d across = (edge.end - edge.start).cross(ray).stableNormalized();
    const double side = across.dot(edge.apexes[0] + edge.apexes[1] - 2 * edge.start);
    return side > 0 ? Vector3d(-across) : across;
  }

  /// In the plane of the face that is seen, away from it.
  Vector3d awayFromFace(const Edge& edge, const Vector3d& ray) const {
    // The face that is seen lies between the eye and the other one.
    const Vector3d& normal = normals_[edge.triangles[0]];
    const bool first =
        edge.kind == Kind::kOpen || normal.dot(ray) * normal.dot(edge.apexes[1] - edge.start) <= 0;
    const Vector3d along = (edge.end - edge.start).normalized();
    const Vector3d inwards = edge.apexes[first ? 0 : 1] - edge.start;
    return (along * along.dot(inwards) - inwards).normalized();
  }

  /// A piece of the outline of a curved surface: the edges run zigzag about the true limb, which is
  /// normal to the ray and to the surface where that turns away.
  void addLimb(const Edge& edge, const Vector3d& start, const Vector3d& end, const Vector3d& ray,
               bool inner, std::vector<ContourSegment>& segments) const {
    const Vector3d& first = normals_[edge.triangles[0]];
    const Vector3d second = (edge.opposed ? -1 : 1) * normals_[edge.triangles[1]];
    // Between the two normals, where it is across the ray.
    Vector3d normal =
        first * std::abs(second.dot(ray)) + second * std::abs(first.dot(ray)) + 1e-12 * first;
    normal = (normal - ray * ray.dot(normal)).normalized();
    const Vector3d tangent = normal.cross(ray);
    const Vector3d half = tangent * (tangent.dot(end - start) / 2);
    if (!(half.norm() > 1e-9 * radius_)) return;
    const Vector3d middle = (start + end) / 2;
    const Vector3d outward = normal.dot(awayInImage(edge, ray)) < 0 ? Vector3d(-normal) : normal;
    // Facets as wide as the edge is from their far corners.
    const double width = 0.5 * (offEdge(edge, 0) + offEdge(edge, 1));
    const double bend = std::atan2(first.cross(second).norm(), first.dot(second));
    segments.push_back(
        {middle - half, middle + half, outward, std::max(1e-6, width / bend), inner});
  }

  /// [m] from an edge to the far corner of a triangle.
  static double offEdge(const Edge& edge, std::size_t side) {
    const Vector3d along = (edge.end - edge.start).normalized();
    return along.cross(edge.apexes[side] - edge.start).norm();
  }

  Mesh mesh_;
  double radius_;
  SightLines sight_;
  std::vector<Vector3d> normals_;
  std::vector<Eigen::Vector4d> planes_;
  std::vector<Edge> edges_;
  std::vector<Sides> sides_;    ///< of each edge
  std::vector<Patch> patches_;  ///< of kPatchEdges neighbouring edges each
};

MeshViews computeViews(const Mesh& mesh, int points) {
  const double radius = radiusOf(mesh);
  MeshViews views;
  views.directions = viewDirections();
  const std::vector<double> hull = hullDistances(mesh, views.directions);
  const double nearest =
      std::max(kNearestEver * radius, kClearance * *std::min_element(hull.begin(), hull.end()));
  views.nearest = static_cast<float>(nearest);

  std::vector<std::pair<double, double>> shells;  // distance of the eye, upper limit
  for (std::size_t i = 0; i < kDistances.size(); ++i) {
    const bool last = i + 1 == kDistances.size();
    const double limit = last ? std::numeric_limits<double>::max()
                              : radius * std::sqrt(kDistances[i] * kDistances[i + 1]);
    if (limit <= nearest) continue;
    shells.emplace_back(radius * kDistances[i], limit);
    if (!last) views.shell_limits.push_back(static_cast<float>(limit));
  }

  const ContourFinder finder(mesh);
  const std::size_t directions = views.directions.size();
  views.views.resize(shells.size() * directions);
  tbb::parallel_for(std::size_t{0}, views.views.size(), [&](std::size_t i) {
    const auto& [shell, limit] = shells[i / directions];
    const double distance = std::max(shell, kClearance * hull[i % directions]);
    if (distance > limit) return;  // inside the body all through the shell
    const Vector3d eye = views.directions[i % directions].cast<double>() * distance;
    views.views[i] = makeView(finder.segmentsFrom(eye), points);
  });
  return views;
}

/// FNV-1a with words of eight bytes.
std::uint64_t hashOf(const void* data, std::size_t size, std::uint64_t hash) {
  const auto* bytes = static_cast<const char*>(data);
  for (std::size_t i = 0; i < size; i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes + i, std::min<std::size_t>(8, size - i));
    hash = (hash ^ word) * 0x100000001b3ULL;
    hash ^= hash >> 32;
  }
  return hash;
}
constexpr std::uint64_t kHashStart = 0xcbf29ce484222325ULL;

/// Views in a file of the cache folder: name, sizes, numbers, and a hash of all that at the end.
class ViewFile {
 public:
  ViewFile(const Mesh& mesh, int points, const std::string& folder)
      : folder_(folder), points_(points) {
    static_assert(sizeof(Vector3d) == 24 && sizeof(mesh.triangles[0]) == 12, "hashed as bytes");
    key_ = hashOf(&kVersion, sizeof kVersion, kHashStart);
    key_ = hashOf(&points, sizeof points, key_);
    key_ = hashOf(mesh.vertices.data(), mesh.vertices.size() * 24, key_);
    key_ = hashOf(mesh.triangles.data(), mesh.triangles.size() * 12, key_);
    std::array<char, 48> name{};
    std::snprintf(name.data(), name.size(), "mesh_views_%016llx.bin",
                  static_cast<unsigned long long>(key_));
    path_ = folder_ / name.data();
  }

  std::optional<MeshViews> load() const {
    std::ifstream file(path_, std::ios::binary | std::ios::ate);
    if (!file) return std::nullopt;
    std::vector<char> bytes(static_cast<std::size_t>(std::max<std::streamoff>(file.tellg(), 0)));
    file.seekg(0);
    if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) return std::nullopt;
    std::uint64_t sum = 0;
    if (bytes.size() < sizeof sum) return std::nullopt;
    const std::size_t content = bytes.size() - sizeof sum;
    std::memcpy(&sum, bytes.data() + content, sizeof sum);
    if (sum != hashOf(bytes.data(), content, kHashStart)) return std::nullopt;
    return parse(bytes.data(), content);
  }

  /// Leaves either the whole file or none.
  void save(const MeshViews& views) const {
    std::error_code ignored;
    std::filesystem::create_directories(folder_, ignored);
    std::string temporary = path_.string() + ".XXXXXX";
    const int descriptor = mkstemp(temporary.data());
    if (descriptor < 0) return;
    std::FILE* file = fdopen(descriptor, "wb");
    const std::vector<char> bytes = serialized(views);
    bool whole = std::fwrite(bytes.data(), 1, bytes.size(), file) == bytes.size();
    whole = std::fclose(file) == 0 && whole;
    if (whole) std::filesystem::rename(temporary, path_, ignored);
    if (!whole || ignored) std::filesystem::remove(temporary, ignored);
  }

 private:
  static constexpr std::uint64_t kVersion = 8;  ///< of the format and of how views are found
  static_assert(sizeof(ContourPoint) == 21 * sizeof(float), "written as bytes, without gaps");

  template <class T>
  static void put(const T* values, std::size_t count, std::vector<char>& bytes) {
    const auto* begin = reinterpret_cast<const char*>(values);
    bytes.insert(bytes.end(), begin, begin + count * sizeof(T));
  }

  std::vector<char> serialized(const MeshViews& views) const {
    std::vector<char> bytes;
    const std::array<std::uint64_t, 4> sizes{key_, views.directions.size(),
                                             views.shell_limits.size(), views.views.size()};
    put(sizes.data(), sizes.size(), bytes);
    put(&views.nearest, 1, bytes);
    put(views.directions.data(), views.directions.size(), bytes);
    put(views.shell_limits.data(), views.shell_limits.size(), bytes);
    for (const ContourView& view : views.views) {
      const std::array<std::uint32_t, 2> counts{static_cast<std::uint32_t>(view.arrays.size()),
                                                static_cast<std::uint32_t>(view.points.size())};
      put(counts.data(), counts.size(), bytes);
      put(view.arrays.data(), view.arrays.size(), bytes);
      put(view.points.data(), view.points.size(), bytes);
    }
    const std::uint64_t sum = hashOf(bytes.data(), bytes.size(), kHashStart);
    put(&sum, 1, bytes);
    return bytes;
  }

  std::optional<MeshViews> parse(const char* bytes, std::size_t left) const {
    const auto get = [&](auto* values, std::size_t count) {
      const std::size_t size = count * sizeof *values;
      if (count > left || size > left) return false;
      if (size > 0) std::memcpy(static_cast<void*>(values), bytes, size);
      bytes += size, left -= size;
      return true;
    };
    MeshViews views;
    std::array<std::uint64_t, 4> sizes{};
    if (!get(sizes.data(), sizes.size()) || sizes[0] != key_) return std::nullopt;
    if (sizes[1] * (sizes[2] + 1) != sizes[3] || sizes[3] > left) return std::nullopt;
    views.directions.resize(sizes[1]);
    views.shell_limits.resize(sizes[2]);
    views.views.resize(sizes[3]);
    if (!get(&views.nearest, 1) || !get(views.directions.data(), views.directions.size()) ||
        !get(views.shell_limits.data(), views.shell_limits.size()))
      return std::nullopt;
    for (ContourView& view : views.views) {
      std::array<std::uint32_t, 2> counts{};
      if (!get(counts.data(), counts.size())) return std::nullopt;
      const auto entries = 6 * static_cast<std::size_t>(points_);
      if ((counts[0] != 0 && counts[0] != entries) || counts[1] > left) return std::nullopt;
      view.arrays.resize(counts[0]);
      view.points.resize(counts[1]);
      if (!get(view.arrays.data(), view.arrays.size()) ||
          !get(view.points.data(), view.points.size()))
        return std::nullopt;
    }
    return views;
  }

  std::filesystem::path folder_, path_;
  int points_;
  std::uint64_t key_ = 0;
};

}  // namespace

class MeshContour::Finder : public ContourFinder {
 public:
  using ContourFinder::ContourFinder;
};

MeshContour::MeshContour(const Mesh& mesh) : finder_(std::make_unique<Finder>(mesh)) {}
MeshContour::~MeshContour() = default;

ContourView MeshContour::viewFrom(const Eigen::Vector3d& eye, int points) const {
  return makeView(finder_->segmentsFrom(eye), points);
}

MeshViews makeMeshViews(const Mesh& mesh, int points, const std::string& cache_folder) {
  if (cache_folder.empty()) return computeViews(mesh, points);
  const ViewFile file(mesh, points, cache_folder);
  if (auto views = file.load()) return *std::move(views);
  const MeshViews views = computeViews(mesh, points);
  file.save(views);
  return views;
}

}  // namespace leap_object_tracker
