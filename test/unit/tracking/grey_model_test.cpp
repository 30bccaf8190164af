#include "leap_object_tracker/tracking/grey_model.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

GreyModel::Histogram counts(int low, int high, float each) {
  GreyModel::Histogram histogram{};
  for (int grey = low; grey <= high; ++grey)
    histogram[static_cast<std::size_t>(GreyModel::bin(static_cast<std::uint8_t>(grey)))] += each;
  return histogram;
}

TEST(GreyModel, KnowsNothingBeforeItHasLearned) {
  const GreyModel model;
  EXPECT_FALSE(model.known());
  EXPECT_EQ(model.logRatio(0), 0);
  EXPECT_EQ(model.logRatio(200), 0);
}

TEST(GreyModel, TellsABrightObjectFromDarkSurroundings) {
  GreyModel model;
  model.learn(counts(100, 200, 10), counts(0, 15, 10), 0.1);
  ASSERT_TRUE(model.known());
  EXPECT_GT(model.logRatio(150), 1);
  EXPECT_LT(model.logRatio(5), -1);
  EXPECT_LE(model.logRatio(150), 2);
  EXPECT_GE(model.logRatio(5), -2);
}

TEST(GreyModel, IsUndecidedWhereObjectAndSurroundingsShareTheirGreyValues) {
  GreyModel model;
  model.learn(counts(50, 150, 10), counts(50, 150, 10), 0.1);
  EXPECT_NEAR(model.logRatio(100), 0, 1e-4);
}

TEST(GreyModel, IgnoresTooFewSamplesAndFollowsSlowly) {
  GreyModel model;
  model.learn(counts(100, 104, 1), counts(0, 4, 1), 0.1);
  EXPECT_FALSE(model.known());
  model.learn(counts(100, 200, 10), counts(0, 15, 10), 0.1);
  const float before = model.logRatio(150);
  model.learn(counts(0, 15, 10), counts(100, 200, 10), 0.1);
  EXPECT_LE(model.logRatio(150), before);
  EXPECT_GT(model.logRatio(150), 0);
  for (int i = 0; i < 40; ++i) model.learn(counts(0, 15, 10), counts(100, 200, 10), 0.1);
  EXPECT_LT(model.logRatio(150), -1);
}

TEST(GreyModel, BinsGrowWithTheGreyValueAndStayInside) {
  for (int grey = 1; grey < 256; ++grey)
    EXPECT_GE(GreyModel::bin(static_cast<std::uint8_t>(grey)),
              GreyModel::bin(static_cast<std::uint8_t>(grey - 1)));
  EXPECT_EQ(GreyModel::bin(0), 0);
  EXPECT_LT(GreyModel::bin(255), GreyModel::kBins);
}

}  // namespace
}  // namespace leap_object_tracker
