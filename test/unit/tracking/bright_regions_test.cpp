#include "leap_object_tracker/tracking/bright_regions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>

namespace leap_object_tracker {
namespace {

constexpr double kBlack = 3;

cv::Mat dark() { return cv::Mat(240, 320, CV_8UC1, cv::Scalar(kBlack)); }

/// The region whose box is nearest to a rectangle [px].
const BrightRegion& nearestTo(const std::vector<BrightRegion>& regions, const cv::Rect& box) {
  const auto apart = [&](const BrightRegion& region) {
    return std::abs(region.low_u - box.x) + std::abs(region.high_u - box.br().x) +
           std::abs(region.low_v - box.y) + std::abs(region.high_v - box.br().y);
  };
  return *std::min_element(
      regions.begin(), regions.end(),
      [&](const BrightRegion& a, const BrightRegion& b) { return apart(a) < apart(b); });
}

void expectBox(const BrightRegion& region, const cv::Rect& box, double tolerance) {
  EXPECT_NEAR(region.low_u, box.x - 0.5, tolerance);
  EXPECT_NEAR(region.high_u, box.br().x - 0.5, tolerance);
  EXPECT_NEAR(region.low_v, box.y - 0.5, tolerance);
  EXPECT_NEAR(region.high_v, box.br().y - 0.5, tolerance);
}

TEST(BrightRegions, areFoundHoweverDim) {
  for (const double grey : {12.0, 40.0, 250.0}) {
    cv::Mat image = dark();
    const cv::Rect box(100, 60, 60, 40);
    image(box).setTo(grey);
    const auto regions = findBrightRegions(image);
    ASSERT_FALSE(regions.empty()) << grey;
    const BrightRegion& region = nearestTo(regions, box);
    expectBox(region, box, 1.6);
    EXPECT_NEAR(region.area / box.area(), 1, 0.1);
    EXPECT_LE(region.faintest, region.brightest);
    EXPECT_LT(region.brightest, grey);
    EXPECT_EQ(region.known.sum(), BrightRegion::kDirections);
    // To the right, down, and towards the lower right corner.
    EXPECT_NEAR(region.extents[0], box.br().x - 0.5, 1.6);
    EXPECT_NEAR(region.extents[4], box.br().y - 0.5, 1.6);
    EXPECT_NEAR(region.extents[2], (box.br().x + box.br().y - 1) * std::sqrt(0.5), 2.5);
  }
}

TEST(BrightRegions, keepTheFacesThatLookAwayFromTheLight) {
  cv::Mat image = dark();
  const cv::Rect box(100, 60, 60, 80);
  image(box).setTo(180);
  // The lower half grows dark gradually, as a face seen from beside does.
  for (int v = 100; v < box.br().y; ++v)
    image(cv::Rect(box.x, v, box.width, 1)).setTo(180 - 4 * (v - 100));
  expectBox(nearestTo(findBrightRegions(image), box), box, 2.5);
}

TEST(BrightRegions, tellHowFarTheyAreApart) {
  const cv::Rect first(100, 60, 60, 40), second(80, 62, 60, 40), cut(260, 60, 60, 40);
  const auto regionAt = [](const cv::Rect& box) {
    cv::Mat image = dark();
    image(box).setTo(100);
    return nearestTo(findBrightRegions(image), box);
  };
  const BrightRegion a = regionAt(first), b = regionAt(second), c = regionAt(cut);
  EXPECT_FALSE(a.isCut());
  EXPECT_TRUE(c.isCut());
  ASSERT_TRUE(a.apart(b, BrightRegion::kRight).has_value());
  EXPECT_NEAR(*a.apart(b, BrightRegion::kRight), 20, 0.5);
  EXPECT_NEAR(*a.apart(b, BrightRegion::kBelow), -2, 0.5);
  // Only the left sides of both are seen.
  EXPECT_NEAR(c.apart(a, BrightRegion::kRight).value_or(0), 160, 1);
  BrightRegion hidden = c;
  hidden.known.setZero();
  EXPECT_FALSE(hidden.apart(a, BrightRegion::kRight).has_value());
}

TEST(BrightRegions, closeTheDarkTextureOfABody) {
  cv::Mat image = dark();
  const cv::Rect box(100, 60, 90, 70);
  image(box).setTo(120);
  for (int u = box.x + 10; u + 10 < box.br().x; u += 20)
    image(cv::Rect(u, box.y, 10, box.height)).setTo(kBlack);
  const BrightRegion& region = nearestTo(findBrightRegions(image), box);
  expectBox(region, box, 2.5);
  EXPECT_GT(region.closing, 0);
}

TEST(BrightRegions, doNotKnowHowFarTheyReachBeyondTheImage) {
  cv::Mat image = dark();
  image(cv::Rect(0, 80, 50, 40)).setTo(100);
  const BrightRegion& region = nearestTo(findBrightRegions(image), {0, 80, 50, 40});
  EXPECT_EQ(region.known[0], 1);  // to the right
  EXPECT_EQ(region.known[8], 0);  // to the left
}

TEST(DarkRegions, areThoseOfTheNegative) {
  cv::Mat image(240, 320, CV_8UC1, cv::Scalar(150));
  const cv::Rect box(100, 60, 60, 40);
  image(box).setTo(90);
  const auto regions = findDarkRegions(image);
  ASSERT_FALSE(regions.empty());
  expectBox(nearestTo(regions, box), box, 1.6);
  EXPECT_TRUE(findDarkRegions(cv::Mat()).empty());
}

TEST(BrightRegions, areNoneInTheDark) {
  EXPECT_TRUE(findBrightRegions(dark()).empty());
  EXPECT_TRUE(findBrightRegions(cv::Mat()).empty());
}

}  // namespace
}  // namespace leap_object_tracker
