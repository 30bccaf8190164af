#include "leap_object_tracker/tracking/mirrored_poses.hpp"

#include <array>
#include <cmath>
#include <map>

namespace leap_object_tracker {
namespace {

constexpr double kNormalStep = 0.06;          // within which normals belong to one face
constexpr double kLeastArea = 0.08;           // share of the surface that a face must have
constexpr double kLeast = 0.04, kMost = 0.7;  // [rad] from the line of sight

}  // namespace

MirroredPoses::MirroredPoses(const ObjectModel& object) : symmetry_(object.symmetry) {
  double surface = 0;
  std::map<std::array<int, 3>, Face> faces;
  for (const auto& triangle : object.mesh.triangles) {
    const Eigen::Vector3d& a = object.mesh.vertices[triangle[0]];
    const Eigen::Vector3d& b = object.mesh.vertices[triangle[1]];
    const Eigen::Vector3d& c = object.mesh.vertices[triangle[2]];
    const Eigen::Vector3d twice = (b - a).cross(c - a);
    const double area = 0.5 * twice.norm();
    if (area <= 0) continue;
    surface += area;
    const Eigen::Vector3d normal = twice.normalized();
    const auto step = [&](int k) {  // no face of a body along its axes lies at a border
      return static_cast<int>(std::floor(normal[k] / kNormalStep + 0.377));
    };
    Face& face = faces[{step(0), step(1), step(2)}];
    face.normal += area * normal;
    face.centre += area / 3 * (a + b + c);
    face.area += area;
  }
  for (auto& [key, face] : faces) {
    if (face.area < kLeastArea * surface) continue;
    face.normal.normalize();
    face.centre /= face.area;
    faces_.push_back(face);
  }
}

std::vector<Pose> MirroredPoses::of(const Pose& camera_from_object) const {
  std::vector<Pose> poses;
  // Turned about a point of the camera frame, from one direction to another.
  const auto add = [&](const Eigen::Vector3d& point, const Eigen::Vector3d& from,
                       const Eigen::Vector3d& to) {
    const auto turn = Eigen::Quaterniond::FromTwoVectors(from, to);
    const double half = std::atan2(turn.vec().norm(), turn.w());
    if (half > kLeast && half < kMost)
      poses.push_back(Eigen::Translation3d(point) * turn * Eigen::Translation3d(-point) *
                      camera_from_object);
  };
  for (const Face& face : faces_) {
    const Eigen::Vector3d centre = camera_from_object * face.centre;
    const Eigen::Vector3d normal = camera_from_object.linear() * face.normal;
    const Eigen::Vector3d sight = -centre.normalized();
    const double facing = normal.dot(sight);
    if (facing > 0) add(centre, normal, 2 * facing * sight - normal);
  }
  if (symmetry_.hasFreeAxis()) {
    const Eigen::Vector3d centre = camera_from_object.translation();
    const Eigen::Vector3d axis = camera_from_object.linear() * symmetry_.free_axis;
    const Eigen::Vector3d sight = -centre.normalized();
    add(centre, axis, axis - 2 * axis.dot(sight) * sight);
  }
  return poses;
}

}  // namespace leap_object_tracker
