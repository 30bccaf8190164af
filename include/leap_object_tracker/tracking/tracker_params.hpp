#pragma once

#include <cstdint>
#include <string>

#include "leap_object_tracker/tracking/feature_params.hpp"

namespace leap_object_tracker {

enum class Eyes { kBoth, kLeft, kRight };

/// What a pose is measured by.
enum class Measurement {
  kContour,
  kFeature,  ///< the contour only finds the object and leads until landmarks carry
  kBoth,
  kAuto,  ///< the contour, and features while the object has texture that they hold on to
};

/// How the object may move between frames.
struct MotionParams {
  double linear_acceleration = 6.0;    ///< [m/s^2] standard deviation of the unknown acceleration
  double angular_acceleration = 40.0;  ///< [rad/s^2] the same, of rotation
  double velocity_damping = 4.0;       ///< [1/s] how fast a velocity that nobody sees dies away
};

/// The particle set.
struct FilterParams {
  int particles = 1000;     ///< at most; above 10000, one of 4 goes on to the next layer
  int least_particles = 0;  ///< where the pose is well known; 0: always as many
  double budget_ms = 0;     ///< [ms] for a frame: fewer particles if it takes longer; 0: no limit
  int layers = 2;           ///< annealing layers, from blunt to sharp likelihood
  double resample_below = 0.5;  ///< share of effective particles; 1 after every frame
  std::uint64_t seed = 1;
};

/// The contour likelihood.
struct ContourParams {
  int points = 96;             ///< contour points scored a particle and eye
  double truncation = 8.0;     ///< [px] edges farther away count as no edge
  double outlier_share = 0.3;  ///< prior share of contour points that no edge supports
  double edge_sigma = 0.4;     ///< [px] noise of one sub-pixel edge
  double edge_radius =
      0.0002;  ///< [m] rounding of edges (of a mesh: of its creases); none is sharp
  /// How a curved body, lit from beside the camera, darkens where it turns away: 1 as a matt one
  /// does (Lambert), whose limb then shows inside of its true place; 0 not at all.
  double limb_darkening = 1;
  std::string cache_folder;  ///< views of meshes are kept here between runs; empty: nowhere
};

/// Where the object may be.
struct VolumeParams {
  double nearest = 0.03;   ///< [m] depth of the object's origin
  double farthest = 0.65;  ///< [m]
};

/// Uncertainty of a start pose.
struct StartParams {
  double position_sigma = 0.004;  ///< [m] each axis
  double rotation_sigma_deg = 4;  ///< [deg] each axis
};

/// All that rules a Tracker. Defaults are written here and nowhere else.
struct TrackerParams {
  Measurement measurement = Measurement::kAuto;
  Eyes eyes = Eyes::kBoth;
  int threads = 2;
  MotionParams motion;
  FilterParams filter;
  ContourParams contour;
  FeatureParams feature;
  VolumeParams volume;
  StartParams start;
};

}  // namespace leap_object_tracker
