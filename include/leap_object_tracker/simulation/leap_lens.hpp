#pragma once

#include <Eigen/Dense>
#include <array>
#include <string>

namespace leap_object_tracker {

/// One eye as the Leap's memory describes it, in pixels of its 640x480 grid.
struct LensRecord {
  double focal_length = 0;                                    ///< [px]
  Eigen::Vector2d center_offset = Eigen::Vector2d::Zero();    ///< [px] from (320, 240)
  std::array<double, 6> radial{};                             ///< k1 k2 k3 over k4 k5 k6
  std::array<double, 2> tangential{};                         ///< p1 p2
  Eigen::Vector3d rotation_vector = Eigen::Vector3d::Zero();  ///< as stored, y up
};

/// One device.
struct LeapUnit {
  std::string name;
  double baseline = 0;  ///< [m]
  LensRecord left;
  LensRecord right;
};

/// Reads a file of config/calibration.
/// @throw std::runtime_error naming the file, the key and what is allowed.
LeapUnit loadLeapUnit(const std::string& path);

/// How the sensor is read out. Fewer rows than 480 are averages of neighbours.
struct SensorMode {
  int width = 0;    ///< [px]
  int height = 0;   ///< [px]
  double rate = 0;  ///< [frames/s]

  double rowsPerPixel() const { return 480.0 / height; }
};

/// One of the six modes by its name, as "640x240". @throw std::runtime_error for any other.
SensorMode sensorMode(const std::string& name);

/// The lens of one eye in one mode: which direction a raw pixel sees, by the polynomial that the
/// device stores, which acts from pixel to ray.
class LeapLens {
 public:
  LeapLens(const LensRecord& record, const SensorMode& mode);

  /// Direction (z = 1) in the eye's raw frame; pixel centres at integers.
  Eigen::Vector2d rawRay(double u, double v) const;
  /// Direction (z = 1) in the rectified frame of the eye. z may be any positive number.
  Eigen::Vector3d ray(double u, double v) const;
  /// Pixel of a point [m] in the rectified frame of the eye.
  /// @return not finite behind the eye or outside the lens.
  Eigen::Vector2d pixel(const Eigen::Vector3d& point_in_eye) const;

  const Eigen::Matrix3d& rectifiedFromRaw() const { return rectified_from_raw_; }
  double fx() const { return fx_; }  ///< [px]
  double fy() const { return fy_; }  ///< [px]
  double cx() const { return cx_; }  ///< [px]
  double cy() const { return cy_; }  ///< [px]
  const SensorMode& mode() const { return mode_; }

 private:
  double radialFactor(double squared_radius) const;
  Eigen::Vector2d rayOfNormalised(const Eigen::Vector2d& raw) const;

  SensorMode mode_;
  double fx_, fy_, cx_, cy_;
  std::array<double, 6> k_;
  double p1_, p2_;
  Eigen::Matrix3d rectified_from_raw_;
};

}  // namespace leap_object_tracker
