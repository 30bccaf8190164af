#include "leap_object_tracker/tracking/particle_budget.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kDivergence = 0.05;
constexpr double kQuantile = 2.326;  // of the standard normal distribution at 0.99
constexpr double kCovered = 4;       // deviations that a Gaussian covers along an axis
constexpr double kSmoothing = 0.2;   // share of the last frame
constexpr int kLeastInTime = 100;    // however late it is

double smoothed(double known, double last) {
  return known > 0 ? known + kSmoothing * (last - known) : last;
}

}  // namespace

int ParticleBudget::count(const Twist& deviations, const Twist& resolution) const {
  double wanted = params_.particles;
  if (params_.least_particles > 0) {
    double bins = 1;
    for (int axis = 0; axis < 6; ++axis)
      bins *= std::max(1.0, kCovered * deviations[axis] / resolution[axis]);
    const double k = std::min(bins, 1e9);
    if (k > 1) {
      const double share = 2 / (9 * (k - 1));
      wanted = (k - 1) / (2 * kDivergence) * std::pow(1 - share + std::sqrt(share) * kQuantile, 3);
    } else {
      wanted = 0;
    }
    const int least = std::min(params_.least_particles, params_.particles);
    wanted = std::clamp(wanted, 1.0 * least, 1.0 * params_.particles);
  }
  if (params_.budget_ms > 0 && per_particle_ms_ > 0) {
    const double in_time = (params_.budget_ms - other_ms_) / per_particle_ms_;
    wanted = std::min(wanted, std::max(in_time, 1.0 * std::min(kLeastInTime, params_.particles)));
  }
  return static_cast<int>(wanted);
}

void ParticleBudget::record(int particles, double filter_ms, double other_ms) {
  per_particle_ms_ = smoothed(per_particle_ms_, filter_ms / std::max(1, particles));
  other_ms_ = smoothed(other_ms_, other_ms);
}

}  // namespace leap_object_tracker
