#include "leap_object_tracker/simulation/leap_lens.hpp"

#include <cmath>
#include <limits>
#include <map>
#include <stdexcept>

#include "yaml_section.hpp"

namespace leap_object_tracker {
namespace {

/// Cayley's map of a vector q: a rotation by 2 atan |q| about q.
Eigen::Matrix3d cayley(const Eigen::Vector3d& q) {
  return Eigen::Quaterniond(1, q.x(), q.y(), q.z()).normalized().toRotationMatrix();
}

LensRecord readEye(YamlSection section) {
  LensRecord eye;
  section.require("focal_length", eye.focal_length, "a number of pixels");
  section.readNumber("focal_length", eye.focal_length, 50, 500, "px of the 640x480 grid");
  std::vector<double> offset, radial, tangential{0, 0};
  section.require("center_offset", offset, "[u, v] in pixels from (320, 240)");
  section.require("radial", radial, "six numbers: k1 k2 k3 k4 k5 k6");
  section.read("tangential", tangential, "two numbers: p1 p2");
  section.readVector("rotation", eye.rotation_vector, 0.2, "rad");
  section.finish();
  if (offset.size() != 2) section.complain("center_offset", "expected two numbers");
  if (radial.size() != 6) section.complain("radial", "expected six numbers");
  if (tangential.size() != 2) section.complain("tangential", "expected two numbers");
  eye.center_offset = {offset[0], offset[1]};
  std::copy(radial.begin(), radial.end(), eye.radial.begin());
  std::copy(tangential.begin(), tangential.end(), eye.tangential.begin());
  return eye;
}

}  // namespace

LeapUnit loadLeapUnit(const std::string& path) {
  YamlSection file(loadYaml(path, "calibration file"), "calibration file '" + path + "'");
  LeapUnit unit;
  file.require("name", unit.name, "a word");
  file.require("baseline", unit.baseline, "a number of metres");
  file.readNumber("baseline", unit.baseline, 0.001, 1, "m");
  unit.left = readEye(file.section("left"));
  unit.right = readEye(file.section("right"));
  file.finish();
  return unit;
}

SensorMode sensorMode(const std::string& name) {
  static const std::map<std::string, SensorMode> kModes{
      {"640x480", {640, 480, 57.5}}, {"640x240", {640, 240, 115}}, {"640x120", {640, 120, 214}},
      {"752x480", {752, 480, 50}},   {"752x240", {752, 240, 100}}, {"752x120", {752, 120, 190}}};
  const auto found = kModes.find(name);
  if (found != kModes.end()) return found->second;
  std::string list;
  for (const auto& mode : kModes) list += (list.empty() ? "" : ", ") + mode.first;
  throw std::runtime_error("unknown sensor mode '" + name + "'; the Leap has " + list);
}

LeapLens::LeapLens(const LensRecord& record, const SensorMode& mode)
    : mode_(mode),
      fx_(record.focal_length),
      fy_(record.focal_length / mode.rowsPerPixel()),
      cx_(mode.width / 2 + record.center_offset.x()),
      cy_((240 + record.center_offset.y() + 0.5) / mode.rowsPerPixel() - 0.5),
      k_(record.radial),
      p1_(record.tangential[0]),
      p2_(record.tangential[1]),
      // The stored vector is y up and as long as the angle; the optical frame is y down.
      rectified_from_raw_(
          cayley(0.5 * Eigen::Vector3d(-record.rotation_vector.x(), record.rotation_vector.y(),
                                       -record.rotation_vector.z()))) {}

double LeapLens::radialFactor(double t) const {
  return (1 + t * (k_[0] + t * (k_[1] + t * k_[2]))) / (1 + t * (k_[3] + t * (k_[4] + t * k_[5])));
}

Eigen::Vector2d LeapLens::rayOfNormalised(const Eigen::Vector2d& raw) const {
  const double x = raw.x(), y = raw.y(), t = raw.squaredNorm();
  const double radial = radialFactor(t);
  return {x * radial + 2 * p1_ * x * y + p2_ * (t + 2 * x * x),
          y * radial + p1_ * (t + 2 * y * y) + 2 * p2_ * x * y};
}

Eigen::Vector2d LeapLens::rawRay(double u, double v) const {
  return rayOfNormalised({(u - cx_) / fx_, (v - cy_) / fy_});
}

Eigen::Vector3d LeapLens::ray(double u, double v) const {
  const Eigen::Vector2d raw = rawRay(u, v);
  return rectified_from_raw_ * Eigen::Vector3d(raw.x(), raw.y(), 1);
}

Eigen::Vector2d LeapLens::pixel(const Eigen::Vector3d& point_in_eye) const {
  constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
  constexpr double kLensEdge = 3.5;  // the radial part grows steadily up to here
  const Eigen::Vector3d in_raw = rectified_from_raw_.transpose() * point_in_eye;
  if (!(in_raw.z() > 0)) return {kNone, kNone};
  const Eigen::Vector2d target = in_raw.head<2>() / in_raw.z();
  const double length = target.norm();
  if (length > kLensEdge * radialFactor(kLensEdge * kLensEdge)) return {kNone, kNone};

  double low = 0, high = kLensEdge;
  for (int i = 0; i < 30; ++i) {
    const double middle = (low + high) / 2;
    (middle * radialFactor(middle * middle) < length ? low : high) = middle;
  }
  Eigen::Vector2d raw = length > 0 ? Eigen::Vector2d(target * (low / length)) : target;
  for (int i = 0; i < 8; ++i) {  // Newton's method
    constexpr double kStep = 1e-6;
    const Eigen::Vector2d here = rayOfNormalised(raw);
    Eigen::Matrix2d jacobian;
    jacobian.col(0) = (rayOfNormalised(raw + Eigen::Vector2d(kStep, 0)) - here) / kStep;
    jacobian.col(1) = (rayOfNormalised(raw + Eigen::Vector2d(0, kStep)) - here) / kStep;
    raw -= jacobian.inverse() * (here - target);
  }
  return {cx_ + fx_ * raw.x(), cy_ + fy_ * raw.y()};
}

}  // namespace leap_object_tracker
