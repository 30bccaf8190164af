#include "leap_object_tracker/simulation/paint.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace leap_object_tracker {
namespace {

std::vector<float> albedosAlong(const Paint& paint) {
  std::vector<float> albedos;
  for (int i = 0; i < 2000; ++i)
    albedos.push_back(albedoAt(paint, Eigen::Vector3f(0.0001F * static_cast<float>(i), 0.013F,
                                                      0.00007F * static_cast<float>(i))));
  return albedos;
}

Paint paintOf(PaintKind kind) {
  Paint paint;
  paint.kind = kind;
  paint.albedo_low = 0.2;
  paint.albedo_high = 0.7;
  paint.grain = 0;
  return paint;
}

TEST(Paint, staysBetweenItsAlbedosAndUsesBoth) {
  for (const auto kind :
       {PaintKind::kChecker, PaintKind::kStripes, PaintKind::kNoise, PaintKind::kBlobs}) {
    const auto albedos = albedosAlong(paintOf(kind));
    const auto range = std::minmax_element(albedos.begin(), albedos.end());
    EXPECT_GE(*range.first, 0.2F);
    EXPECT_LE(*range.second, 0.7F);
    EXPECT_LT(*range.first, 0.4F);
    EXPECT_GT(*range.second, 0.5F);
  }
}

TEST(Paint, isOneGreyWhenPlain) {
  for (const float albedo : albedosAlong(paintOf(PaintKind::kPlain))) EXPECT_FLOAT_EQ(albedo, 0.7F);
}

TEST(Paint, alternatesFromCubeToCubeOfAChecker) {
  const Paint paint = paintOf(PaintKind::kChecker);  // of 1 cm
  const float here = albedoAt(paint, {0.001F, 0.001F, 0.001F});
  EXPECT_NE(here, albedoAt(paint, {0.011F, 0.001F, 0.001F}));
  EXPECT_EQ(here, albedoAt(paint, {0.011F, 0.011F, 0.001F}));
}

TEST(Paint, dependsOnItsSeed) {
  Paint a = paintOf(PaintKind::kBlobs), b = a;
  b.seed = 7;
  EXPECT_EQ(albedosAlong(a), albedosAlong(a));
  EXPECT_NE(albedosAlong(a), albedosAlong(b));
}

TEST(Paint, variesByItsGrain) {
  Paint paint = paintOf(PaintKind::kPlain);
  paint.grain = 0.1;
  const auto albedos = albedosAlong(paint);
  const auto range = std::minmax_element(albedos.begin(), albedos.end());
  EXPECT_GE(*range.first, 0.63F);
  EXPECT_LE(*range.second, 0.77F);
  EXPECT_GT(*range.second - *range.first, 0.05F);
}

}  // namespace
}  // namespace leap_object_tracker
