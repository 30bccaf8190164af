#include "ros/conversions.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "support/stereo_messages.hpp"

namespace leap_object_tracker {
namespace {

using testing::HasSubstr;

struct Infos {
  sensor_msgs::CameraInfo left = smallCamera(false);
  sensor_msgs::CameraInfo right = smallCamera(true);
};

std::string complaintAbout(const Infos& infos) {
  try {
    calibrationFrom(&infos.left, &infos.right);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(CalibrationFromCameraInfo, takesTheBaselineFromTheProjectionOfTheRightEye) {
  const Infos infos;
  const StereoCalibration calibration = calibrationFrom(&infos.left, &infos.right);
  EXPECT_DOUBLE_EQ(calibration.baseline, 0.1);
  EXPECT_EQ(calibration.left.size, cv::Size(64, 48));
  EXPECT_EQ(calibration.left.distortion_model, DistortionModel::kNone);
}

TEST(CalibrationFromCameraInfo, knowsTheFourModels) {
  Infos infos;
  infos.left.D = infos.right.D = {0.1, 0, 0, 0, 0};
  EXPECT_EQ(calibrationFrom(&infos.left, &infos.right).left.distortion_model,
            DistortionModel::kPlumbBob);
  for (auto* info : {&infos.left, &infos.right}) {
    info->distortion_model = "rational_polynomial";
    info->D = {1, 0, 0, 0, 0, 1, 0, 0};
  }
  EXPECT_EQ(calibrationFrom(&infos.left, &infos.right).left.distortion_model,
            DistortionModel::kRationalPolynomial);
  for (auto* info : {&infos.left, &infos.right}) {
    info->distortion_model = "equidistant";
    info->D = {0, 0, 0, 0};
  }
  EXPECT_EQ(calibrationFrom(&infos.left, &infos.right).left.distortion_model,
            DistortionModel::kEquidistant);
}

TEST(CalibrationFromCameraInfo, halvesTheCameraForBinnedImages) {
  Infos infos;
  infos.left.binning_x = infos.left.binning_y = 2;
  infos.right.binning_x = infos.right.binning_y = 2;
  const CameraCalibration eye = calibrationFrom(&infos.left, &infos.right).left;
  EXPECT_EQ(eye.size, cv::Size(32, 24));
  EXPECT_DOUBLE_EQ(eye.fx, 50);
  EXPECT_DOUBLE_EQ(eye.cx, 15.5);  // still the middle
}

TEST(CalibrationFromCameraInfo, refusesAnUncalibratedCamera) {
  Infos infos;
  infos.left.K.fill(0);
  EXPECT_THAT(complaintAbout(infos), HasSubstr("not calibrated"));
  infos = {};
  infos.right.P.fill(0);
  EXPECT_THAT(complaintAbout(infos), HasSubstr("right"));
  infos = {};
  infos.left.R.fill(0);
  EXPECT_THAT(complaintAbout(infos), HasSubstr("R is not a rotation"));
  infos = {};
  infos.left.width = 0;
  EXPECT_THAT(complaintAbout(infos), HasSubstr("zero"));
}

TEST(CalibrationFromCameraInfo, refusesABaselineThatIsNotAboveZero) {
  Infos infos;
  infos.right.P[3] = 0;
  EXPECT_THAT(complaintAbout(infos), HasSubstr("baseline"));
  infos.right.P[3] = 10;
  EXPECT_THAT(complaintAbout(infos), HasSubstr("exchanged"));
}

TEST(CalibrationFromCameraInfo, refusesNumbersThatAreNotFinite) {
  Infos infos;
  infos.left.D[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(complaintAbout(infos), HasSubstr("not finite"));
}

TEST(CalibrationFromCameraInfo, refusesAnUnknownModelAndAWrongNumberOfCoefficients) {
  Infos infos;
  infos.left.distortion_model = "mirror";
  EXPECT_THAT(complaintAbout(infos), HasSubstr("mirror"));
  infos = {};
  infos.left.D = {0.1, 0.2};
  EXPECT_THAT(complaintAbout(infos), HasSubstr("coefficients"));
}

TEST(CalibrationFromCameraInfo, doesWithOneEye) {
  const Infos infos;
  EXPECT_GT(calibrationFrom(&infos.left, nullptr).baseline, 0);
  EXPECT_DOUBLE_EQ(calibrationFrom(nullptr, &infos.right).baseline, 0.1);
  EXPECT_THROW(calibrationFrom(nullptr, nullptr), std::invalid_argument);
}

TEST(CalibrationFromLeap, keepsTheExactMap) {
  LeapCalibration message;
  message.valid = 1;
  message.width = 64;
  message.height = 48;
  message.baseline = 0.04;
  for (auto* eye : {&message.left, &message.right}) {
    eye->fx = 130;
    eye->fy = 65;
    eye->pixel_to_ray[0] = 1.2;
    eye->R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  }
  EXPECT_TRUE(holdsFor(message, smallCamera(false)));
  const StereoCalibration calibration = calibrationFrom(message);
  EXPECT_EQ(calibration.left.distortion_model, DistortionModel::kLeapInverse);
  EXPECT_DOUBLE_EQ(calibration.left.distortion[0], 1.2);
  EXPECT_DOUBLE_EQ(calibration.baseline, 0.04);

  message.width = 32;
  EXPECT_FALSE(holdsFor(message, smallCamera(false)));
  message.right.R.fill(0);
  EXPECT_THROW(calibrationFrom(message), std::invalid_argument);
}

TEST(RectifiedCamera, survivesTheWayThroughCameraInfo) {
  const RectifiedStereoCamera camera{130, 319.5, 239.5, 0.04, {640, 480}};
  const auto left = messageFrom(camera, false), right = messageFrom(camera, true);
  EXPECT_TRUE(sameCamera(rectifiedCameraFrom(&left, &right), camera));
}

TEST(RectifiedCamera, refusesAPairWithoutCommonCentre) {
  const RectifiedStereoCamera camera{130, 319.5, 239.5, 0.04, {640, 480}};
  const auto left = messageFrom(camera, false);
  auto right = messageFrom(camera, true);
  right.P[2] += 5;
  EXPECT_THROW(rectifiedCameraFrom(&left, &right), std::invalid_argument);
}

TEST(PoseFromText, readsSevenNumbersAndNormalizes) {
  const Pose pose = poseFrom(std::string("-0.01 0.02 0.1 0 0 0 2"));
  EXPECT_DOUBLE_EQ(pose.translation().x(), -0.01);
  EXPECT_TRUE(pose.linear().isApprox(Eigen::Matrix3d::Identity()));
}

TEST(PoseFromText, refusesAnythingElse) {
  for (const char* text : {"", "1 2 3", "0 0 1 0 0 0 1 9", "0 0 one 0 0 0 1", "0 0 1 0 0 0 0"})
    EXPECT_THROW(poseFrom(std::string(text)), std::invalid_argument) << "'" << text << "'";
}

TEST(ImageFromMessage, refusesWhatIsNotMono8OrTooShort) {
  EXPECT_EQ(imageFrom(grayImage(6, 4, 7)).at<std::uint8_t>(3, 5), 7);
  sensor_msgs::Image color = grayImage(6, 4, 7);
  color.encoding = "rgb8";
  EXPECT_THROW(imageFrom(color), std::invalid_argument);
  sensor_msgs::Image torn = grayImage(6, 4, 7);
  torn.data.pop_back();
  EXPECT_THROW(imageFrom(torn), std::invalid_argument);
}

TEST(Stamps, keepTheNanosecond) {
  const ros::Time time(1700000000, 123456789);
  EXPECT_EQ(timeFrom(stampFrom(time)), time);
}

}  // namespace
}  // namespace leap_object_tracker
