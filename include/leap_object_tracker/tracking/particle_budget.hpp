#pragma once

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// How many particles the next frame gets: as many as the uncertainty asks for (FilterParams::
/// least_particles), and no more than the time allows (budget_ms).
class ParticleBudget {
 public:
  explicit ParticleBudget(const FilterParams& params) : params_(params) {}

  /// KLD sampling (Fox 2003, equation 7): as many as keep the discretised posterior, with
  /// probability 0.99, within a divergence of 0.05 of the true one. The bins that it occupies are
  /// those that the predicted Gaussian covers.
  /// @param deviations of the prediction, by axis of the camera twist
  /// @param resolution size of a bin in the same units
  int count(const Twist& deviations, const Twist& resolution) const;

  /// @param particles of the last frame, @param filter_ms that moving and scoring them took
  /// @param other_ms that all else of the frame took
  void record(int particles, double filter_ms, double other_ms);

 private:
  FilterParams params_;
  double per_particle_ms_ = 0;  ///< smoothed; zero: not known yet
  double other_ms_ = 0;         ///< smoothed
};

}  // namespace leap_object_tracker
