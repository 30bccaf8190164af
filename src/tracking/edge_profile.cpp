#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/edge_profile.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.h.
#include <hwy/highway.h>
// And this one after that.
#include <hwy/contrib/math/math-inl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "leap_object_tracker/tracking/edge_profile.hpp"
#include "normal_equations.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kUnknowns = 9;
constexpr int kLength = 2 * kLongestProfile + 1;
constexpr std::size_t kPadded = 16;
static_assert(kLength <= kPadded);
constexpr double kWidestRamp = 0.08;  // [1/px] deviation of a ramp, as a share of the grey range
constexpr double kNarrowestRamp = 5;  // [px] of a face without a ramp of its own
constexpr int kShortestSide = 4;      // [px] that cutting off a neighbour must leave
constexpr double kReachOfBlur = 2.5;  // [blurs] beyond which an edge no longer shows
constexpr double kLeastNoise = 1.0;   // [grey levels]
constexpr double kSignificance = 4;   // deviations that a step must have

using Floats = hn::CappedTag<float, kPadded>;
using Float = hn::Vec<Floats>;

/// Values along a profile, zeros behind the last.
struct alignas(4 * kPadded) Column : std::array<float, kPadded> {};

HWY_INLINE float dot(const Column& a, const Column& b) {
  const Floats df;
  Float sum = hn::Zero(df);
  for (std::size_t i = 0; i < kPadded; i += hn::Lanes(df))
    sum = hn::MulAdd(hn::Load(df, a.data() + i), hn::Load(df, b.data() + i), sum);
  return hn::GetLane(hn::SumOfLanes(df, sum));
}

struct Normal {
  Float below, density;
};

/// The normal distribution's cumulative function, to 1e-7 (Abramowitz and Stegun 1964, 26.2.17),
/// and density.
HWY_INLINE Normal normalAt(Float x) {
  const Floats df;
  const auto set = [&](double value) HWY_ATTR { return hn::Set(df, static_cast<float>(value)); };
  const Float density = hn::Mul(set(0.3989422804), hn::Exp(df, hn::Mul(set(-0.5), hn::Mul(x, x))));
  const Float t = hn::Div(set(1), hn::MulAdd(set(0.2316419), hn::Abs(x), set(1)));
  Float series = set(1.330274429);
  for (const double factor : {-1.821255978, 1.781477937, -0.356563782, 0.319381530, 0.0})
    series = hn::MulAdd(series, t, set(factor));
  const Float tail = hn::Mul(density, series);
  return {hn::IfThenElse(hn::Lt(x, hn::Zero(df)), tail, hn::Sub(set(1), tail)), density};
}

std::optional<ProfileEdge> fit(const float* grey, int first, int count, double blur,
                               const ProfileNeighbours& neighbours) {
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

  // Columns: ramps, level beyond each neighbour and its shift, then those of the edge itself: near
  // level, far level, shift. The variances only ask for these, which is cheapest for the last.
  std::size_t unknowns = 0;
  const auto add = [&](bool wanted, std::size_t columns) {
    const std::size_t at = unknowns;
    if (wanted) unknowns += columns;
    return at;
  };
  const std::size_t near_ramp = add(ramp_before, 1), far_ramp = add(ramp_after, 1);
  const std::size_t beyond_before = add(before, 2), beyond_after = add(after, 2);
  const std::size_t near_level = add(true, 3), far_level = near_level + 1, shift = near_level + 2;
  const auto length = static_cast<std::size_t>(count);
  if (length < unknowns + 2) return std::nullopt;
  const auto [lowest, highest] = std::minmax_element(grey, grey + length);
  const float low = *lowest, range = *highest - low;
  if (range < 2 * kLeastNoise) return std::nullopt;

  std::array<Column, kUnknowns> basis;
  Column values{};
  std::copy(grey, grey + length, values.begin());
  const Floats df;
  const Float one = hn::Set(df, 1.0F), inverse = hn::Set(df, static_cast<float>(1 / blur));
  for (std::size_t i = 0; i < kPadded; i += hn::Lanes(df)) {
    const auto inside = hn::FirstN(df, length - std::min(i, length));
    const auto store = [&](Float x, Column& column) HWY_ATTR {
      hn::Store(hn::IfThenElseZero(inside, x), df, column.data() + i);
    };
    const Float s = hn::Iota(df, static_cast<float>(first) + static_cast<float>(i));
    const Normal edge = normalAt(hn::Mul(s, inverse));
    Float near_share = hn::Sub(one, edge.below), far_share = edge.below;
    const auto fromNeighbour = [&](double place) HWY_ATTR {
      return normalAt(hn::Mul(hn::Sub(s, hn::Set(df, static_cast<float>(place))), inverse));
    };
    if (before) {
      const Normal neighbour = fromNeighbour(neighbours.before);
      const Float beyond = hn::Sub(one, neighbour.below);
      store(beyond, basis[beyond_before]);
      store(hn::Mul(neighbour.density, inverse), basis[beyond_before + 1]);
      near_share = hn::Sub(near_share, beyond);
    }
    if (after) {
      const Normal neighbour = fromNeighbour(neighbours.after);
      store(neighbour.below, basis[beyond_after]);
      store(hn::Mul(neighbour.density, inverse), basis[beyond_after + 1]);
      far_share = hn::Sub(far_share, neighbour.below);
    }
    store(near_share, basis[near_level]);
    store(far_share, basis[far_level]);
    store(hn::Mul(edge.density, inverse), basis[shift]);
    // A ramp that begins at the edge, blurred.
    const Float bend = hn::Mul(hn::Set(df, static_cast<float>(blur)), edge.density);
    if (ramp_before) store(hn::Sub(hn::Mul(s, near_share), bend), basis[near_ramp]);
    if (ramp_after) store(hn::MulAdd(s, far_share, bend), basis[far_ramp]);
    store(hn::Sub(hn::Load(df, values.data() + i), hn::Set(df, low)), values);
  }

  NormalEquations<kUnknowns> equations(unknowns);
  NormalEquations<kUnknowns>::Vector right;
  // Levels and ramps are of the order of the range: binds what the profile leaves open.
  const double noise_share = std::pow(kLeastNoise / static_cast<double>(range), 2);
  for (std::size_t a = 0; a < unknowns; ++a) {
    for (std::size_t b = 0; b <= a; ++b)
      equations.at(a, b) = static_cast<double>(dot(basis[a], basis[b]));
    const bool ramp = a < beyond_before;
    equations.at(a, a) += noise_share * (ramp ? 1 / (kWidestRamp * kWidestRamp) : 0.25);
    right[a] = static_cast<double>(dot(basis[a], values));
  }
  equations.factorize();
  const auto fitted = equations.solve(right);
  for (std::size_t a = 0; a < unknowns; ++a) {
    const Float part = hn::Set(df, static_cast<float>(fitted[a]));
    for (std::size_t i = 0; i < kPadded; i += hn::Lanes(df))
      hn::Store(
          hn::NegMulAdd(part, hn::Load(df, basis[a].data() + i), hn::Load(df, values.data() + i)),
          df, values.data() + i);
  }
  const auto squares = static_cast<double>(dot(values, values));
  const double noise =
      std::max(kLeastNoise * kLeastNoise, squares / static_cast<double>(length - unknowns));
  NormalEquations<kUnknowns>::Vector unit{};
  unit[near_level] = -1, unit[far_level] = 1;
  const double step = fitted[far_level] - fitted[near_level];
  const double step_variance = noise * equations.inverseForm(unit, near_level);
  if (step * step < kSignificance * kSignificance * step_variance) return std::nullopt;
  ProfileEdge edge;
  edge.step = step;
  edge.noise = std::sqrt(noise);
  edge.offset = -fitted[shift] / step;
  // Of the ratio, to first order.
  unit[near_level] = -edge.offset, unit[far_level] = edge.offset, unit[shift] = 1;
  edge.variance = noise * equations.inverseForm(unit, near_level) / (step * step);
  return edge;
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(fit);

std::optional<ProfileEdge> fitProfile(const float* grey, int first, int count, double blur,
                                      const ProfileNeighbours& neighbours) {
  return HWY_DYNAMIC_DISPATCH(fit)(grey, first, count, blur, neighbours);
}

}  // namespace leap_object_tracker
#endif
