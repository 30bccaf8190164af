#include "limb_shift.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kFirstRadius = -2;  // log2; steps of 1
constexpr double kFirstLit = -0.6, kLitStep = 0.1, kSpreadStep = 0.15;

/// Steepest place of the blurred brightness: the sum over the lamps of max(0, n * l), n the normal
/// that turns from the limb to the eye (Lambert).
double steepest(double radius, double lit, double spread) {
  constexpr double kFirst = -2, kLast = 5, kStep = 0.1, kFar = 3.5;
  constexpr int kParts = 96;
  // By the root of the distance from the limb, where the brightness bends most.
  std::array<double, kParts> insides{}, weights{};
  const double end = std::sqrt(std::min(kLast + kStep + kFar, 2 * radius));
  for (std::size_t k = 0; k < insides.size(); ++k) {
    const double root = end * (static_cast<double>(k) + 0.5) / kParts, inside = root * root;
    const double outwards = 1 - inside / radius;
    const double towards = std::sqrt(std::max(0.0, 1 - outwards * outwards));
    double brightness = 0;
    for (const double lamp : {lit - spread, lit, lit + spread})
      brightness +=
          std::max(0.0, lamp * outwards + std::sqrt(std::max(0.0, 1 - lamp * lamp)) * towards);
    insides[k] = inside;
    weights[k] = brightness * root;
  }
  const auto slopeAt = [&](double place) {
    double slope = 0;
    for (std::size_t k = 0; k < insides.size(); ++k) {
      const double apart = insides[k] - place;
      if (apart < kFar) slope += weights[k] * apart * std::exp(-0.5 * apart * apart);
    }
    return slope;
  };
  double best = 0, before = 0, after = 0, found = 0;
  double last = slopeAt(kFirst - kStep), here = slopeAt(kFirst);
  for (double place = kFirst; place < std::min(kLast, radius + 1); place += kStep) {
    const double next = slopeAt(place + kStep);
    if (here > best) best = here, before = last, after = next, found = place;
    last = here, here = next;
  }
  const double bend = before - 2 * best + after;
  if (bend >= 0) return found;
  return found + 0.5 * kStep * std::clamp((before - after) / bend, -1.0, 1.0);
}

/// Share of the lower and the upper of two neighbours at a place between them.
double shareOf(double place, int neighbour) {
  const double rest = place - std::floor(place);
  return neighbour == 0 ? 1 - rest : rest;
}

}  // namespace

const LimbShift& LimbShift::instance() {
  static const LimbShift shift;
  return shift;
}

LimbShift::LimbShift() {
  for (int r = 0; r < kRadii; ++r)
    for (int l = 0; l < kLits; ++l)
      for (int s = 0; s < kSpreads; ++s)
        shifts_[index(r, l, s)] =
            steepest(std::exp2(kFirstRadius + r), kFirstLit + l * kLitStep, s * kSpreadStep);
}

std::size_t LimbShift::index(int radius, int lit, int spread) {
  return (static_cast<std::size_t>(radius) * kLits + static_cast<std::size_t>(lit)) * kSpreads +
         static_cast<std::size_t>(spread);
}

double LimbShift::at(double radius, double lit, double spread) const {
  const auto placeOf = [](double x, int count) { return std::clamp(x, 0.0, count - 1.001); };
  const double r = placeOf(std::log2(std::max(radius, 1e-3)) - kFirstRadius, kRadii);
  const double l = placeOf((lit - kFirstLit) / kLitStep, kLits);
  const double s = placeOf(std::abs(spread) / kSpreadStep, kSpreads);
  double sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const int dr = corner & 1, dl = corner >> 1 & 1, ds = corner >> 2;
    sum += shareOf(r, dr) * shareOf(l, dl) * shareOf(s, ds) *
           shifts_[index(static_cast<int>(r) + dr, static_cast<int>(l) + dl,
                         static_cast<int>(s) + ds)];
  }
  return sum;
}

}  // namespace leap_object_tracker
