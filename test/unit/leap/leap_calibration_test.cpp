#include "leap_object_tracker/leap/leap_calibration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <functional>

#include "support/emulated_leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

StereoCalibration unitA(LeapMode mode = LeapMode::k640x480,
                        CalibrationConvention convention = CalibrationConvention::kRecommended) {
  return stereoCalibration(parseCalibration(calibrationOfUnitA()), mode, convention);
}

TEST(LeapCalibration, readsTheRecordsOfRealUnits) {
  const LeapCalibrationRecord a = parseCalibration(calibrationOfUnitA());
  EXPECT_EQ(0, a.version);
  EXPECT_EQ(136, a.score);
  EXPECT_EQ(1372049246u, a.unix_time);
  EXPECT_NEAR(40.01085, a.baseline_mm, 1e-5);
  EXPECT_NEAR(132.565445, a.left.focal_length, 1e-5);
  EXPECT_NEAR(-12.9539928, a.right.offset_u, 1e-6);
  EXPECT_NEAR(0.001965879, a.left.p2, 1e-8);
  EXPECT_NEAR(1.272, a.left.radial[0], 1e-6);
  EXPECT_NEAR(-0.006705, a.right.radial[5], 1e-8);
  EXPECT_NEAR(-0.005772362, a.left.rotation.y(), 1e-8);
  EXPECT_TRUE(calibrationWarnings(a).empty());
  const LeapCalibrationRecord b = parseCalibration(calibrationOfUnitB());
  EXPECT_NEAR(40.08873, b.baseline_mm, 1e-5);
  EXPECT_TRUE(calibrationWarnings(b).empty());
}

TEST(LeapCalibration, refusesASingleWrongBit) {
  for (std::size_t byte = 0; byte < kCalibrationBytes; ++byte) {
    Bytes bytes = calibrationOfUnitA();
    bytes[byte] ^= 0x10;
    EXPECT_FALSE(calibrationChecksumHolds(bytes));
    EXPECT_THROW(parseCalibration(bytes), std::invalid_argument) << byte;
  }
}

TEST(LeapCalibration, refusesMemoryThatIsEmptyOrOfAnotherLength) {
  EXPECT_THROW(parseCalibration(Bytes(156, 0)), std::invalid_argument);
  EXPECT_THROW(parseCalibration(Bytes(156, 0xff)), std::invalid_argument);
  EXPECT_THROW(parseCalibration(Bytes(155, 0)), std::invalid_argument);
  EXPECT_THROW(parseCalibration(Bytes()), std::invalid_argument);
}

struct Wrong {
  std::size_t offset;
  float value;
  const char* named;
};
class WrongNumbers : public testing::TestWithParam<Wrong> {};

TEST_P(WrongNumbers, areRefusedByNameThoughTheChecksumHolds) {
  Bytes bytes = calibrationOfUnitA();
  std::memcpy(&bytes[GetParam().offset], &GetParam().value, 4);
  try {
    parseCalibration(withChecksum(bytes));
    FAIL() << "taken";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string::npos, std::string(error.what()).find(GetParam().named)) << error.what();
  }
}

INSTANTIATE_TEST_SUITE_P(
    Each, WrongNumbers,
    testing::Values(Wrong{8, 50, "baseline"}, Wrong{8, NAN, "baseline"},
                    Wrong{16, 500, "left focal length"}, Wrong{84, 0, "right focal length"},
                    Wrong{20, 41, "left centre"}, Wrong{28, 1, "left p1"},
                    Wrong{36, INFINITY, "left k1"}, Wrong{36, -9, "radial distortion turns back"},
                    Wrong{60, 0, "rectified focal"}, Wrong{72, 0.1F, "rotation"}));

TEST(LeapCalibration, warnsOfAnUnknownVersionAndContradictingCentres) {
  Bytes bytes = calibrationOfUnitA();
  bytes[2] = 1;
  const float shift = 0.5F;
  std::memcpy(&bytes[12], &shift, 4);
  EXPECT_EQ(2u, calibrationWarnings(parseCalibration(withChecksum(bytes))).size());
}

TEST(LeapCalibration, seesTheRaysOfWorkedExamples) {
  struct Example {
    bool left;
    double u, v, ray_x, ray_y, rectified_x, rectified_y;
  };
  const Example examples[] = {{true, 320, 240, 0.047429, 0.056731, 0.041623, 0.054037},
                              {true, 100, 300, -1.525180, 0.484122, -1.542676, 0.484664},
                              {true, 500, 100, 1.362475, -0.964266, 1.349863, -0.961519},
                              {true, 0, 0, -3.058702, -2.277989, -3.138427, -2.337105},
                              {true, 639, 479, 3.412944, 2.573841, 3.318145, 2.505467},
                              {false, 320, 240, 0.098197, 0.023697, 0.099937, 0.021698},
                              {false, 100, 300, -1.490015, 0.456320, -1.483032, 0.453176},
                              {false, 500, 100, 1.424703, -1.007421, 1.432515, -1.014288}};
  const StereoCalibration calibration = unitA();
  for (const Example& e : examples) {
    const CameraCalibration& eye = e.left ? calibration.left : calibration.right;
    const Eigen::Vector2d ray = rayFromPixel(eye, {e.u, e.v});
    EXPECT_NEAR(e.ray_x, ray.x(), 2e-5);
    EXPECT_NEAR(e.ray_y, ray.y(), 2e-5);
    const Eigen::Vector2d rectified = (eye.rectified_from_raw * ray.homogeneous()).hnormalized();
    EXPECT_NEAR(e.rectified_x, rectified.x(), 5e-5);
    EXPECT_NEAR(e.rectified_y, rectified.y(), 5e-5);
  }
}

TEST(LeapCalibration, seesPointsWhereWorkedExamplesSeeThem) {
  struct Example {
    Eigen::Vector3d point;  // [m] in the left rectified frame
    Eigen::Vector2d left, right;
  };
  const auto check = [](const StereoCalibration& calibration,
                        const std::vector<Example>& examples) {
    const auto project = [](const CameraCalibration& eye, const Eigen::Vector3d& point) {
      return pixelFromRay(eye, (eye.rectified_from_raw.transpose() * point).hnormalized());
    };
    for (const Example& e : examples) {
      EXPECT_LT((project(calibration.left, e.point) - e.left).norm(), 0.01);
      const Eigen::Vector3d from_right = e.point - Eigen::Vector3d(calibration.baseline, 0, 0);
      EXPECT_LT((project(calibration.right, from_right) - e.right).norm(), 0.01);
    }
  };
  check(unitA(), {{{0, 0, 0.2}, {314.4739, 232.8290}, {280.2529, 237.1263}},
                  {{0.05, -0.03, 0.25}, {341.2516, 216.7500}, {312.0979, 221.2901}},
                  {{-0.1, 0.05, 0.3}, {269.2288, 255.4635}, {242.7719, 259.9658}},
                  {{0.02, 0, 0.1}, {341.2006, 232.8233}, {280.2456, 237.1263}}});
  check(stereoCalibration(parseCalibration(calibrationOfUnitB()), LeapMode::k640x480,
                          CalibrationConvention::kRecommended),
        {{{0, 0, 0.2}, {319.9416, 244.3461}, {294.1848, 246.8969}},
         {{0.05, -0.03, 0.25}, {347.0274, 227.9583}, {326.5479, 230.9125}},
         {{-0.1, 0.05, 0.3}, {274.5886, 267.2804}, {256.5128, 269.8402}},
         {{0.02, 0, 0.1}, {347.0127, 244.2321}, {294.1244, 246.8967}}});
}

TEST(LeapCalibration, scalesToBinnedAndWiderModes) {
  const CameraCalibration binned = unitA(LeapMode::k640x240).left;
  EXPECT_NEAR(132.565, binned.fx, 1e-3);
  EXPECT_NEAR(66.283, binned.fy, 1e-3);
  EXPECT_NEAR(313.709, binned.cx, 1e-3);
  EXPECT_NEAR(115.987, binned.cy, 1e-3);
  EXPECT_NEAR(313.709 + 56, unitA(LeapMode::k752x480).left.cx, 1e-3);
  // The same ray for the same place on the sensor.
  const Eigen::Vector2d full = rayFromPixel(unitA().left, {100, 100.5});
  const Eigen::Vector2d half = rayFromPixel(binned, {100, 50});
  EXPECT_LT((full - half).norm(), 1e-9);
}

TEST(LeapCalibration, readsTheTangentialPartAsAsked) {
  const CameraCalibration none = unitA(LeapMode::k640x480, CalibrationConvention::kNone).left;
  EXPECT_TRUE(none.rectified_from_raw.isIdentity());
  EXPECT_EQ(0, none.distortion[6]);
  const StereoCalibration vendor = unitA(LeapMode::k640x480, CalibrationConvention::kLeapuvc);
  EXPECT_EQ(DistortionModel::kRationalPolynomial, vendor.left.distortion_model);
  EXPECT_NEAR(0.000149298, vendor.left.distortion[2], 1e-9);
  EXPECT_NEAR(0.000598180, vendor.right.distortion[3], 1e-9);
  // Twice the angle of the recommended reading, about the opposite axis in y.
  EXPECT_NEAR(-2 * -0.005772362, vendor.left.rectified_from_raw(0, 2), 2e-5);
  // Without its tangential part it is the inverse of the stored map.
  CameraCalibration radial = vendor.left;
  radial.distortion[2] = radial.distortion[3] = 0;
  for (const Eigen::Vector2d& pixel : {Eigen::Vector2d(320, 240), Eigen::Vector2d(60, 100)})
    EXPECT_LT((pixelFromRay(radial, rayFromPixel(none, pixel)) - pixel).norm(), 0.1);
}

TEST(LeapCalibration, knowsItsConventionsByName) {
  EXPECT_EQ(CalibrationConvention::kLeapuvc, calibrationConventionFromName("leapuvc"));
  EXPECT_EQ(CalibrationConvention::kNone, calibrationConventionFromName("none"));
  EXPECT_FALSE(calibrationConventionFromName("other"));
}

}  // namespace
}  // namespace leap_object_tracker
