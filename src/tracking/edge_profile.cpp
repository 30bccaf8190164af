#include "leap_object_tracker/tracking/edge_profile.hpp"

#include <Eigen/Dense>
#include <array>
#include <cmath>

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
  Eigen::Matrix<float, kLength, kUnknowns, Eigen::ColMajor> basis;
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
      basis(i, beyond_before) = 1 - inside;
      basis(i, beyond_before + 1) = normal.density(away) * inverse;
      near_share -= 1 - inside;
    }
    if (after) {
      const float away = (s - static_cast<float>(neighbours.after)) * inverse;
      const float outside = normal.below(away);
      basis(i, beyond_after) = outside;
      basis(i, beyond_after + 1) = normal.density(away) * inverse;
      far_share -= outside;
    }
    basis(i, 0) = near_share;
    basis(i, 1) = far_share;
    basis(i, 2) = bell * inverse;
    // A ramp that begins at the edge, blurred.
    if (ramp_before) basis(i, near_ramp) = s * near_share - static_cast<float>(blur) * bell;
    if (ramp_after) basis(i, far_ramp) = s * far_share + static_cast<float>(blur) * bell;
    low = std::min(low, grey[i]);
    high = std::max(high, grey[i]);
  }
  const float range = high - low;
  if (range < 2 * kLeastNoise) return std::nullopt;

  using Square = Eigen::Matrix<double, kUnknowns, kUnknowns>;
  using Vector = Eigen::Matrix<double, kUnknowns, 1>;
  Square normal_matrix = Square::Identity();
  Vector right = Vector::Zero();
  for (int a = 0; a < unknowns; ++a) {
    for (int b = 0; b <= a; ++b) {
      float sum = 0;
      for (int i = 0; i < count; ++i) sum += basis(i, a) * basis(i, b);
      normal_matrix(a, b) = normal_matrix(b, a) = static_cast<double>(sum);
    }
    float sum = 0;
    for (int i = 0; i < count; ++i) sum += basis(i, a) * (grey[i] - low);
    right[a] = static_cast<double>(sum);
  }
  // Levels and ramps are of the order of the range: binds what the profile leaves open.
  const double noise_share = std::pow(kLeastNoise / static_cast<double>(range), 2);
  for (int a = 0; a < unknowns; ++a) {
    const bool ramp = a == near_ramp || a == far_ramp;
    normal_matrix(a, a) += noise_share * (ramp ? 1 / (kWidestRamp * kWidestRamp) : 0.25);
  }
  const Eigen::LDLT<Square> solver(normal_matrix);
  const Vector fitted = solver.solve(right);
  double squares = 0;
  for (int i = 0; i < count; ++i) {
    float value = low;
    for (int a = 0; a < unknowns; ++a) value += basis(i, a) * static_cast<float>(fitted[a]);
    squares += static_cast<double>((grey[i] - value) * (grey[i] - value));
  }
  const double noise = std::max(kLeastNoise * kLeastNoise, squares / (count - unknowns));
  Vector unit = Vector::Zero();
  unit[0] = -1, unit[1] = 1;
  const double step = fitted[1] - fitted[0];
  const double step_variance = noise * unit.dot(solver.solve(unit));
  if (step * step < kSignificance * kSignificance * step_variance) return std::nullopt;
  ProfileEdge edge;
  edge.step = step;
  edge.noise = std::sqrt(noise);
  edge.offset = -fitted[2] / step;
  // Of the ratio, to first order.
  unit[0] = -edge.offset, unit[1] = edge.offset, unit[2] = 1;
  edge.variance = noise * unit.dot(solver.solve(unit)) / (step * step);
  return edge;
}

}  // namespace leap_object_tracker
