#include "leap_object_tracker/tracking/mirrored_poses.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>

namespace leap_object_tracker {
namespace {

constexpr double kNormalStep = 0.06;          // within which normals belong to one face
constexpr double kLeastArea = 0.08;           // share of the surface that a face must have
constexpr double kLeast = 0.04, kMost = 0.7;  // [rad] from the line of sight

/// The pose turned about a point of the camera frame.
Pose turnedAbout(const Pose& pose, const Eigen::Vector3d& point, const Eigen::Vector3d& axis,
                 double angle) {
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(angle, axis.normalized()).toRotationMatrix();
  Pose turned = pose;
  turned.linear() = turn * pose.linear();
  turned.translation() = point + turn * (pose.translation() - point);
  return turned;
}

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
  const auto add = [&](const Eigen::Vector3d& point, const Eigen::Vector3d& axis, double angle) {
    if (angle > kLeast && angle < kMost)
      poses.push_back(turnedAbout(camera_from_object, point, axis, 2 * angle));
  };
  for (const Face& face : faces_) {
    const Eigen::Vector3d centre = camera_from_object * face.centre;
    const Eigen::Vector3d normal = camera_from_object.linear() * face.normal;
    const Eigen::Vector3d sight = -centre.normalized();
    const Eigen::Vector3d across = normal.cross(sight);
    if (normal.dot(sight) > 0) add(centre, across, std::asin(std::min(1.0, across.norm())));
  }
  if (symmetry_.hasFreeAxis()) {
    const Eigen::Vector3d centre = camera_from_object.translation();
    const Eigen::Vector3d axis = camera_from_object.linear() * symmetry_.free_axis;
    const double along = -axis.dot(centre.normalized());  // towards the camera
    // Turned back towards the image plane, and as far beyond it.
    const Eigen::Vector3d sight = -centre.normalized() * (along < 0 ? -1 : 1);
    add(centre, sight.cross(axis), std::asin(std::min(1.0, std::abs(along))));
  }
  return poses;
}

}  // namespace leap_object_tracker
