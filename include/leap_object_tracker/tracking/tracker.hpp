#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

enum class TrackerState {
  kIdle,       ///< waits for start() or search()
  kSearching,  ///< looks for the object everywhere
  kTracking,   ///< stands by its pose
  kLost,       ///< looks near the last pose, soon everywhere
};

struct PoseEstimate {
  Stamp stamp;              ///< middle of the exposure
  Pose camera_from_object;  ///< left rectified optical frame from object
  /// Of (x, y, z [m], rotation about x, y, z [rad]), all along the fixed axes of the camera, as in
  /// geometry_msgs/PoseWithCovariance. The free axis of a symmetric object has the variance of a
  /// uniform angle, pi^2 / 3, unless features bind it.
  Matrix6d covariance;
  /// Share of the visible contour that edges of the images support, both eyes together, 0 to 1.
  /// With features alone: of the landmarks that leave no doubt of a pose.
  double support = 0;
};

/// What the last call of track() did.
struct TrackerReport {
  TrackerState state = TrackerState::kIdle;
  double effective_share = 0;  ///< effective sample size / particles, 0 to 1
  int particles = 0;           ///< scored in the last layer
  double support = 0;          ///< as in PoseEstimate, also while not tracking
  bool unclear = false;        ///< seen, but not which way it is turned: no pose until that shows
  double edges_ms = 0;         ///< edges and distance transforms
  double filter_ms = 0;        ///< prediction, scoring, resampling, refinement
  double search_ms = 0;        ///< looking for the object, zero while tracking
};

/// Follows one object through rectified stereo frames (README, "How it tracks").
/// Deterministic: the same frames, parameters and seed give the same poses whatever the number of
/// threads. Not to be called from two threads at once.
class Tracker {
 public:
  /// @throw std::invalid_argument for parameters out of range or a camera without focal length.
  /// @throw std::runtime_error for a map of landmarks that cannot be read (FeatureParams).
  Tracker(const TrackerParams& params, const ObjectModel& object,
          const RectifiedStereoCamera& camera);
  ~Tracker();
  Tracker(Tracker&&) noexcept;
  Tracker& operator=(Tracker&&) noexcept;

  /// Tracks from this pose on, with the uncertainty of params.start.
  void start(const Pose& camera_from_object);
  /// Looks for the object anywhere in the working volume.
  void search();
  /// Forgets the object; track() returns nothing.
  void stop();

  /// Takes the next frame. Frames whose stamp is not later than the last one begin a new time.
  /// @param fixed_from_camera where the left eye was at the stamp, if somebody knows: particles
  ///        then move with the camera, and only the object's own motion is unknown.
  /// @return the estimate, only while it is one to stand by.
  std::optional<PoseEstimate> track(const RectifiedStereoFrame& frame,
                                    const std::optional<Pose>& fixed_from_camera = std::nullopt);

  const TrackerReport& report() const;
  /// Writes the landmarks found on the object so far, for FeatureParams::map_file.
  /// @throw std::runtime_error naming the file.
  void saveLandmarks(const std::string& path) const;
  /// camera_from_object of each particle after the last frame.
  std::vector<Pose> particles() const;
  const ObjectModel& object() const;
  const RectifiedStereoCamera& camera() const;
  const TrackerParams& params() const;

  /// Ends of the contour's visible segments in pixels of the left (eye 0) or right (eye 1) image at
  /// a pose: for overlays. Pairs of (u, v).
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> contour(const Pose& camera_from_object,
                                                                   int eye) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace leap_object_tracker
