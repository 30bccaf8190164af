#include "leap_object_tracker/tracking/edge_profile.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace leap_object_tracker {
namespace {

constexpr double kBlur = 1.1;

/// Blurred steps and ramps, by summing over a fine grid.
std::vector<float> profile(int reach, const std::vector<double>& edges,
                           const std::vector<double>& levels, const std::vector<double>& ramps,
                           double noise = 0, unsigned seed = 1) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  std::vector<float> values;
  for (int s = -reach; s <= reach; ++s) {
    double sum = 0, weights = 0;
    for (int k = -400; k <= 400; ++k) {
      const double offset = k * 0.0125, weight = std::exp(-0.5 * std::pow(offset / kBlur, 2));
      const double at = s + offset;
      std::size_t segment = 0;
      while (segment < edges.size() && at > edges[segment]) ++segment;
      sum += weight * (levels[segment] + ramps[segment] * at);
      weights += weight;
    }
    values.push_back(static_cast<float>(sum / weights + noise * normal(random)));
  }
  return values;
}

TEST(EdgeProfile, FindsAStepToAFewHundredthsOfAPixel) {
  for (const double place : {-0.4, -0.2, 0.0, 0.1, 0.3}) {
    const auto grey = profile(6, {place}, {150, 10}, {0, 0});
    const auto edge = fitProfile(grey.data(), -6, 13, kBlur, {});
    ASSERT_TRUE(edge);
    EXPECT_NEAR(edge->offset, place, 0.01 + 0.4 * place * place);
    EXPECT_NEAR(edge->step, -140, 15);
  }
}

TEST(EdgeProfile, IsNotPulledByRampsThatMeetAtTheEdge) {
  const auto grey = profile(6, {0.1}, {185, 160}, {5, -8});
  const auto edge = fitProfile(grey.data(), -6, 13, kBlur, {});
  ASSERT_TRUE(edge);
  EXPECT_NEAR(edge->offset, 0.1, 0.1);
}

TEST(EdgeProfile, IsNotPulledByAStrongNeighbourThreePixelsAway) {
  const auto grey = profile(6, {-3, 0.2}, {180, 40, 5}, {0, 0, 0});
  const auto alone = fitProfile(grey.data(), -6, 13, kBlur, {});
  const auto edge = fitProfile(grey.data(), -6, 13, kBlur, {-3, 1e9});
  ASSERT_TRUE(edge);
  EXPECT_NEAR(edge->offset, 0.2, 0.06);
  EXPECT_TRUE(!alone || std::abs(alone->offset - 0.2) > 0.2);
}

TEST(EdgeProfile, VarianceMatchesTheScatterUnderNoise) {
  double squares = 0, expected = 0;
  const int runs = 400;
  for (int i = 0; i < runs; ++i) {
    const auto grey = profile(6, {0.1}, {60, 10}, {0, 0}, 2, 10 + static_cast<unsigned>(i));
    const auto edge = fitProfile(grey.data(), -6, 13, kBlur, {});
    ASSERT_TRUE(edge);
    squares += std::pow(edge->offset - 0.1, 2);
    expected += edge->variance;
  }
  EXPECT_NEAR(std::sqrt(squares / runs), std::sqrt(expected / runs),
              0.25 * std::sqrt(expected / runs));
}

TEST(EdgeProfile, SeesNoEdgeInNoiseOrInARamp) {
  int found = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const auto grey = profile(6, {}, {50}, {2}, 3, seed);
    found += fitProfile(grey.data(), -6, 13, kBlur, {}) ? 1 : 0;
  }
  EXPECT_LE(found, 4);
}

TEST(EdgeProfile, StaysFiniteBetweenNeighboursThatBlurHides) {
  for (const double apart : {0.0, 0.01, 0.3, 0.7, 1.5}) {
    const auto grey = profile(7, {0.2}, {200, 10}, {0, 0});
    const auto edge = fitProfile(grey.data(), -7, 15, kBlur, {-apart, apart});
    if (!edge) continue;
    EXPECT_TRUE(std::isfinite(edge->offset)) << apart;
    EXPECT_GT(edge->variance, 0) << apart;
  }
}

TEST(EdgeProfile, RefusesProfilesThatAreTooShort) {
  const std::vector<float> grey(17, 100.0F);
  EXPECT_FALSE(fitProfile(grey.data(), -1, 9, kBlur, {}));
  EXPECT_FALSE(fitProfile(grey.data(), -2, 4, kBlur, {}));
}

}  // namespace
}  // namespace leap_object_tracker
