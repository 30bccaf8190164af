#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/simulation/scene.hpp"

namespace leap_object_tracker {

/// One frame and the truth about it, in the middle of its exposure.
struct SimulatedFrame {
  struct Body {
    std::string name;
    bool is_object = false;  ///< comes from an object file
    Pose camera_from_body;
  };

  RawStereoFrame raw;
  Pose camera_from_object;  ///< left rectified optical frame from object
  Pose fixed_from_camera;   ///< a frame with x ahead and z up from the left rectified optical frame
  std::vector<Body> others;
  SensorControls controls;  ///< that the frame was taken with
  bool lit = true;
  double left_visible = 0;   ///< share of the side that faces the left eye and is seen, 0 to 1
  double right_visible = 0;  ///< the same for the right eye
};

/// A Leap that looks at a scene. A pull source: each call of next() takes the next frame.
class Simulator {
 public:
  explicit Simulator(const Scene& scene);
  ~Simulator();

  /// @return nothing after the scene's last frame.
  std::optional<SimulatedFrame> next();
  /// Starts again at the first frame; stamps go on.
  void rewind();

  /// Starts again at the first frame, with the object moving otherwise; stamps go on. Cheaper than
  /// a new Simulator: bodies that rest are not rendered anew. Frames then depend on nothing that
  /// was before but, within the noise, on the rays that the resting bodies were seen by.
  /// @param seed of all randomness but the sensor's fixed noise
  void restart(const MotionScript& object_motion, const SensorControls& controls,
               std::uint64_t seed);

  /// In force from the next frame on; to be used with auto exposure off.
  void setControls(const SensorControls& controls);
  const SensorControls& controls() const;

  const Scene& scene() const;
  bool cameraMoves() const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

/// Stamp of the first frame; the same in every run.
Stamp simulationStart();

/// What the simulated device would publish as its calibration: the lens as rational_polynomial.
struct FittedCalibration {
  StereoCalibration calibration;
  double left_rms = 0, right_rms = 0;          ///< [px] of the 480-row grid, central 100 deg
  double left_largest = 0, right_largest = 0;  ///< [px] the same
};

/// Least squares from ray to pixel over the image; exact up to the lens' tangential terms.
FittedCalibration fitCalibration(const LeapUnit& unit, const SensorMode& mode);

}  // namespace leap_object_tracker
