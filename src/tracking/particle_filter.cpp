#include "leap_object_tracker/tracking/particle_filter.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "tracking/random.hpp"

namespace leap_object_tracker {
namespace {

constexpr std::size_t kGrain = 128;

template <class Body>
void forEach(std::size_t count, const Body& body) {
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kGrain),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i != range.end(); ++i) body(i);
                    });
}

/// Moves a pose by a camera twist, in single precision (Rodrigues).
void move(ParticlePose& pose, const std::array<float, 6>& twist) {
  for (std::size_t k = 0; k < 3; ++k) pose.translation[k] += twist[k];
  const float x = twist[3], y = twist[4], z = twist[5];
  const float angle2 = x * x + y * y + z * z;
  const float angle = std::sqrt(angle2);
  const float s = angle > 1e-6F ? std::sin(angle) / angle : 1.0F;
  const float c = angle > 1e-3F ? (1 - std::cos(angle)) / angle2 : 0.5F;
  const float m[9] = {1 - c * (y * y + z * z), c * x * y - s * z,       c * x * z + s * y,
                      c * x * y + s * z,       1 - c * (x * x + z * z), c * y * z - s * x,
                      c * x * z - s * y,       c * y * z + s * x,       1 - c * (x * x + y * y)};
  const std::array<float, 9> r = pose.rotation;
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column)
      pose.rotation[3 * row + column] =
          m[3 * row] * r[column] + m[3 * row + 1] * r[3 + column] + m[3 * row + 2] * r[6 + column];
}

/// Gram-Schmidt on the rows, against the drift of many products.
void orthonormalize(ParticlePose& pose) {
  float* r = pose.rotation.data();
  const float first = 1 / std::sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
  for (int k = 0; k < 3; ++k) r[k] *= first;
  const float dot = r[0] * r[3] + r[1] * r[4] + r[2] * r[5];
  for (int k = 0; k < 3; ++k) r[3 + k] -= dot * r[k];
  const float second = 1 / std::sqrt(r[3] * r[3] + r[4] * r[4] + r[5] * r[5]);
  for (int k = 0; k < 3; ++k) r[3 + k] *= second;
  r[6] = r[1] * r[5] - r[2] * r[4];
  r[7] = r[2] * r[3] - r[0] * r[5];
  r[8] = r[0] * r[4] - r[1] * r[3];
}

using Matrix6f = Eigen::Matrix<float, 6, 6>;
using Vector6f = Eigen::Matrix<float, 6, 1>;

/// L with L L^T = covariance; rounding below zero counts as zero.
Matrix6f squareRoot(const Matrix6d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(covariance);
  const Twist deviations = solver.eigenvalues().cwiseMax(0).cwiseSqrt();
  return (solver.eigenvectors() * deviations.asDiagonal()).cast<float>();
}

std::array<float, 6> drawTwist(const Matrix6f& root, CounterRandom& random) {
  const std::array<float, 6> normals = random.sixNormals();
  const Vector6f drawn = root * Eigen::Map<const Vector6f>(normals.data());
  std::array<float, 6> twist{};
  Eigen::Map<Vector6f>(twist.data()) = drawn;
  return twist;
}

}  // namespace

ParticleFilter::ParticleFilter(const FilterParams& params) : params_(params) {
  setCount(params.particles);
}

void ParticleFilter::setCount(int particles) {
  const auto count = static_cast<std::size_t>(particles);
  const std::size_t old = particles_.size();
  particles_.resize(count);
  for (std::size_t i = old; i < count && old > 0; ++i) particles_[i] = particles_[i % old];
  spare_.resize(count);
  poses_.resize(count);
  log_likelihoods_.assign(count, 0);
  weights_.assign(count, 1.0 / static_cast<double>(count));
  chosen_.resize(count);
}

void ParticleFilter::initialize(const Pose& mean, const Matrix6d& covariance, const Twist& velocity,
                                const Matrix6d& velocity_covariance) {
  inject(1.0, mean, covariance, velocity, velocity_covariance);
}

void ParticleFilter::inject(double share, const Pose& mean, const Matrix6d& covariance,
                            const Twist& velocity, const Matrix6d& velocity_covariance) {
  const std::uint64_t stream = ++draw_;
  const ParticlePose centre = toParticlePose(mean);
  const Matrix6f root = squareRoot(covariance), velocity_root = squareRoot(velocity_covariance);
  const std::size_t count = particles_.size();
  const auto replaced = static_cast<std::size_t>(share * static_cast<double>(count));
  forEach(replaced, [&](std::size_t i) {
    CounterRandom random(params_.seed, stream, i);
    // Evenly strewn over the set, which systematic resampling has left in the order of its parents.
    Particle& particle = particles_[i * count / replaced];
    particle.pose = centre;
    move(particle.pose, drawTwist(root, random));
    particle.velocity = drawTwist(velocity_root, random);
    for (std::size_t k = 0; k < 6; ++k)
      particle.velocity[k] += static_cast<float>(velocity[static_cast<Eigen::Index>(k)]);
  });
  std::fill(weights_.begin(), weights_.end(), 1.0 / static_cast<double>(count));
}

void ParticleFilter::predict(const MotionParams& motion, double dt, const Pose& camera_motion) {
  const std::uint64_t stream = ++draw_;
  const auto step = static_cast<float>(dt);
  const auto kept = static_cast<float>(std::exp(-motion.velocity_damping * dt));
  const bool camera_moved = !camera_motion.isApprox(Pose::Identity(), 1e-12);
  const Eigen::Matrix3f turn = camera_motion.linear().cast<float>();
  const Eigen::Vector3f shift = camera_motion.translation().cast<float>();
  using RowMajor = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  forEach(particles_.size(), [&](std::size_t i) {
    CounterRandom random(params_.seed, stream, i);
    Particle& particle = particles_[i];
    if (camera_moved) {
      Eigen::Map<RowMajor> rotation(particle.pose.rotation.data());
      rotation = (turn * rotation).eval();
      Eigen::Map<Eigen::Vector3f> translation(particle.pose.translation.data());
      translation = (turn * translation + shift).eval();
      for (const int part : {0, 3}) {
        Eigen::Map<Eigen::Vector3f> velocity(particle.velocity.data() + part);
        velocity = (turn * velocity).eval();
      }
    }
    const std::array<float, 6> normals = random.sixNormals();
    std::array<float, 6> twist{};
    for (std::size_t k = 0; k < 6; ++k) {
      const auto acceleration =
          normals[k] *
          static_cast<float>(k < 3 ? motion.linear_acceleration : motion.angular_acceleration);
      twist[k] = (particle.velocity[k] + 0.5F * acceleration * step) * step;
      particle.velocity[k] = kept * particle.velocity[k] + acceleration * step;
    }
    move(particle.pose, twist);
    orthonormalize(particle.pose);
  });
}

void ParticleFilter::score(const BatchScorer& scorer) {
  const std::size_t count = particles_.size();
  for (std::size_t i = 0; i < count; ++i) poses_[i] = particles_[i].pose;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, count, kGrain),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      scorer(poses_.data() + range.begin(), range.size(),
                             log_likelihoods_.data() + range.begin());
                    });
}

void ParticleFilter::normalizeWeights(double power) {
  const float best = *std::max_element(log_likelihoods_.begin(), log_likelihoods_.end());
  double sum = 0, squares = 0;
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    weights_[i] = std::exp(power * static_cast<double>(log_likelihoods_[i] - best));
    sum += weights_[i];
  }
  for (double& weight : weights_) {
    weight /= sum;
    squares += weight * weight;
  }
  effective_share_ = 1 / (squares * static_cast<double>(weights_.size()));
}

void ParticleFilter::drawIndices() {
  CounterRandom random(params_.seed, ++draw_, 0);
  const double step = 1.0 / static_cast<double>(weights_.size());
  double target = random.uniform() * step, passed = weights_[0];
  std::uint32_t source = 0;
  for (std::uint32_t& index : chosen_) {
    while (passed < target && source + 1 < weights_.size()) passed += weights_[++source];
    index = source;
    target += step;
  }
}

void ParticleFilter::resample(double resample_below) {
  if (effective_share_ >= resample_below) return;
  drawIndices();
  for (std::size_t i = 0; i < particles_.size(); ++i) spare_[i] = particles_[chosen_[i]];
  particles_.swap(spare_);
  std::fill(weights_.begin(), weights_.end(), 1.0 / static_cast<double>(weights_.size()));
}

void ParticleFilter::anneal(const BatchScorer& scorer, double survival, double spread, int layer) {
  score(scorer);
  // The power that leaves the wanted share effective (Deutscher and Reid 2005, section 4.2).
  double low = 0, high = 1;
  normalizeWeights(high);
  if (effective_share_ < survival) {
    for (int i = 0; i < 12; ++i) {
      const double middle = 0.5 * (low + high);
      normalizeWeights(middle);
      (effective_share_ < survival ? high : low) = middle;
    }
    normalizeWeights(low);
  }
  resample(1.01);

  // Spread by the deviation of the survivors, about the first of them.
  Vector6f mean = Vector6f::Zero(), squares = Vector6f::Zero();
  const ParticlePose reference = particles_[particles_.size() / 2].pose;
  using RowMajor = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> reference_rotation(reference.rotation.data());
  for (const Particle& particle : particles_) {
    const Eigen::Map<const RowMajor> rotation(particle.pose.rotation.data());
    const Eigen::Matrix3f turn = rotation * reference_rotation.transpose();
    Vector6f twist;
    for (int k = 0; k < 3; ++k)
      twist[k] = particle.pose.translation[static_cast<std::size_t>(k)] -
                 reference.translation[static_cast<std::size_t>(k)];
    twist.tail<3>() << 0.5F * (turn(2, 1) - turn(1, 2)), 0.5F * (turn(0, 2) - turn(2, 0)),
        0.5F * (turn(1, 0) - turn(0, 1));
    mean += twist;
    squares += twist.cwiseAbs2();
  }
  const auto count = static_cast<float>(particles_.size());
  mean /= count;
  const Vector6f deviation =
      (squares / count - mean.cwiseAbs2()).cwiseMax(0).cwiseSqrt() * static_cast<float>(spread);
  const std::uint64_t stream = ++draw_;
  forEach(particles_.size(), [&](std::size_t i) {
    CounterRandom random(params_.seed, stream + static_cast<std::uint64_t>(layer) * 0x100000000ULL,
                         i);
    std::array<float, 6> twist = random.sixNormals();
    for (std::size_t k = 0; k < 6; ++k) twist[k] *= deviation[static_cast<Eigen::Index>(k)];
    move(particles_[i].pose, twist);
  });
}

void ParticleFilter::weigh(const BatchScorer& scorer) {
  score(scorer);
  normalizeWeights(1.0);
}

}  // namespace leap_object_tracker
