#include "leap_object_tracker/rectification/remap_table.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

/// 40 x 6 px, each grey level is 5 u + 3 v.
cv::Mat ramp() {
  cv::Mat image(6, 40, CV_8UC1);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u)
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(5 * u + 3 * v);
  return image;
}

cv::Mat filled(const RemapTable& table, const cv::Mat& source) {
  cv::Mat target(table.size(), CV_8UC1, cv::Scalar(99));
  table.fillRows(source, target, 0, target.rows);
  return target;
}

/// The table that takes pixel (u, v) from (u + du, v + dv).
RemapTable shift(float du, float dv) {
  const cv::Mat source = ramp();
  cv::Mat map_u(source.size(), CV_32FC1), map_v(source.size(), CV_32FC1);
  for (int v = 0; v < source.rows; ++v)
    for (int u = 0; u < source.cols; ++u) {
      map_u.at<float>(v, u) = static_cast<float>(u) + du;
      map_v.at<float>(v, u) = static_cast<float>(v) + dv;
    }
  return {map_u, map_v, source.size()};
}

TEST(RemapTable, copiesWherePixelsStayInTheirPlace) {
  const cv::Mat target = filled(shift(0, 0), ramp());
  for (int v = 0; v < 4; ++v)
    for (int u = 0; u < 39; ++u) EXPECT_EQ(target.at<std::uint8_t>(v, u), 5 * u + 3 * v);
}

TEST(RemapTable, interpolatesBetweenFourNeighbours) {
  const cv::Mat target = filled(shift(0.4F, 0.25F), ramp());
  for (int v = 0; v < 4; ++v)
    for (int u = 0; u < 38; ++u)
      EXPECT_NEAR(target.at<std::uint8_t>(v, u), 5 * (u + 0.4) + 3 * (v + 0.25), 0.53);
}

TEST(RemapTable, continuesTheBorderOfTheSource) {
  const cv::Mat target = filled(shift(-3, 2), ramp());
  for (int u = 0; u < 3; ++u) EXPECT_EQ(target.at<std::uint8_t>(0, u), 6);
  EXPECT_EQ(target.at<std::uint8_t>(0, 3), 6);
  EXPECT_EQ(target.at<std::uint8_t>(0, 4), 11);
  for (int v = 3; v < 6; ++v) EXPECT_NEAR(target.at<std::uint8_t>(v, 20), 5 * 17 + 3 * 5, 1);
  const cv::Mat right = filled(shift(30, 0), ramp());
  for (int u = 10; u < 40; ++u) EXPECT_NEAR(right.at<std::uint8_t>(2, u), 5 * 39 + 3 * 2, 1);
}

TEST(RemapTable, leavesHolesBlack) {
  const cv::Mat source = ramp();
  cv::Mat map_u(1, 40, CV_32FC1, cv::Scalar(7)), map_v(1, 40, CV_32FC1, cv::Scalar(2));
  map_u.at<float>(0, 20) = NAN;
  map_v.at<float>(0, 21) = INFINITY;
  const cv::Mat target = filled(RemapTable(map_u, map_v, source.size()), source);
  EXPECT_EQ(target.at<std::uint8_t>(0, 19), 41);
  EXPECT_EQ(target.at<std::uint8_t>(0, 20), 0);
  EXPECT_EQ(target.at<std::uint8_t>(0, 21), 0);
  EXPECT_EQ(target.at<std::uint8_t>(0, 22), 41);
}

}  // namespace
}  // namespace leap_object_tracker
