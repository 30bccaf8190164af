#include "leap_object_tracker/tracking/particle_budget.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

FilterParams params(int most, int least, double budget_ms) {
  FilterParams params;
  params.particles = most;
  params.least_particles = least;
  params.budget_ms = budget_ms;
  return params;
}

const Twist kBin = Twist::Ones();

TEST(ParticleBudget, isAlwaysTheSameUnlessAskedToFollow) {
  ParticleBudget budget(params(1000, 0, 0));
  budget.record(1000, 100, 100);
  EXPECT_EQ(budget.count(0.01 * kBin, kBin), 1000);
  EXPECT_EQ(budget.count(100 * kBin, kBin), 1000);
}

TEST(ParticleBudget, followsTheUncertaintyBetweenItsBounds) {
  const ParticleBudget budget(params(50000, 200, 0));
  EXPECT_EQ(budget.count(0.1 * kBin, kBin), 200);
  EXPECT_EQ(budget.count(10 * kBin, kBin), 50000);
  EXPECT_GT(budget.count(0.6 * kBin, kBin), budget.count(0.5 * kBin, kBin));
}

TEST(ParticleBudget, isThatOfFoxForTheBinsCovered) {
  const ParticleBudget budget(params(1000000, 1, 0));
  // 2^6 = 64 bins: half of the 0.99 quantile of chi squared with 63 degrees, 92.0, over 0.05.
  EXPECT_NEAR(budget.count(0.5 * kBin, kBin), 92.01 / 0.1, 1);
}

TEST(ParticleBudget, keepsWithinTheTimeThatFramesTook) {
  ParticleBudget budget(params(10000, 0, 5));
  EXPECT_EQ(budget.count(kBin, kBin), 10000);  // nothing is known yet
  budget.record(10000, 20, 1);                 // 2 us a particle
  EXPECT_EQ(budget.count(kBin, kBin), 2000);
  for (int frame = 0; frame < 100; ++frame) budget.record(2000, 2, 1);  // now 1 us
  EXPECT_NEAR(budget.count(kBin, kBin), 4000, 1);
  for (int frame = 0; frame < 100; ++frame) budget.record(2000, 2, 9);
  EXPECT_EQ(budget.count(kBin, kBin), 100);
}

}  // namespace
}  // namespace leap_object_tracker
