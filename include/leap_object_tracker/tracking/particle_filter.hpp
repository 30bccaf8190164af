#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/tracking/measurement_model.hpp"
#include "leap_object_tracker/tracking/particle_kernels.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// Scores a batch of poses: log p(frame | pose) up to a constant.
using BatchScorer =
    std::function<void(const ParticlePose* poses, std::size_t count, float* log_likelihood)>;

/// Poses with velocities and weights. Knows nothing of images. Every random number depends on the
/// seed, the frame and the particle only, so that the number of threads changes nothing.
class ParticleFilter {
 public:
  explicit ParticleFilter(const FilterParams& params);

  /// Draws all particles from a Gaussian of the camera twist about `mean`.
  void initialize(const Pose& mean, const Matrix6d& covariance, const Twist& velocity,
                  const Matrix6d& velocity_covariance);

  /// Moves each particle with its velocity and an unknown constant acceleration (MotionParams).
  /// @param camera_motion new camera from old camera
  void predict(const MotionParams& motion, double dt, const Pose& camera_motion);

  /// One annealing layer (Deutscher and Reid 2005): weights by the likelihood to the power that
  /// keeps `survival` of the particles effective, resamples systematically, and spreads them by
  /// `spread` times the particles' own standard deviation.
  void anneal(const BatchScorer& score, double survival, double spread);

  /// Weights by the likelihood, full power. Particles stay where they are.
  void weigh(const BatchScorer& score);

  /// Systematic resampling, if the effective share is below `resample_below`.
  void resample(double resample_below);

  /// Puts a share of the particles at draws from a Gaussian about `mean`.
  void inject(double share, const Pose& mean, const Matrix6d& covariance, const Twist& velocity,
              const Matrix6d& velocity_covariance);

  /// Effective sample size / particles, after the last weigh().
  double effectiveShare() const { return effective_share_; }

  const std::vector<ParticlePose>& poses() const { return poses_; }
  const std::vector<float>& logLikelihoods() const { return log_likelihoods_; }
  /// Leaves particles out, or repeats some, evenly over the set.
  void setCount(int particles);

 private:
  void score(const BatchScorer& scorer);
  void normalizeWeights(double power);
  double powerFor(double survival);
  void forgetWeights();
  void drawIndices();

  FilterParams params_;
  std::uint64_t draw_ = 0;  ///< number of random draws of the whole set so far
  std::vector<ParticlePose> poses_, spare_poses_;
  std::vector<ParticleTwist> velocities_, spare_velocities_;
  std::vector<float> log_likelihoods_, sample_, weights_;
  std::vector<std::uint32_t> chosen_;
  std::vector<TwistSums> twist_sums_;    ///< of pieces of the set
  std::vector<WeightSums> weight_sums_;  ///< the same
  double effective_share_ = 1;
};

}  // namespace leap_object_tracker
