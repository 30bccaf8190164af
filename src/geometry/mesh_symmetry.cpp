#include "leap_object_tracker/geometry/mesh_symmetry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <stdexcept>

#include "leap_object_tracker/geometry/signed_distance.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kTolerance = 0.015;      // of the radius, by which a turned point may be off
constexpr double kOffAxis = 0.02;         // of the radius, of the surface's centre
constexpr int kPoints = 4000;             // on the surface, and as many vertices at most
constexpr int kDirections = 4000;         // over the sphere, about 3 deg apart
constexpr double kNotPrincipal = 0.05;    // of the surface's second moments
constexpr std::size_t kGlance = 100;      // points for the first look at a direction
constexpr std::size_t kLook = 500;        // points to refine one
constexpr double kPromising = 0.05;       // of the radius: mean distance after a turn
constexpr std::size_t kMostRefined = 40;  // directions of one turn
constexpr std::array<int, 4> kPrimes{2, 3, 5, 7};
constexpr int kMostTurns = 12;                                       // else any angle is tried
constexpr std::array<double, 5> kAnyAngle{0.7, 1.0, 1.7, 2.3, 2.9};  // [rad]
constexpr double kFirstStep = 1.6 * M_PI / 180, kLastStep = 0.01 * M_PI / 180;
constexpr double kSameAxis = 3 * M_PI / 180;   // [rad] between axes
constexpr double kAligned = 0.5 * M_PI / 180;  // [rad] from a direction of the frame

Matrix3d turnAbout(const Vector3d& axis, double angle) {
  return Eigen::AngleAxisd(angle, axis).toRotationMatrix();
}

bool sameAxis(const Vector3d& a, const Vector3d& b) {
  return a.cross(b).norm() < std::sin(kSameAxis);
}

bool across(const Vector3d& a, const Vector3d& b) {
  return std::abs(a.dot(b)) < std::sin(kSameAxis);
}

class AxisFinder {
 public:
  explicit AxisFinder(const Mesh& mesh)
      : radius_(radiusOf(mesh)), points_(pointsOn(mesh, kPoints)) {
    findPrincipalDirections();
    if (principal_.empty()) return;
    distance_.emplace(asObject(mesh));
    // Few points fall on what is small and sticks out.
    const std::size_t step = mesh.vertices.size() / kPoints + 1;
    for (std::size_t i = 0; i < mesh.vertices.size(); i += step)
      points_.push_back(mesh.vertices[i]);
  }

  std::vector<Symmetry::Axis> axes() const {
    std::vector<Symmetry::Axis> found;
    for (const int prime : kPrimes)
      for (const Vector3d& start : promising(prime)) {
        const auto known = [&](const Vector3d& direction) {
          return std::any_of(found.begin(), found.end(), [&](const Symmetry::Axis& axis) {
            return sameAxis(axis.direction, direction);
          });
        };
        if (known(start)) continue;
        const std::optional<Vector3d> axis = exactAxis(start, prime);
        if (axis && !known(*axis)) found.push_back({*axis, orderOf(*axis)});
      }
    return found;
  }

 private:
  static ObjectModel asObject(const Mesh& mesh) {
    ObjectModel object;
    object.shape = Shape::kMesh;
    object.mesh = mesh;
    return object;
  }

  /// Along which an axis of symmetry may lie.
  void findPrincipalDirections() {
    Vector3d center = Vector3d::Zero();
    Matrix3d moments = Matrix3d::Zero();
    for (const Vector3d& point : points_) {
      center += point / static_cast<double>(points_.size());
      moments += point * point.transpose() / static_cast<double>(points_.size());
    }
    const auto consider = [&](const Vector3d& direction) {
      const auto beside = [&](const Vector3d& v) {
        return (v - direction * direction.dot(v)).norm();
      };
      if (beside(moments * direction) < kNotPrincipal * moments.trace() &&
          beside(center) < kOffAxis * radius_)
        principal_.push_back(direction);
    };
    for (int axis = 0; axis < 3; ++axis) consider(Vector3d::Unit(axis));
    for (int i = 0; i < kDirections / 2; ++i) consider(evenDirection(i, kDirections));
  }

  double off(const Matrix3d& turn, const Vector3d& point) const {
    return std::abs(static_cast<double>((*distance_)((turn * point).cast<float>())));
  }

  double meanOff(const Matrix3d& turn, std::size_t count) const {
    count = std::min(count, points_.size());
    double sum = 0;
    for (std::size_t i = 0; i < count; ++i) sum += off(turn, points_[i * points_.size() / count]);
    return sum / static_cast<double>(count);
  }

  bool mapsOnItself(const Matrix3d& turn) const {
    return std::all_of(points_.begin(), points_.end(), [&](const Vector3d& point) {
      return off(turn, point) < kTolerance * radius_;
    });
  }

  /// Directions about which such a turn may bring the surface to itself, the best ones first.
  std::vector<Vector3d> promising(int turns) const {
    std::vector<std::pair<double, Vector3d>> all;
    for (const Vector3d& direction : principal_) {
      const double mean = meanOff(turnAbout(direction, 2 * M_PI / turns), kGlance);
      if (mean < kPromising * radius_) all.emplace_back(mean, direction);
    }
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& a, const auto& b) { return a.first < b.first; });
    std::vector<Vector3d> kept;
    for (const auto& [mean, direction] : all) {
      if (kept.size() >= kMostRefined) break;
      if (std::none_of(kept.begin(), kept.end(), [&](const Vector3d& other) {
            return other.cross(direction).norm() < 2 * std::sin(kSameAxis);
          }))
        kept.push_back(direction);
    }
    return kept;
  }

  /// The direction nearby about which the surface comes nearest to itself, if it does.
  std::optional<Vector3d> exactAxis(Vector3d axis, int turns) const {
    const double angle = 2 * M_PI / turns;
    double best = meanOff(turnAbout(axis, angle), kLook);
    for (double step = kFirstStep; step > kLastStep;) {
      const Vector3d first = axis.unitOrthogonal(), second = axis.cross(first);
      Vector3d better = axis;
      for (const Vector3d& way : {first, second, Vector3d(-first), Vector3d(-second)}) {
        const Vector3d moved = (axis + step * way).normalized();
        const double mean = meanOff(turnAbout(moved, angle), kLook);
        if (mean < best) best = mean, better = moved;
      }
      if (better == axis) step /= 2;
      axis = better;
    }
    const Vector3d straight = aligned(axis);
    if (mapsOnItself(turnAbout(straight, angle))) return straight;
    if (mapsOnItself(turnAbout(axis, angle))) return axis;
    return std::nullopt;
  }

  /// An edge or a diagonal of the frame, if it is close.
  static Vector3d aligned(const Vector3d& axis) {
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        for (int z = -1; z <= 1; ++z) {
          const Vector3d direction = Vector3d(x, y, z).normalized();
          if (direction.dot(axis) > std::cos(kAligned)) return direction;
        }
    return axis;
  }

  int orderOf(const Vector3d& axis) const {
    if (std::all_of(kAnyAngle.begin(), kAnyAngle.end(),
                    [&](double angle) { return mapsOnItself(turnAbout(axis, angle)); }))
      return 0;
    for (int turns = kMostTurns; turns > 1; --turns)
      if (mapsOnItself(turnAbout(axis, 2 * M_PI / turns))) return turns;
    return 1;
  }

  double radius_;
  std::vector<Vector3d> points_;     ///< of the surface
  std::vector<Vector3d> principal_;  ///< unit vectors
  std::optional<SignedDistance> distance_;
};

}  // namespace

Symmetry symmetryOf(const Mesh& mesh) {
  std::vector<Symmetry::Axis> axes = AxisFinder(mesh).axes();
  if (axes.empty()) return {};
  // Any angle first, then the most turns.
  std::stable_sort(axes.begin(), axes.end(), [](const Symmetry::Axis& a, const Symmetry::Axis& b) {
    return (a.order == 0 ? kMostTurns + 1 : a.order) > (b.order == 0 ? kMostTurns + 1 : b.order);
  });
  const Symmetry::Axis& main = axes.front();
  std::vector<Symmetry::Axis> pair{main};
  bool oblique = false;  // axes neither along nor across
  for (const Symmetry::Axis& axis : axes) {
    if (sameAxis(axis.direction, main.direction)) continue;
    if (!across(axis.direction, main.direction))
      oblique = true;
    else if (pair.size() == 1)
      pair.push_back({axis.direction - main.direction * main.direction.dot(axis.direction), 2});
  }
  if (oblique && main.order != 0) {
    try {
      return symmetryFromAxes(axes);
    } catch (const std::invalid_argument&) {  // they do not fit each other exactly
    }
  }
  return symmetryFromAxes(pair);
}

}  // namespace leap_object_tracker
