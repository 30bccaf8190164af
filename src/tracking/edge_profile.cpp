#include "leap_object_tracker/tracking/edge_profile.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace leap_object_tracker {
namespace {

constexpr int kUnknowns = 9;
constexpr int kLength = 2 * kLongestProfile + 1;
constexpr double kWidestRamp = 0.08;  // [1/px] deviation of a ramp, as a share of the grey range
constexpr double kNarrowestRamp = 5;  // [px] of a face without a ramp of its own
constexpr int kShortestSide = 4;      // [px] that cutting off a neighbour must leave
constexpr double kReachOfBlur = 2.5;  // [blurs] beyond which an edge no longer shows
constexpr double kLeastNoise = 1.0;   // [grey levels]
constexpr double kSignificance = 4;   // deviations that a step must have

/// The normal distribution's cumulative function and density, by linear interpolation.
class NormalTable {
 public:
  NormalTable() {
    for (int i = 0; i <= kSize; ++i) {
      const double x = kRange * (2.0 * i / kSize - 1);
      below_[static_cast<std::size_t>(i)] =
          static_cast<float>(0.5 * std::erfc(-x / std::sqrt(2.0)));
      density_[static_cast<std::size_t>(i)] =
          static_cast<float>(std::exp(-0.5 * x * x) / std::sqrt(2 * M_PI));
    }
  }
  float below(float x) const { return at(below_, x); }
  float density(float x) const { return at(density_, x); }

 private:
  static constexpr int kSize = 512;
  static constexpr float kRange = 4;
  using Table = std::array<float, kSize + 2>;
  static float at(const Table& table, float x) {
    const float place = (std::min(std::max(x, -kRange), kRange) + kRange) * (kSize / (2 * kRange));
    const auto cell = static_cast<std::size_t>(place);
    return table[cell] + (place - static_cast<float>(cell)) * (table[cell + 1] - table[cell]);
  }
  Table below_{}, density_{};
};

using Unknowns = std::array<double, kUnknowns>;

/// Solves positive definite systems of the first `size` unknowns by Cholesky's factors L L'.
class NormalEquations {
 public:
  explicit NormalEquations(int size) : size_(static_cast<std::size_t>(size)) {}

  /// Of the lower triangle.
  double& at(std::size_t row, std::size_t column) { return factor_[row][column]; }

  /// To be called once all is filled in.
  void factorize() {
    for (std::size_t j = 0; j < size_; ++j) {
      for (std::size_t k = 0; k < j; ++k)
        for (std::size_t i = j; i < size_; ++i) factor_[i][j] -= factor_[i][k] * factor_[j][k];
      inverse_[j] = 1 / std::sqrt(factor_[j][j]);
      for (std::size_t i = j; i < size_; ++i) factor_[i][j] *= inverse_[j];
    }
  }

  Unknowns solve(const Unknowns& right) const {
    Unknowns x = forward(right);
    for (std::size_t i = size_; i-- > 0;) {
      for (std::size_t k = i + 1; k < size_; ++k) x[i] -= factor_[k][i] * x[k];
      x[i] *= inverse_[i];
    }
    return x;
  }

  /// x' A^-1 x.
  double inverseForm(const Unknowns& x) const {
    const Unknowns y = forward(x);
    double sum = 0;
    for (std::size_t i = 0; i < size_; ++i) sum += y[i] * y[i];
    return sum;
  }

 private:
  Unknowns forward(Unknowns x) const {
    for (std::size_t i = 0; i < size_; ++i) {
      for (std::size_t k = 0; k < i; ++k) x[i] -= factor_[i][k] * x[k];
      x[i] *= inverse_[i];
    }
    return x;
  }

  std::size_t size_;
  std::array<Unknowns, kUnknowns> factor_{};
  Unknowns inverse_{};  ///< of its diagonal
};

}  // namespace

std::optional<ProfileEdge> fitProfile(const float* grey, int first, int count, double blur,
                                      const ProfileNeighbours& neighbours) {
  static const NormalTable normal;
  int last = first + count - 1;
  // Neighbours far enough away are cut off, nearer ones are part of the model.
  const double reach = kReachOfBlur * blur;
  const int cut_before = static_cast<int>(std::ceil(std::max(neighbours.before, -1e3) + reach));
  const int cut_after = static_cast<int>(std::floor(std::min(neighbours.after, 1e3) - reach));
  if (cut_before <= -kShortestSide && cut_before > first) {
    grey += cut_before - first;
    first = cut_before;
  }
  if (cut_after >= kShortestSide) last = std::min(last, cut_after);
  count = last - first + 1;
  if (count > kLength || first > -2 || last < 2) return std::nullopt;
  const bool before = neighbours.before > first - reach, after = neighbours.after < last + reach;
  const bool ramp_before = std::min<double>(-first, -neighbours.before) >= kNarrowestRamp;
  const bool ramp_after = std::min<double>(last, neighbours.after) >= kNarrowestRamp;

  // Columns: near level, far level, shift, ramps, level beyond each neighbour and its shift.
  std::array<std::array<float, kLength>, kUnknowns> basis;
  const int near_ramp = ramp_before ? 3 : -1,
            far_ramp = ramp_after ? 3 + (ramp_before ? 1 : 0) : -1;
  int unknowns = 3 + (ramp_before ? 1 : 0) + (ramp_after ? 1 : 0);
  const int beyond_before = unknowns, beyond_after = unknowns + (before ? 2 : 0);
  unknowns = beyond_after + (after ? 2 : 0);
  if (count < unknowns + 2) return std::nullopt;
  const auto inverse = static_cast<float>(1 / blur);
  float low = grey[0], high = grey[0];
  for (int i = 0; i < count; ++i) {
    const auto s = static_cast<float>(first + i);
    const float x = s * inverse;
    const float far = normal.below(x), bell = normal.density(x);
    float near_share = 1 - far, far_share = far;
    if (before) {
      const float away = (s - static_cast<float>(neighbours.before)) * inverse;
      const float inside = normal.below(away);
      basis[beyond_before][i] = 1 - inside;
      basis[beyond_before + 1][i] = normal.density(away) * inverse;
      near_share -= 1 - inside;
    }
    if (after) {
      const float away = (s - static_cast<float>(neighbours.after)) * inverse;
      const float outside = normal.below(away);
      basis[beyond_after][i] = outside;
      basis[beyond_after + 1][i] = normal.density(away) * inverse;
      far_share -= outside;
    }
    basis[0][i] = near_share;
    basis[1][i] = far_share;
    basis[2][i] = bell * inverse;
    // A ramp that begins at the edge, blurred.
    if (ramp_before) basis[near_ramp][i] = s * near_share - static_cast<float>(blur) * bell;
    if (ramp_after) basis[far_ramp][i] = s * far_share + static_cast<float>(blur) * bell;
    low = std::min(low, grey[i]);
    high = std::max(high, grey[i]);
  }
  const float range = high - low;
  if (range < 2 * kLeastNoise) return std::nullopt;

  NormalEquations equations(unknowns);
  Unknowns right{};
  // Levels and ramps are of the order of the range: binds what the profile leaves open.
  const double noise_share = std::pow(kLeastNoise / static_cast<double>(range), 2);
  for (int a = 0; a < unknowns; ++a) {
    const auto row = static_cast<std::size_t>(a);
    for (int b = 0; b <= a; ++b) {
      float sum = 0;
      for (int i = 0; i < count; ++i) sum += basis[row][i] * basis[b][i];
      equations.at(row, static_cast<std::size_t>(b)) = static_cast<double>(sum);
    }
    const bool ramp = a == near_ramp || a == far_ramp;
    equations.at(row, row) += noise_share * (ramp ? 1 / (kWidestRamp * kWidestRamp) : 0.25);
    float sum = 0;
    for (int i = 0; i < count; ++i) sum += basis[row][i] * (grey[i] - low);
    right[row] = static_cast<double>(sum);
  }
  equations.factorize();
  const Unknowns fitted = equations.solve(right);
  double squares = 0;
  for (int i = 0; i < count; ++i) {
    float value = low;
    for (int a = 0; a < unknowns; ++a) value += basis[a][i] * static_cast<float>(fitted[a]);
    squares += static_cast<double>((grey[i] - value) * (grey[i] - value));
  }
  const double noise = std::max(kLeastNoise * kLeastNoise, squares / (count - unknowns));
  Unknowns unit{-1, 1};
  const double step = fitted[1] - fitted[0];
  const double step_variance = noise * equations.inverseForm(unit);
  if (step * step < kSignificance * kSignificance * step_variance) return std::nullopt;
  ProfileEdge edge;
  edge.step = step;
  edge.noise = std::sqrt(noise);
  edge.offset = -fitted[2] / step;
  // Of the ratio, to first order.
  unit[0] = -edge.offset, unit[1] = edge.offset, unit[2] = 1;
  edge.variance = noise * equations.inverseForm(unit) / (step * step);
  return edge;
}

}  // namespace leap_object_tracker
