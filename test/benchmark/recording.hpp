#pragma once

#include <string>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/contour_kernel.hpp"
#include "leap_object_tracker/tracking/contour_measurement.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// Some frames of a simulated sequence, ready to be tracked.
struct Recording {
  ObjectModel object;
  StereoCalibration calibration;
  RectifiedStereoCamera camera;
  std::vector<RawStereoFrame> raw;
  std::vector<RectifiedStereoFrame> rectified;
  std::vector<Pose> camera_from_object;  ///< the truth of each frame
};

/// Renders the first frames of config/scenes/SCENE.yaml. The same call again takes no time.
/// @param mode of the sensor, as "640x480"
const Recording& recording(const std::string& scene, const std::string& mode, int frames);

/// Frame 0 of a recording, observed around the true pose, as the tracker does with `params`.
class Observation {
 public:
  explicit Observation(const Recording& recording, const ContourParams& params = {});

  /// Poses spread about the true one as the default filter spreads its particles.
  std::vector<ParticlePose> particles(std::size_t count) const;
  /// What the kernel needs of both eyes, for the sharp likelihood.
  std::array<EyeView, 2> eyes() const;
  const std::array<EdgeField, 2>& fields() const { return fields_; }
  const std::array<cv::Rect, 2>& regions() const { return regions_; }
  const Recording& frames() const { return recording_; }

 private:
  const Recording& recording_;
  std::array<cv::Rect, 2> regions_;
  std::array<EdgeField, 2> fields_;
  std::array<GainMap, 2> maps_;
};

}  // namespace leap_object_tracker
