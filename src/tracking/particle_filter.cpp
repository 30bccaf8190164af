#include "leap_object_tracker/tracking/particle_filter.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "leap_object_tracker/tracking/particle_kernels.hpp"
#include "tracking/random.hpp"

namespace leap_object_tracker {
namespace {

constexpr std::size_t kGrain = 256;
constexpr std::size_t kSample = 4096;  // particles that the power of a layer is chosen by, at most
constexpr std::size_t kThinnedFrom = 10000;  // particles; larger sets are thinned by a layer
constexpr std::size_t kThinned = 4;          // to one of so many

std::size_t piecesOf(std::size_t count) { return (count + kGrain - 1) / kGrain; }

/// Calls body(first, count) for pieces of a set, the same ones whatever the number of threads.
template <class Body>
void forPieces(std::size_t count, const Body& body) {
  tbb::parallel_for(std::size_t{0}, piecesOf(count), [&](std::size_t piece) {
    body(piece * kGrain, std::min(kGrain, count - piece * kGrain));
  });
}

/// L with L L^T = covariance, row by row; rounding below zero counts as zero.
std::array<float, 36> squareRoot(const Matrix6d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(covariance);
  const Twist deviations = solver.eigenvalues().cwiseMax(0).cwiseSqrt();
  std::array<float, 36> root;
  Eigen::Map<Eigen::Matrix<float, 6, 6, Eigen::RowMajor>>(root.data()) =
      (solver.eigenvectors() * deviations.asDiagonal()).cast<float>();
  return root;
}

ParticleTwist toFloats(const Twist& twist) {
  ParticleTwist floats;
  Eigen::Map<Eigen::Matrix<float, 6, 1>>(floats.data()) = twist.cast<float>();
  return floats;
}

}  // namespace

ParticleFilter::ParticleFilter(const FilterParams& params) : params_(params) {
  setCount(params.particles);
  resize(wanted_);
  sample_.reserve(std::min(wanted_, kSample));
}

std::size_t ParticleFilter::thinned(std::size_t particles) {
  return std::max(std::min(particles, kThinnedFrom), particles / kThinned);
}

/// Leaves the particles unwritten.
void ParticleFilter::resize(std::size_t count) {
  poses_.resize(count);
  velocities_.resize(count);
  log_likelihoods_.resize(count);
  weights_.resize(count);
  bests_.resize(piecesOf(count));
  twist_sums_.resize(piecesOf(count));
  weight_sums_.resize(piecesOf(count));
  passed_.resize(piecesOf(count) + 1);
  forgetWeights();
}

void ParticleFilter::forgetWeights() {
  std::fill(weights_.begin(), weights_.end(), 1.0F);
  for (std::size_t piece = 0; piece < weight_sums_.size(); ++piece) {
    const auto size = static_cast<double>(std::min(kGrain, weights_.size() - piece * kGrain));
    weight_sums_[piece] = {size, size};
  }
}

void ParticleFilter::initialize(const Pose& mean, const Matrix6d& covariance, const Twist& velocity,
                                const Matrix6d& velocity_covariance) {
  resize(wanted_);
  inject(1.0, mean, covariance, velocity, velocity_covariance);
}

void ParticleFilter::inject(double share, const Pose& mean, const Matrix6d& covariance,
                            const Twist& velocity, const Matrix6d& velocity_covariance) {
  const NormalStream of_poses{params_.seed, ++draw_}, of_velocities{params_.seed, ++draw_};
  const ParticleGaussian gaussian{toParticlePose(mean), squareRoot(covariance), toFloats(velocity),
                                  squareRoot(velocity_covariance)};
  const std::size_t count = poses_.size();
  const auto replaced = static_cast<std::size_t>(share * static_cast<double>(count));
  forPieces(replaced, [&](std::size_t first, std::size_t size) {
    std::array<ParticlePose, kGrain> poses;
    std::array<ParticleTwist, kGrain> velocities;
    drawParticles(gaussian, of_poses, of_velocities, first, size, poses.data(), velocities.data());
    // Evenly strewn over the set, which systematic resampling has left in the order of its parents.
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t place = (first + i) * count / replaced;
      poses_[place] = poses[i];
      velocities_[place] = velocities[i];
    }
  });
  forgetWeights();
}

void ParticleFilter::predict(const MotionParams& motion, double dt, const Pose& camera_motion) {
  const NormalStream stream{params_.seed, ++draw_};
  ParticleStep step;
  step.seconds = static_cast<float>(dt);
  step.kept_velocity = static_cast<float>(std::exp(-motion.velocity_damping * dt));
  for (std::size_t k = 0; k < 6; ++k)
    step.acceleration[k] =
        static_cast<float>(k < 3 ? motion.linear_acceleration : motion.angular_acceleration);
  step.camera_moved = !camera_motion.isApprox(Pose::Identity(), 1e-12);
  const ParticlePose moved = toParticlePose(camera_motion);
  step.turn = moved.rotation;
  step.shift = moved.translation;
  const std::size_t old = poses_.size();
  if (old != wanted_) {
    // Neighbours are of the same parent: a part of the set would not be like the whole.
    poses_.swap(spare_poses_);
    velocities_.swap(spare_velocities_);
    resize(wanted_);
  }
  forPieces(wanted_, [&](std::size_t first, std::size_t size) {
    for (std::size_t i = first; i < first + size && old != wanted_; ++i) {
      poses_[i] = spare_poses_[i * old / wanted_];
      velocities_[i] = spare_velocities_[i * old / wanted_];
    }
    predictParticles(step, stream, first, size, poses_.data() + first, velocities_.data() + first);
  });
}

void ParticleFilter::score(const BatchScorer& scorer) {
  forPieces(poses_.size(), [&](std::size_t first, std::size_t size) {
    float* scores = log_likelihoods_.data() + first;
    scorer(poses_.data() + first, size, scores);
    bests_[first / kGrain] = *std::max_element(scores, scores + size);
  });
}

void ParticleFilter::computeWeights(double power) {
  const float best = *std::max_element(bests_.begin(), bests_.end());
  forPieces(weights_.size(), [&](std::size_t first, std::size_t size) {
    weight_sums_[first / kGrain] = exponentials(log_likelihoods_.data() + first, size, best,
                                                static_cast<float>(power), weights_.data() + first);
  });
  double sum = 0, squares = 0;
  for (const WeightSums& piece : weight_sums_) sum += piece.sum, squares += piece.squares;
  effective_share_ = sum * sum / (squares * static_cast<double>(weights_.size()));
}

double ParticleFilter::powerFor(double survival) {
  const std::size_t step = (log_likelihoods_.size() + kSample - 1) / kSample;
  sample_.clear();
  for (std::size_t i = 0; i < log_likelihoods_.size(); i += step)
    sample_.push_back(log_likelihoods_[i]);
  const float best = *std::max_element(sample_.begin(), sample_.end());
  const auto share = [&](double power) {
    const WeightSums sums =
        exponentials(sample_.data(), sample_.size(), best, static_cast<float>(power), nullptr);
    return sums.sum * sums.sum / (sums.squares * static_cast<double>(sample_.size()));
  };
  double low = 0, high = 1;
  if (share(high) >= survival) return high;
  for (int i = 0; i < 12; ++i) {
    const double middle = 0.5 * (low + high);
    (share(middle) < survival ? high : low) = middle;
  }
  return low;
}

/// Systematic resampling (Kitagawa 1996) to `count` particles.
void ParticleFilter::drawByWeight(std::size_t count) {
  CounterRandom random(params_.seed, ++draw_, 0);
  passed_[0] = 0;
  for (std::size_t piece = 0; piece < weight_sums_.size(); ++piece)
    passed_[piece + 1] = passed_[piece] + weight_sums_[piece].sum;
  const double step = passed_.back() / static_cast<double>(count);
  const double offset = random.uniform();
  // The first child whose place on the line of all weights is behind those of a piece.
  const auto firstChild = [&](std::size_t piece) {
    if (piece == weight_sums_.size()) return count;
    const double child = std::ceil(passed_[piece] / step - offset);
    return static_cast<std::size_t>(std::clamp(child, 0.0, static_cast<double>(count)));
  };
  spare_poses_.resize(count);
  spare_velocities_.resize(count);
  forPieces(weights_.size(), [&](std::size_t first, std::size_t size) {
    const std::size_t piece = first / kGrain, end = firstChild(piece + 1);
    std::size_t source = first;
    double passed = passed_[piece] + static_cast<double>(weights_[source]);
    for (std::size_t child = firstChild(piece); child < end; ++child) {
      const double target = (offset + static_cast<double>(child)) * step;
      while (passed < target && source + 1 < first + size)
        passed += static_cast<double>(weights_[++source]);
      spare_poses_[child] = poses_[source];
      spare_velocities_[child] = velocities_[source];
    }
  });
  poses_.swap(spare_poses_);
  velocities_.swap(spare_velocities_);
  resize(count);
}

void ParticleFilter::resample(double resample_below) {
  if (effective_share_ < resample_below) drawByWeight(poses_.size());
}

void ParticleFilter::anneal(const BatchScorer& scorer, double survival, double spread) {
  score(scorer);
  // The power that leaves the wanted share effective (Deutscher and Reid 2005, section 4.2).
  computeWeights(powerFor(survival));
  drawByWeight(thinned(poses_.size()));

  // Spread by the deviation of the survivors, about one of them.
  const ParticlePose reference = poses_[poses_.size() / 2];
  forPieces(poses_.size(), [&](std::size_t first, std::size_t size) {
    twist_sums_[first / kGrain] = sumTwists(reference, poses_.data() + first, size);
  });
  const auto count = static_cast<double>(poses_.size());
  ParticleTwist deviations;
  for (std::size_t k = 0; k < 6; ++k) {
    double sum = 0, squares = 0;
    for (const TwistSums& piece : twist_sums_) {
      sum += static_cast<double>(piece.sums[k]);
      squares += static_cast<double>(piece.squares[k]);
    }
    const double mean = sum / count;
    deviations[k] =
        static_cast<float>(spread * std::sqrt(std::max(0.0, squares / count - mean * mean)));
  }
  const NormalStream stream{params_.seed, ++draw_};
  forPieces(poses_.size(), [&](std::size_t first, std::size_t size) {
    spreadParticles(deviations, stream, first, size, poses_.data() + first);
  });
}

void ParticleFilter::weigh(const BatchScorer& scorer) {
  score(scorer);
  computeWeights(1.0);
}

}  // namespace leap_object_tracker
