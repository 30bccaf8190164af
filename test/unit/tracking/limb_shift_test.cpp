#include "tracking/limb_shift.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

/// The same by brute force: brightness over a line, blurred, and its steepest place.
double shownBy(double radius, double lit, double spread) {
  constexpr double kStep = 0.005;
  const auto brightness = [&](double inside) {
    if (inside <= 0 || inside >= 2 * radius) return 0.0;
    const double out = 1 - inside / radius, in = std::sqrt(1 - out * out);
    double sum = 0;
    for (const double lamp : {lit - spread, lit, lit + spread})
      sum += std::max(0.0, lamp * out + std::sqrt(1 - lamp * lamp) * in);
    return sum;
  };
  double best = 0, found = 0;
  for (double place = -2; place < 5; place += 0.02) {
    double slope = 0;
    for (double at = place - 5; at < place + 5; at += kStep)
      slope += brightness(at) * (at - place) * std::exp(-0.5 * (at - place) * (at - place));
    if (slope > best) best = slope, found = place;
  }
  return found;
}

TEST(LimbShift, ofALargeBodyLitFromTheEyeIsThatOfASquareRoot) {
  // Steepest place of a blurred square root: 0.765 deviations.
  EXPECT_NEAR(LimbShift::instance().at(60, 0, 0), 0.765, 0.02);
}

TEST(LimbShift, isWhatTheBlurredImageShows) {
  for (const double radius : {0.5, 2.0, 8.0, 32.0})
    for (const double lit : {-0.3, 0.0, 0.2})
      for (const double spread : {0.0, 0.3})
        EXPECT_NEAR(LimbShift::instance().at(radius, lit, spread), shownBy(radius, lit, spread),
                    0.04)
            << radius << ' ' << lit << ' ' << spread;
}

TEST(LimbShift, liesOutsideOfWhatIsThinnerThanTheBlur) {
  EXPECT_LT(LimbShift::instance().at(0.3, 0, 0), -0.5);
}

TEST(LimbShift, isLessWhereTheLimbIsLit) {
  double last = 10;
  for (double lit = -0.5; lit < 0.5; lit += 0.05) {
    const double shift = LimbShift::instance().at(16, lit, 0.1);
    EXPECT_LT(shift, last + 1e-9) << lit;
    last = shift;
  }
  EXPECT_NEAR(last, 0, 0.25) << "a lit limb is a step";
}

TEST(LimbShift, staysWithinItsTableForAnyNumber) {
  for (const double radius : {1e-6, 1e6})
    for (const double lit : {-1.0, 1.0})
      EXPECT_TRUE(std::isfinite(LimbShift::instance().at(radius, lit, 2)));
}

}  // namespace
}  // namespace leap_object_tracker
