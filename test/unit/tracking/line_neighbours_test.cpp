#include "tracking/line_neighbours.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

/// Three upright lines of bright to dark, pieces of 2 px: at 10, 10.5 and 14 px, and one across.
ContourLines upright() {
  ContourLines lines;
  for (int k = 0; k < 5; ++k) lines.add(10, 2.0F * static_cast<float>(k), 1, 0, -2, 2);
  for (int k = 0; k < 5; ++k) lines.add(10.5F, 2.0F * static_cast<float>(k), -1, 0, 6, 2);
  for (int k = 0; k < 5; ++k) lines.add(14, 2.0F * static_cast<float>(k), 1, 0, -2, 2);
  for (int k = 0; k < 5; ++k) lines.add(8 + 2.0F * static_cast<float>(k), 5, 0, 1, -2, 2);
  return lines;
}

TEST(ContourLines, findTheNextLinesOnBothSides) {
  ContourLines lines = upright();
  const auto first = lines.neighbours(2);
  EXPECT_FLOAT_EQ(first.before, -ContourLines::kFarthest);
  EXPECT_FLOAT_EQ(first.after, 4) << "half a pixel beside is the same line";
  const auto last = lines.neighbours(12);
  EXPECT_FLOAT_EQ(last.before, -3.5F);
  EXPECT_FLOAT_EQ(last.after, ContourLines::kFarthest);
}

TEST(ContourLines, addUpTheStepsOfOnePlaceAlongOneNormal) {
  ContourLines lines = upright();
  // Pieces less than 4 px along: three of each line. The second is seen against its normal.
  const auto beside = lines.neighbours(2);
  EXPECT_FLOAT_EQ(beside.same, 3 * -2 + 3 * -6);
  EXPECT_FLOAT_EQ(beside.same_moment, 3 * -6 * 0.5F);
  const auto against = lines.neighbours(7);
  EXPECT_FLOAT_EQ(against.same, 3 * 2 + 3 * 6);
  EXPECT_FLOAT_EQ(against.same_moment, 3 * 2 * 0.5F) << "the first lies along its normal";
}

TEST(ContourLines, countWhatTheImageDoesNotTellApart) {
  ContourLines lines = upright();
  // Pieces of 2 px at 0, +-2 and +-4 px along, which count 1, 3/4 and 1/2.
  const float alone = 2 * (1 + 2 * 0.75F + 2 * 0.5F);
  EXPECT_FLOAT_EQ(lines.neighbours(12).all, alone);
  const auto beside = lines.neighbours(2);
  EXPECT_GT(beside.all, 1.85F * alone) << "nearly two lines";
  EXPECT_LT(beside.all, 2 * alone);
}

TEST(ContourLines, onOnePlaceAreSeenOnce) {
  ContourLines lines;
  for (int line = 0; line < 2; ++line)
    for (int k = 0; k < 9; ++k) lines.add(10, 2.0F * static_cast<float>(k), 1, 0, -2, 2);
  // A line without end has the whole window.
  EXPECT_FLOAT_EQ(lines.neighbours(4).all, 2 * ContourLines::kWindow);
}

TEST(ContourLines, doNotMeetThoseOfAnotherDirection) {
  ContourLines lines;
  lines.add(0, 0, 1, 0, -1, 2);
  lines.add(1, 0, 0, 1, -1, 2);
  lines.add(2, 9, 1, 0, -1, 2);  // too far along
  const auto beside = lines.neighbours(0);
  EXPECT_FLOAT_EQ(beside.after, ContourLines::kFarthest);
  EXPECT_FLOAT_EQ(beside.all, 2);
  EXPECT_FLOAT_EQ(beside.near, -1);
}

TEST(ContourLines, areAsManyAsWanted) {
  ContourLines lines;
  for (int k = 0; k < 100; ++k) lines.add(static_cast<float>(3 * k), 0, 1, 0, -1, 2);
  for (std::size_t k = 1; k < 99; ++k) {
    EXPECT_FLOAT_EQ(lines.neighbours(k).before, -3) << k;
    EXPECT_FLOAT_EQ(lines.neighbours(k).after, 3) << k;
  }
  lines.clear();
  lines.add(5, 5, 1, 0, -1, 2);
  EXPECT_FLOAT_EQ(lines.neighbours(0).after, ContourLines::kFarthest);
}

}  // namespace
}  // namespace leap_object_tracker
