#include "leap_object_tracker/leap/distortion_fit.hpp"

#include <gtest/gtest.h>

#include "leap_object_tracker/leap/leap_calibration.hpp"
#include "support/emulated_leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

StereoCalibration calibrationOf(const Bytes& unit, LeapMode mode) {
  return stereoCalibration(parseCalibration(unit), mode, CalibrationConvention::kRecommended);
}

// The residuals that the tangential part leaves, with focal lengths and centre free: 0.43, 0.17,
// 0.74, 0.93 px.
TEST(DistortionFit, leavesOnlyWhatTheTangentialPartCannotExplain) {
  const StereoCalibration a = calibrationOf(calibrationOfUnitA(), LeapMode::k640x480);
  const StereoCalibration b = calibrationOf(calibrationOfUnitB(), LeapMode::k640x480);
  EXPECT_LT(fitRationalPolynomial(a.left, FitFreedom::kAll).rms, 0.45);
  EXPECT_LT(fitRationalPolynomial(a.right, FitFreedom::kAll).rms, 0.19);
  EXPECT_LT(fitRationalPolynomial(b.left, FitFreedom::kAll).rms, 0.78);
  EXPECT_LT(fitRationalPolynomial(b.right, FitFreedom::kAll).rms, 0.97);
}

TEST(DistortionFit, isNearlyExactForAPurelyRadialLens) {
  for (const LeapModeInfo& mode : leapModes()) {
    const StereoCalibration calibration = stereoCalibration(
        parseCalibration(calibrationOfUnitA()), mode.mode, CalibrationConvention::kNone);
    EXPECT_LT(fitRationalPolynomial(calibration.left, FitFreedom::kAll).largest, 0.3) << mode.name;
  }
}

TEST(DistortionFit, reportsTheResidualThatItHas) {
  const CameraCalibration exact = calibrationOf(calibrationOfUnitA(), LeapMode::k640x240).left;
  const DistortionFit fit = fitRationalPolynomial(exact, FitFreedom::kAll);
  double largest = 0;
  for (int v = 0; v <= 239; ++v)
    for (int u = 0; u < 640; ++u) {
      Eigen::Vector2d difference =
          pixelFromRay(fit.camera, rayFromPixel(exact, Eigen::Vector2d(u, v))) -
          Eigen::Vector2d(u, v);
      difference.y() *= exact.fx / exact.fy;
      largest = std::max(largest, difference.norm());
    }
  EXPECT_NEAR(fit.largest, largest, 0.05 * largest + 0.01);
}

TEST(DistortionFit, staysMonotonousBeyondTheImage) {
  for (const Bytes& unit : {calibrationOfUnitA(), calibrationOfUnitB()})
    for (const LeapMode mode : {LeapMode::k640x480, LeapMode::k640x240, LeapMode::k752x480}) {
      const DistortionFit fit =
          fitRationalPolynomial(calibrationOf(unit, mode).right, FitFreedom::kAll);
      double previous = -1;
      for (double slope = 0; slope < 12; slope += 0.1) {
        const double u = pixelFromRay(fit.camera, {slope, 0}).x();
        EXPECT_GT(u, previous) << slope;
        previous = u;
      }
    }
}

TEST(DistortionFit, keepsFocalLengthAndCentreWhenAsked) {
  const CameraCalibration exact = calibrationOf(calibrationOfUnitB(), LeapMode::k640x480).left;
  const CameraCalibration fit = fitRationalPolynomial(exact, FitFreedom::kRadialPart).camera;
  EXPECT_EQ(exact.fx, fit.fx);
  EXPECT_EQ(exact.cy, fit.cy);
  EXPECT_EQ(0, fit.distortion[2]);
  EXPECT_EQ(0, fit.distortion[3]);
}

}  // namespace
}  // namespace leap_object_tracker
