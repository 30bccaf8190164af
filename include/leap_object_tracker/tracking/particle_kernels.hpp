#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "leap_object_tracker/tracking/measurement_model.hpp"

namespace leap_object_tracker {

// The loops over particles, many at a time; the instruction set is chosen at run time. What happens
// to a particle depends on its index only, not on how a set is cut into calls.

using ParticleTwist = std::array<float, 6>;  ///< camera twist: [m] or [m/s], [rad] or [rad/s]

/// Names a draw of six standard normal numbers for each particle.
struct NormalStream {
  std::uint64_t seed = 0;
  std::uint64_t draw = 0;
};

/// The numbers of one particle. Box and Muller 1958 on a hash of seed, draw and index (triple32 of
/// Ettinger, "Prospecting for hash functions", 2018), the same on every instruction set within
/// rounding.
std::array<float, 6> normalsOf(const NormalStream& stream, std::uint32_t index);

/// A constant acceleration over a time step, and what the camera did meanwhile.
struct ParticleStep {
  float seconds = 0;
  float kept_velocity = 1;       ///< share that damping leaves
  ParticleTwist acceleration{};  ///< standard deviations [m/s^2, rad/s^2]
  bool camera_moved = false;     ///< else the rest is not looked at
  std::array<float, 9> turn{};   ///< new camera from old camera, row by row
  std::array<float, 3> shift{};  ///< [m]
};
void predictParticles(const ParticleStep& step, const NormalStream& stream, std::size_t first,
                      std::size_t count, ParticlePose* poses, ParticleTwist* velocities);

/// Moves poses by twists of these standard deviations.
void spreadParticles(const ParticleTwist& deviations, const NormalStream& stream, std::size_t first,
                     std::size_t count, ParticlePose* poses);

/// A Gaussian of pose and velocity, apart from each other. Roots are row by row: root * root^T is
/// the covariance.
struct ParticleGaussian {
  ParticlePose mean;
  std::array<float, 36> root{};
  ParticleTwist velocity{};
  std::array<float, 36> velocity_root{};
};
void drawParticles(const ParticleGaussian& gaussian, const NormalStream& of_poses,
                   const NormalStream& of_velocities, std::size_t first, std::size_t count,
                   ParticlePose* poses, ParticleTwist* velocities);

/// Sums over poses of the twist from a reference, with the sine for the angle, and of its squares.
struct TwistSums {
  ParticleTwist sums{}, squares{};
};
TwistSums sumTwists(const ParticlePose& reference, const ParticlePose* poses, std::size_t count);

/// exp(power * (log_likelihood - best)) of each. @param weights may be null: only the sums count
struct WeightSums {
  double sum = 0, squares = 0;
};
WeightSums exponentials(const float* log_likelihoods, std::size_t count, float best, float power,
                        float* weights);

}  // namespace leap_object_tracker
