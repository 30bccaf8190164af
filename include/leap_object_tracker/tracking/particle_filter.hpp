#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/tracking/measurement_model.hpp"
#include "leap_object_tracker/tracking/particle_kernels.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// Scores a batch of poses: log p(frame | pose) up to a constant.
using BatchScorer =
    std::function<void(const ParticlePose* poses, std::size_t count, float* log_likelihood)>;

/// Leaves new elements of a vector unwritten, which are written before they are read anyway.
template <class T>
struct UnwrittenAllocator : std::allocator<T> {
  template <class U>
  struct rebind {
    using other = UnwrittenAllocator<U>;
  };
  template <class U>
  void construct(U* /*place*/) noexcept {}
  template <class U, class... Arguments>
  void construct(U* place, Arguments&&... arguments) {
    new (static_cast<void*>(place)) U(std::forward<Arguments>(arguments)...);
  }
};
template <class T>
using UnwrittenVector = std::vector<T, UnwrittenAllocator<T>>;

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
  /// `spread` times the particles' own standard deviation. Of large sets, whose survivors would
  /// stand there many times over, it keeps a part (thinned()) until the next prediction.
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

  const UnwrittenVector<ParticlePose>& poses() const { return poses_; }
  /// Of the last scores; as many as poses().
  const std::vector<float>& logLikelihoods() const { return log_likelihoods_; }

  /// From the next prediction on: particles are left out, or some repeated, evenly over the set.
  void setCount(int particles) { wanted_ = static_cast<std::size_t>(particles); }
  /// As set, however many of them a layer keeps.
  int count() const { return static_cast<int>(wanted_); }

  /// How many of so many particles go on after an annealing layer.
  static std::size_t thinned(std::size_t particles);

 private:
  void resize(std::size_t count);
  void score(const BatchScorer& scorer);
  void computeWeights(double power);
  double powerFor(double survival);
  void forgetWeights();
  void drawByWeight(std::size_t count);

  FilterParams params_;
  std::uint64_t draw_ = 0;  ///< number of random draws of the whole set so far
  std::size_t wanted_ = 0;
  UnwrittenVector<ParticlePose> poses_, spare_poses_;
  UnwrittenVector<ParticleTwist> velocities_, spare_velocities_;
  std::vector<float> log_likelihoods_, sample_;
  std::vector<float> weights_;           ///< not normalised
  std::vector<float> bests_;             ///< highest log-likelihoods of pieces of the set
  std::vector<TwistSums> twist_sums_;    ///< of these pieces
  std::vector<WeightSums> weight_sums_;  ///< the same
  std::vector<double> passed_;           ///< weight of all pieces before each
  double effective_share_ = 1;
};

}  // namespace leap_object_tracker
