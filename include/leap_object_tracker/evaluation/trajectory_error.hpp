#pragma once

#include <array>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/evaluation/trajectory.hpp"
#include "leap_object_tracker/geometry/object_model.hpp"

namespace leap_object_tracker {

struct EvaluationParams {
  double stamp_tolerance = 0.001;  ///< [s] an estimate belongs to a frame at most this far away
  double longest_gap = 0.1;        ///< [s] between true poses that may be interpolated
  int surface_points = 500;        ///< for ADD and ADD-S
  double auc_limit = 0.010;        ///< [m] upper end of the area under the curve
  double wrong_position = 0.010;   ///< [m] an estimate farther off is wrong
  double wrong_rotation = 0.1745;  ///< [rad] an estimate turned more is wrong
  double good_position = 0.005;    ///< [m] what counts as found again
  double good_rotation = 0.0873;   ///< [rad]
  double longest_lag = 0.1;        ///< [s] searched to both sides
  /// Whether turns that the shape does not show count as well, where texture shows them. The
  /// object's frame is then that of the first estimate, among those that look the same.
  bool absolute_orientation = false;
  std::vector<Stamp> frames;  ///< the stamps that a pose was due for; empty: those of the truth
};

/// What one frame says. Without an estimate only the stamp, the distance and the truth are set.
struct FrameError {
  Stamp stamp;
  double distance = 0;  ///< [m] true depth of the object's origin
  Pose truth = Pose::Identity();
  std::optional<Pose> estimate;                      ///< camera_from_object
  Eigen::Vector3d offset = Eigen::Vector3d::Zero();  ///< [m] estimate - truth, camera axes
  Eigen::Vector3d rotation =
      Eigen::Vector3d::Zero();  ///< [rad] from truth to estimate, camera axes
  double position = 0;          ///< [m] length of offset
  double orientation = 0;       ///< [rad] length of rotation
  double add = 0;               ///< [m]
  double add_s = 0;             ///< [m]
  double mssd = 0;              ///< [m]
  std::optional<double> nees;

  bool within(double metres, double radians) const {
    return estimate && position <= metres && orientation <= radians;
  }
};

/// Of a set of errors; not a number if the set is empty.
struct ErrorStatistics {
  double rms = std::numeric_limits<double>::quiet_NaN();
  double mean = std::numeric_limits<double>::quiet_NaN();
  double median = std::numeric_limits<double>::quiet_NaN();
  double p95 = std::numeric_limits<double>::quiet_NaN();
  double largest = std::numeric_limits<double>::quiet_NaN();
};

/// Linear interpolation between the ranks.
ErrorStatistics statisticsOf(std::vector<double> errors);

struct DistanceBand {
  double nearest = 0;   ///< [m]
  double farthest = 0;  ///< [m]
  int frames = 0;
  int with_pose = 0;
  ErrorStatistics position;     ///< [m]
  ErrorStatistics orientation;  ///< [rad]
  double within_1mm_1deg = 0;   ///< share of the frames
  double within_2mm_2deg = 0;
  double within_5mm_5deg = 0;
};

/// Frames without a good pose between two with one.
struct TrackingGap {
  double begin = 0;     ///< [s] since the first frame
  double length = 0;    ///< [s] to the next good pose, or to the last frame
  bool closed = false;  ///< a good pose came again
};

/// Normalised estimation error squared (Bar-Shalom, Li, Kirubarajan 2001, section 5.4.2).
struct NeesReport {
  int frames = 0;
  int degrees_of_freedom = 6;  ///< 5 with a free axis
  double mean = 0;             ///< expected: degrees_of_freedom
  double band_low = 0;         ///< 95 % band of the mean of independent frames
  double band_high = 0;
  double share_inside = 0;  ///< of single frames in their own 95 % band; expected: 0.95
};

struct TrajectoryReport {
  std::vector<FrameError> frames;  ///< every due frame with a true pose
  int with_pose = 0;
  int without_pose = 0;
  int without_truth = 0;  ///< estimates that no true pose could be found for
  double duration = 0;    ///< [s]

  ErrorStatistics position;          ///< [m] of the object's origin
  ErrorStatistics orientation;       ///< [rad] to the nearest equivalent orientation
  std::array<double, 3> axis_rms{};  ///< [m] along the camera's x, y, z
  ErrorStatistics add;    ///< [m] mean distance of surface points (Hinterstoisser et al. 2012)
  ErrorStatistics add_s;  ///< [m] mean distance to the nearest surface point
  ErrorStatistics mssd;   ///< [m] maximum symmetry-aware surface distance (Hodan et al. 2020)
  double add_auc = 0;     ///< area under the accuracy curve, 0 to auc_limit; 1 is best
  double add_s_auc = 0;
  double within_1mm_1deg = 0;  ///< share of all frames
  double within_2mm_2deg = 0;
  double within_5mm_5deg = 0;
  double wrong = 0;                 ///< share of all frames whose pose is wrong
  std::vector<DistanceBand> bands;  ///< those with frames

  /// Allan deviation of the error from frame to frame: noise without bias and slow drift.
  double jitter_position = 0;     ///< [m] root of the sum over three axes
  double jitter_orientation = 0;  ///< [rad]
  std::optional<double> lag;  ///< [s] the estimate is late by; absent if the object hardly moves
  std::optional<double> time_to_first_pose;  ///< [s] from the first frame
  std::optional<double> time_to_good_pose;   ///< [s]
  std::vector<TrackingGap> gaps;             ///< after the first good pose
  std::optional<NeesReport> nees;            ///< if the estimate has covariances
};

/// Points spread evenly over the surface (Halton sequence, area weighted), in the object frame [m].
std::vector<Eigen::Vector3d> surfacePoints(const Mesh& mesh, int count);

/// Judges poses against true ones.
/// @throw std::invalid_argument without a true pose, or when no frame has one (other clock, other
/// run).
TrajectoryReport compare(const Trajectory& estimate, const Trajectory& truth,
                         const ObjectModel& object, const EvaluationParams& params = {});

}  // namespace leap_object_tracker
