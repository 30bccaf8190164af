#pragma once

#include <array>
#include <vector>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/contour_kernel.hpp"
#include "leap_object_tracker/tracking/contour_model.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"
#include "leap_object_tracker/tracking/measurement_model.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// Scores poses by how well their visible contour lies on Canny edges of both eyes, through the
/// truncated distance transform of the edges of each direction. Two sharpnesses: a blunt one that
/// pulls from afar and a sharp one that tells neighbours apart.
class ContourMeasurement {
 public:
  enum class Sharpness { kBlunt, kSharp };

  ContourMeasurement(const ContourParams& params, Eyes eyes, const RectifiedStereoCamera& camera);

  /// Edges of a frame inside one region of interest an eye. Both eyes at once, on two threads.
  void observe(const RectifiedStereoFrame& frame, const std::array<cv::Rect, 2>& regions);

  /// Log-likelihood ratio of each pose against "no object here" (contour_kernel.hpp). May be called
  /// from several threads.
  void score(const ContourModel& model, Sharpness sharpness, const ParticlePose* poses,
             std::size_t count, float* log_likelihood) const;

  const std::array<EdgeField, 2>& fields() const { return fields_; }

 private:
  ContourParams params_;
  Eyes eyes_;
  RectifiedStereoCamera camera_;
  std::array<EdgeField, 2> fields_;
  std::array<std::array<GainMap, 2>, 2> maps_;  ///< by sharpness, eye
};

}  // namespace leap_object_tracker
