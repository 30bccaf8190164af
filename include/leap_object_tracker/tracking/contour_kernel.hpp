#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "leap_object_tracker/tracking/contour_model.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"
#include "leap_object_tracker/tracking/measurement_model.hpp"

namespace leap_object_tracker {

/// One eye of a rectified pair as the scoring kernel needs it.
struct EyeView {
  const GainMap* map = nullptr;      ///< nullptr: the eye saw nothing
  float focal_length = 0;            ///< [px]
  float center_u = 0, center_v = 0;  ///< [px]
  float eye_x = 0;                   ///< [m] place of the eye along x of the left eye's frame
};

/// Sums, over both eyes and all visible contour points of each pose, projected length [px] times
/// the gain of the map at the point: a log-likelihood ratio against "no object here", in nats if
/// `nats_per_pixel` is the share of independent pixels along a contour. Points behind or closer
/// than 1 cm to the eye, or outside the image, add nothing; a pose inside the body scores zero.
///
/// The instruction set is chosen at run time.
/// @param points of each view that are scored, a multiple of 16: less than all are an even sample,
/// and the sum is that of the sample
void scoreContours(const ContourModel& model, int points, const EyeView* eyes,
                   std::size_t eye_count, float independent_share, const ParticlePose* poses,
                   std::size_t count, float* log_likelihood);

/// Names of the instruction sets that this machine can run, best first.
std::vector<std::string> contourKernelTargets();
/// Uses only the named one from now on (tests and benchmarks); empty: the best again.
/// @throw std::invalid_argument for a name that is not among contourKernelTargets().
void useContourKernelTarget(const std::string& name);

}  // namespace leap_object_tracker
