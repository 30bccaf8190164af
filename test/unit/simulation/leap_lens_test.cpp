#include "leap_object_tracker/simulation/leap_lens.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

LeapUnit unitA() { return loadLeapUnit(LEAP_SOURCE_FOLDER "/config/calibration/leap_unit_a.yaml"); }
LeapUnit unitB() { return loadLeapUnit(LEAP_SOURCE_FOLDER "/config/calibration/leap_unit_b.yaml"); }

const SensorMode kFull = sensorMode("640x480");

TEST(LeapLens, givesTheRawRaysOfUnitA) {
  const LeapLens left(unitA().left, kFull), right(unitA().right, kFull);
  struct Row {
    const LeapLens& lens;
    double u, v, x, y;
  };
  const Row rows[] = {
      {left, 320, 240, 0.047429, 0.056731},   {left, 100, 300, -1.525180, 0.484122},
      {left, 500, 100, 1.362475, -0.964266},  {left, 0, 0, -3.058702, -2.277989},
      {left, 639, 479, 3.412944, 2.573841},   {right, 320, 240, 0.098197, 0.023697},
      {right, 100, 300, -1.490015, 0.456320}, {right, 500, 100, 1.424703, -1.007421}};
  for (const auto& row : rows) {
    const Eigen::Vector2d ray = row.lens.rawRay(row.u, row.v);
    EXPECT_NEAR(ray.x(), row.x, 2e-6) << row.u << ", " << row.v;
    EXPECT_NEAR(ray.y(), row.y, 2e-6) << row.u << ", " << row.v;
  }
}

TEST(LeapLens, turnsRaysIntoTheRectifiedFrame) {
  const LeapLens left(unitA().left, kFull);
  const Eigen::Vector3d ray = left.ray(100, 300);
  EXPECT_NEAR(ray.x() / ray.z(), -1.542676, 2e-6);
  EXPECT_NEAR(ray.y() / ray.z(), 0.484664, 2e-6);
}

TEST(LeapLens, projectsPointsAsUnitsAAndBDo) {
  struct Row {
    Eigen::Vector3d point;  // [m] left rectified frame
    Eigen::Vector2d a_left, a_right, b_left, b_right;
  };
  const Row rows[] = {{{0, 0, 0.2},
                       {314.4739, 232.8290},
                       {280.2529, 237.1263},
                       {319.9416, 244.3461},
                       {294.1848, 246.8969}},
                      {{0.05, -0.03, 0.25},
                       {341.2516, 216.7500},
                       {312.0979, 221.2901},
                       {347.0274, 227.9583},
                       {326.5479, 230.9125}},
                      {{-0.1, 0.05, 0.3},
                       {269.2288, 255.4635},
                       {242.7719, 259.9658},
                       {274.5886, 267.2804},
                       {256.5128, 269.8402}},
                      {{0.02, 0, 0.1},
                       {341.2006, 232.8233},
                       {280.2456, 237.1263},
                       {347.0127, 244.2321},
                       {294.1244, 246.8967}}};
  const auto expectPixel = [](const LensRecord& eye, const Eigen::Vector3d& point,
                              const Eigen::Vector2d& expected) {
    EXPECT_LT((LeapLens(eye, kFull).pixel(point) - expected).norm(), 2e-4);
  };
  for (const auto& row : rows) {
    const Eigen::Vector3d to_right_a(unitA().baseline, 0, 0), to_right_b(unitB().baseline, 0, 0);
    expectPixel(unitA().left, row.point, row.a_left);
    expectPixel(unitA().right, row.point - to_right_a, row.a_right);
    expectPixel(unitB().left, row.point, row.b_left);
    expectPixel(unitB().right, row.point - to_right_b, row.b_right);
  }
}

TEST(LeapLens, followsTheRadialTable) {
  LensRecord eye = unitA().left;
  eye.tangential = {0, 0};
  const LeapLens lens(eye, kFull);
  const double table[][2] = {{0.25, 0.247216}, {0.5, 0.481825}, {1, 0.924087}, {1.5, 1.403824},
                             {2, 2.012405},    {2.5, 2.842215}, {3, 4.004516}, {3.5, 5.653734}};
  for (const auto& row : table)
    EXPECT_NEAR(lens.rawRay(lens.cx() + row[0] * lens.fx(), lens.cy()).x(), row[1], 1e-5);
}

TEST(LeapLens, comesBackToThePixelThatARayLeft) {
  for (const char* mode : {"640x480", "640x240", "752x120"}) {
    const LeapLens lens(unitB().right, sensorMode(mode));
    for (int i = 0; i <= 10; ++i)
      for (int j = 0; j <= 10; ++j) {
        const Eigen::Vector2d pixel(lens.mode().width * 0.1 * i, lens.mode().height * 0.1 * j);
        EXPECT_LT((lens.pixel(lens.ray(pixel.x(), pixel.y())) - pixel).norm(), 1e-6)
            << mode << " at " << pixel.transpose();
      }
  }
}

TEST(LeapLens, halvesTheRowsOfABinnedMode) {
  const LeapLens lens(unitA().left, sensorMode("640x240"));
  EXPECT_NEAR(lens.fx(), 132.565, 1e-3);
  EXPECT_NEAR(lens.fy(), 66.283, 1e-3);
  EXPECT_NEAR(lens.cx(), 313.709, 1e-3);
  EXPECT_NEAR(lens.cy(), 115.987, 1e-3);
}

TEST(LeapLens, hasNoPixelForAPointBehindIt) {
  const LeapLens lens(unitA().left, kFull);
  EXPECT_FALSE(lens.pixel({0, 0, -0.1}).allFinite());
  EXPECT_FALSE(lens.pixel({1, 0, 0.01}).allFinite());
}

TEST(SensorMode, refusesOneThatTheLeapDoesNotHave) {
  EXPECT_THROW(sensorMode("320x240"), std::runtime_error);
}

}  // namespace
}  // namespace leap_object_tracker
