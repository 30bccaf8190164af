#include "leap_object_tracker/geometry/symmetry.hpp"

#include <cmath>
#include <iomanip>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

constexpr std::size_t kLargestGroup = 120;
constexpr double kSameRotation = 1e-6;

bool contains(const std::vector<Eigen::Matrix3d>& group, const Eigen::Matrix3d& rotation) {
  for (const auto& element : group)
    if ((element - rotation).cwiseAbs().maxCoeff() < kSameRotation) return true;
  return false;
}

void closeGroup(std::vector<Eigen::Matrix3d>& group) {
  for (std::size_t i = 0; i < group.size(); ++i)
    for (std::size_t j = 0; j < group.size(); ++j) {
      const Eigen::Matrix3d product = group[i] * group[j];
      if (contains(group, product)) continue;
      if (group.size() >= kLargestGroup)
        throw std::invalid_argument("symmetry: the axes span more than 120 rotations");
      group.push_back(product);
    }
}

/// The turn about `axis` [rad] that brings `rotation` nearest to the identity: the twist of the
/// swing-twist decomposition.
double twistAngle(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& axis) {
  const Eigen::Quaterniond quaternion(rotation);
  return 2.0 * std::atan2(quaternion.vec().dot(axis), quaternion.w());
}

}  // namespace

Symmetry symmetryFromAxes(const std::vector<Symmetry::Axis>& axes) {
  Symmetry symmetry;
  for (const auto& axis : axes) {
    if (!(axis.direction.norm() > 1e-9))
      throw std::invalid_argument("symmetry: an axis must not be zero");
    if (axis.order < 0) throw std::invalid_argument("symmetry: an order must not be negative");
    const Eigen::Vector3d direction = axis.direction.normalized();
    if (axis.order == 0) {
      if (symmetry.hasFreeAxis() && symmetry.free_axis.cross(direction).norm() > 1e-6)
        throw std::invalid_argument("symmetry: at most one axis may have order 0");
      symmetry.free_axis = direction;
    } else if (axis.order > 1) {
      const double step = 2.0 * M_PI / axis.order;
      const Eigen::Matrix3d rotation = Eigen::AngleAxisd(step, direction).toRotationMatrix();
      if (!contains(symmetry.rotations, rotation)) symmetry.rotations.push_back(rotation);
    }
  }
  closeGroup(symmetry.rotations);
  return symmetry;
}

std::string describe(const Symmetry& symmetry) {
  if (symmetry.trivial()) return "none";
  const std::string turns = std::to_string(symmetry.rotations.size()) + " turns";
  if (!symmetry.hasFreeAxis()) return turns;
  std::ostringstream text;
  text << std::setprecision(3) << "any turn about (" << symmetry.free_axis.x() << ", "
       << symmetry.free_axis.y() << ", " << symmetry.free_axis.z() << ")";
  return symmetry.rotations.size() > 1 ? text.str() + " and " + turns : text.str();
}

Pose nearestEquivalent(const Pose& pose, const Pose& reference, const Symmetry& symmetry) {
  double smallest = std::numeric_limits<double>::infinity();
  Eigen::Matrix3d best = pose.linear();
  for (const auto& rotation : symmetry.rotations) {
    Eigen::Matrix3d candidate = pose.linear() * rotation;
    if (symmetry.hasFreeAxis()) {
      const double angle =
          twistAngle(candidate.transpose() * reference.linear(), symmetry.free_axis);
      candidate = candidate * Eigen::AngleAxisd(angle, symmetry.free_axis).toRotationMatrix();
    }
    const double distance = (candidate - reference.linear()).squaredNorm();
    if (distance < smallest) {
      smallest = distance;
      best = candidate;
    }
  }
  Pose result = pose;
  result.linear() = best;
  return result;
}

double angleBetween(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b, const Symmetry& symmetry) {
  Pose pose_a = Pose::Identity(), pose_b = Pose::Identity();
  pose_a.linear() = a;
  pose_b.linear() = b;
  return angleBetween(nearestEquivalent(pose_b, pose_a, symmetry).linear(), a);
}

}  // namespace leap_object_tracker
