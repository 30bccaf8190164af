#include "leap_object_tracker/tracking/contour_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "contour_segments.hpp"
#include "mesh_views.hpp"
#include "rounded_edge.hpp"

namespace leap_object_tracker {

class ContourModel::Table {
 public:
  virtual ~Table() = default;
  virtual ViewChoice choose(const Eigen::Vector3f& eye) const = 0;
  virtual int size() const = 0;
  virtual std::optional<ContourView> exactView(const Eigen::Vector3d& /*eye*/) const {
    return std::nullopt;
  }
};

namespace {

/// One view for each set of visible faces of a convex polyhedron.
class PolyhedronTable : public ContourModel::Table {
 public:
  PolyhedronTable(const Mesh& mesh, double edge_radius, int points) {
    const std::vector<Edge> edges = findEdges(mesh, edge_radius);
    if (faces_.size() > kMostFaces)
      throw std::invalid_argument(
          "contour: a polyhedron has more faces than a table of their sets");
    for (std::size_t i = 0; i < faces_.size(); ++i) {
      const auto k = static_cast<Eigen::Index>(i);
      normals_x_[k] = faces_[i].x();
      normals_y_[k] = faces_[i].y();
      normals_z_[k] = faces_[i].z();
      offsets_[k] = faces_[i].w();
    }
    const std::size_t sets = std::size_t{1} << faces_.size();
    views_.resize(sets);
    for (std::size_t visible = 1; visible < sets; ++visible)
      views_[visible] = makeView(visibleSegments(edges, visible), points);
  }

  ViewChoice choose(const Eigen::Vector3f& eye) const override {
    // Without branches: particles see this set of faces or that one, and nobody foretells which.
    const Planes below =
        offsets_ - normals_x_ * eye.x() - normals_y_ * eye.y() - normals_z_ * eye.z();
    std::array<std::uint32_t, kMostFaces> bits;
    std::memcpy(bits.data(), below.data(), sizeof bits);
    std::size_t visible = 0;
    for (std::size_t i = 0; i < kMostFaces; ++i) visible |= std::size_t{bits[i] >> 31} << i;
    return {visible == 0 ? nullptr : &views_[visible], 1, 0};
  }

  int size() const override { return static_cast<int>(views_.size()) - 1; }

 private:
  struct Edge {
    Eigen::Vector3d start, end;
    std::array<std::size_t, 2> faces;
  };

  std::size_t faceOf(const Eigen::Vector3d& normal, double offset) {
    const Eigen::Vector4f plane(static_cast<float>(normal.x()), static_cast<float>(normal.y()),
                                static_cast<float>(normal.z()), static_cast<float>(offset));
    for (std::size_t i = 0; i < faces_.size(); ++i)
      if ((faces_[i] - plane).cwiseAbs().maxCoeff() < 1e-4F) return i;
    faces_.push_back(plane);
    return faces_.size() - 1;
  }

  std::vector<Edge> findEdges(const Mesh& mesh, double edge_radius) {
    std::vector<Edge> edges;
    for (const auto& adjacency : adjacentTriangles(mesh)) {
      const Eigen::Vector3d& start = mesh.vertices[adjacency.start];
      const Eigen::Vector3d& end = mesh.vertices[adjacency.end];
      std::array<std::size_t, 2> sides{};
      std::array<Eigen::Vector3d, 2> normals;
      for (std::size_t side = 0; side < 2; ++side) {
        normals[side] = triangleNormal(mesh, static_cast<std::size_t>(adjacency.triangles[side]));
        sides[side] = faceOf(normals[side], normals[side].dot(start));
      }
      if (sides[0] == sides[1]) continue;
      const Eigen::Vector3d shift = roundedOutlineShift(normals[0], normals[1], edge_radius);
      edges.push_back({start + shift, end + shift, sides});
    }
    return edges;
  }

  std::vector<ContourSegment> visibleSegments(const std::vector<Edge>& edges,
                                              std::size_t visible) const {
    std::vector<ContourSegment> segments;
    for (const Edge& edge : edges) {
      const bool first = (visible >> edge.faces[0] & 1) != 0;
      const bool second = (visible >> edge.faces[1] & 1) != 0;
      if (!first && !second) continue;
      Eigen::Vector3d outward = Eigen::Vector3d::Zero(), hidden = Eigen::Vector3d::Zero();
      if (first != second) {
        // In the plane of the visible face, away from it: the side on which the hidden face looks.
        const Eigen::Vector3d seen = faces_[edge.faces[first ? 0 : 1]].head<3>().cast<double>();
        hidden = faces_[edge.faces[first ? 1 : 0]].head<3>().cast<double>();
        outward = (hidden - seen * seen.dot(hidden)).normalized();
      }
      ContourSegment segment{edge.start, edge.end, outward};
      segment.hidden = hidden;
      for (std::size_t side = 0; side < 2; ++side)
        if (side == 0 ? first : second)
          segment.faces[side] = faces_[edge.faces[side]].head<3>().cast<double>();
      if (first && second) {
        const Eigen::Vector3d &own = segment.faces[0], &other = segment.faces[1];
        segment.orderFaces(own * own.dot(other) - other);
      }
      segments.push_back(segment);
    }
    return segments;
  }

  static constexpr std::size_t kMostFaces = 8;
  using Planes = Eigen::Array<float, kMostFaces, 1>;

  std::vector<Eigen::Vector4f> faces_;  ///< normal, offset: n * x = offset on the face
  /// The same side by side, all faces at once; zero where there is no face.
  Planes normals_x_ = Planes::Zero(), normals_y_ = Planes::Zero(), normals_z_ = Planes::Zero();
  Planes offsets_ = Planes::Zero();
  std::vector<ContourView> views_;
};

/// Views of an upright cylinder for an eye in the half plane y = 0, x > 0.
class CylinderTable : public ContourModel::Table {
 public:
  CylinderTable(double radius, double height, double edge_radius, int points)
      : radius_(static_cast<float>(radius)), half_height_(static_cast<float>(height / 2)) {
    for (const int cap : {-1, 0, 1})
      for (int step = 0; step < kLimbSteps; ++step)
        views_.push_back(makeView(
            segments(radius, height, edge_radius, cap, (step + 0.5) * (M_PI / 2) / kLimbSteps),
            points));
    for (const int cap : {-1, 1})
      axial_.push_back(makeView(axial(radius, height, edge_radius, cap), points));
  }

  ViewChoice choose(const Eigen::Vector3f& eye) const override {
    const float across = std::hypot(eye.x(), eye.y());
    const int cap = eye.z() > half_height_ ? 1 : eye.z() < -half_height_ ? -1 : 0;
    if (across <= radius_) {
      if (cap == 0) return {};
      return {&axial_[cap < 0 ? 0 : 1], 1, 0};
    }
    const float limb = std::acos(radius_ / across);
    const int step = std::min(
        static_cast<int>(limb * (kLimbSteps / (static_cast<float>(M_PI) / 2))), kLimbSteps - 1);
    return {&views_[static_cast<std::size_t>((cap + 1) * kLimbSteps + step)], eye.x() / across,
            eye.y() / across};
  }

  int size() const override { return static_cast<int>(views_.size() + axial_.size()); }

 private:
  static constexpr int kLimbSteps = 45;
  static constexpr int kRimPieces = 180;

  /// What an eye sees of a piece of the rim between side and cap.
  struct Rim {
    bool visible = false;
    Eigen::Vector3d outward = Eigen::Vector3d::Zero();
    std::array<Eigen::Vector3d, 2> faces{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()};
  };

  /// @param limb angle [rad] from the eye's direction to where the side turns away
  static std::vector<ContourSegment> segments(double radius, double height, double edge_radius,
                                              int cap, double limb) {
    std::vector<ContourSegment> all;
    for (const double side : {-1.0, 1.0}) {
      const Eigen::Vector3d normal(std::cos(limb), side * std::sin(limb), 0);
      const Eigen::Vector3d foot = radius * normal, up(0, 0, height / 2);
      all.push_back({foot - up, foot + up, normal, radius});
    }
    for (const int end : {-1, 1})
      addRim(
          radius, height, edge_radius, end,
          [&](double angle, const Eigen::Vector3d& radial) {
            Rim rim;
            const bool side_seen = std::abs(angle) < limb, cap_seen = cap == end;
            rim.visible = side_seen || cap_seen;
            if (side_seen != cap_seen)
              rim.outward = side_seen ? Eigen::Vector3d(0, 0, end) : radial;
            if (side_seen) rim.faces[0] = radial;
            if (cap_seen) rim.faces[1] = Eigen::Vector3d(0, 0, end);
            return rim;
          },
          all);
    return all;
  }

  static std::vector<ContourSegment> axial(double radius, double height, double edge_radius,
                                           int cap) {
    std::vector<ContourSegment> all;
    addRim(
        radius, height, edge_radius, cap,
        [cap](double, const Eigen::Vector3d& radial) {
          Rim rim;
          rim.visible = true;
          rim.outward = radial;
          rim.faces[1] = Eigen::Vector3d(0, 0, cap);
          return rim;
        },
        all);
    return all;
  }

  template <class Judge>
  static void addRim(double full_radius, double height, double edge_radius, int end,
                     const Judge& judge, std::vector<ContourSegment>& all) {
    const Eigen::Vector3d shift =
        roundedOutlineShift(Eigen::Vector3d::UnitX(), end * Eigen::Vector3d::UnitZ(), edge_radius);
    const double radius = full_radius + shift.x(), z = end * height / 2 + shift.z();
    const auto at = [&](double angle) {
      return Eigen::Vector3d(radius * std::cos(angle), radius * std::sin(angle), z);
    };
    const double piece = 2 * M_PI / kRimPieces;
    for (int i = 0; i < kRimPieces; ++i) {
      const double angle = -M_PI + (i + 0.5) * piece;
      const Eigen::Vector3d radial(std::cos(angle), std::sin(angle), 0);
      const Rim rim = judge(angle, radial);
      if (!rim.visible) continue;
      all.push_back({at(angle - piece / 2), at(angle + piece / 2), rim.outward});
      all.back().faces = rim.faces;
      if (!rim.outward.isZero()) {  // it looks off the face that is seen: as the other one does
        all.back().hidden = rim.outward;
        continue;
      }
      all.back().orderFaces(Eigen::Vector3d(0, 0, -end));
    }
  }

  float radius_, half_height_;
  std::vector<ContourView> views_, axial_;
};

/// Nearest view of a view sphere, looked up by the direction's place on a cube.
class MeshTable : public ContourModel::Table {
 public:
  MeshTable(const Mesh& mesh, int points, MeshViews views)
      : points_(points), contour_(mesh), views_(std::move(views)) {
    lookup_.resize(6 * kSide * kSide);
    for (int cell = 0; cell < 6 * kSide * kSide; ++cell) {
      const Eigen::Vector3f direction = directionOfCell(cell);
      float best = -2;
      for (std::size_t i = 0; i < views_.directions.size(); ++i) {
        const float cosine = direction.dot(views_.directions[i]);
        if (cosine > best) best = cosine, lookup_[static_cast<std::size_t>(cell)] = i;
      }
    }
  }

  ViewChoice choose(const Eigen::Vector3f& eye) const override {
    const float distance = eye.norm();
    if (!(distance > views_.nearest)) return {};
    std::size_t shell = 0;
    while (shell < views_.shell_limits.size() && distance > views_.shell_limits[shell]) ++shell;
    const std::size_t direction = lookup_[static_cast<std::size_t>(cellOf(eye))];
    return {&views_.views[shell * views_.directions.size() + direction], 1, 0};
  }

  int size() const override { return static_cast<int>(views_.views.size()); }

  std::optional<ContourView> exactView(const Eigen::Vector3d& eye) const override {
    return contour_.viewFrom(eye, points_);
  }

 private:
  static constexpr int kSide = 48;

  static int cellOf(const Eigen::Vector3f& v) {
    int axis = 0;
    const float largest = v.cwiseAbs().maxCoeff(&axis);
    const float a = v[(axis + 1) % 3] / largest, b = v[(axis + 2) % 3] / largest;
    const auto index = [](float x) {
      return std::clamp(static_cast<int>((x + 1) * (kSide / 2.0F)), 0, kSide - 1);
    };
    return ((2 * axis + (v[axis] < 0 ? 1 : 0)) * kSide + index(a)) * kSide + index(b);
  }

  static Eigen::Vector3f directionOfCell(int cell) {
    const int face = cell / (kSide * kSide), axis = face / 2;
    Eigen::Vector3f v;
    v[axis] = face % 2 == 0 ? 1.0F : -1.0F;
    v[(axis + 1) % 3] = (cell / kSide % kSide + 0.5F) / (kSide / 2.0F) - 1;
    v[(axis + 2) % 3] = (cell % kSide + 0.5F) / (kSide / 2.0F) - 1;
    return v.normalized();
  }

  int points_;
  MeshContour contour_;
  MeshViews views_;
  std::vector<std::size_t> lookup_;
};

std::unique_ptr<ContourModel::Table> makeTable(const ObjectModel& object, int points,
                                               double edge_radius,
                                               const std::string& cache_folder) {
  switch (object.shape) {
    case Shape::kBox:
    case Shape::kPrism:
      return std::make_unique<PolyhedronTable>(object.mesh, edge_radius, points);
    case Shape::kCylinder:
      return std::make_unique<CylinderTable>(object.size.x(), object.size.y(), edge_radius, points);
    case Shape::kMesh:
      break;
  }
  return std::make_unique<MeshTable>(object.mesh, points,
                                     makeMeshViews(object.mesh, points, cache_folder));
}

}  // namespace

ContourModel::ContourModel(const ObjectModel& object, int points, double edge_radius,
                           const std::string& cache_folder)
    : points_((std::max(points, 1) + 15) / 16 * 16),
      radius_(radiusOf(object.mesh)),
      table_(makeTable(object, points_, edge_radius, cache_folder)) {}

ContourModel::~ContourModel() = default;
ContourModel::ContourModel(ContourModel&&) noexcept = default;

ViewChoice ContourModel::choose(const Eigen::Vector3f& eye_in_object) const {
  return table_->choose(eye_in_object);
}

std::optional<ContourView> ContourModel::exactView(const Eigen::Vector3d& eye_in_object) const {
  return table_->exactView(eye_in_object);
}

int ContourModel::viewCount() const { return table_->size(); }

}  // namespace leap_object_tracker
