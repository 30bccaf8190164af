#include <diagnostic_msgs/DiagnosticArray.h>
#include <dynamic_reconfigure/client.h>
#include <gtest/gtest.h>
#include <leap_object_tracker/LeapCalibration.h>
#include <leap_object_tracker/LeapDriverConfig.h>
#include <leap_object_tracker/LeapFrameInfo.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include "leap_object_tracker/geometry/symmetry.hpp"
#include "leap_object_tracker/simulation/simulator.hpp"
#include "ros/conversions.hpp"
#include "support/nodelet_chain.hpp"

namespace leap_object_tracker {
namespace {

/// The launch file runs beside this program; the emulated Leap sits in its manager.
class LiveChain : public testing::Test {
 protected:
  ros::NodeHandle nh_;
};

SimulatedFrame truth() {
  Scene scene = loadScene(LEAP_SOURCE_FOLDER "/config/scenes/x10_cube_textured.yaml");
  scene.bodies.front().motion.sweeps.clear();
  scene.bodies.front().motion.wobbles.clear();
  return *Simulator(scene).next();
}

TEST_F(LiveChain, bringsUsbBytesToAPoseOnTf) {
  Inbox<tf2_msgs::TFMessage> tf(nh_, "/tf");
  const Eigen::Vector3d expected = truth().camera_from_object.translation();
  const auto isThere = [&] {
    for (const auto& message : tf.messages())
      for (const auto& transform : message.transforms)
        if (transform.header.frame_id == "leap_left_optical_frame" &&
            (poseFrom(transform).translation() - expected).norm() < 0.003)
          return true;
    return false;
  };
  EXPECT_TRUE(eventually(isThere, 100)) << "last transforms seen: " << tf.size();
}

TEST_F(LiveChain, stampsBothEyesWithOneTimeOfTheHostsClock) {
  Inbox<sensor_msgs::Image> left(nh_, "/leap/left/image_raw"), right(nh_, "/leap/right/image_raw");
  ASSERT_TRUE(eventually([&] { return left.size() > 10 && right.size() > 10; }, 30));
  const ros::Time stamp = right.messages()[3].header.stamp;
  EXPECT_LT(std::abs((ros::Time::now() - stamp).toSec()), 30);
  bool found = false;
  for (const auto& message : left.messages()) found |= message.header.stamp == stamp;
  EXPECT_TRUE(found);
  EXPECT_EQ("leap_left_optical_frame", left.messages()[0].header.frame_id);
  EXPECT_EQ("mono8", left.messages()[0].encoding);
}

TEST_F(LiveChain, publishesTheCalibrationOfTheDevice) {
  Inbox<sensor_msgs::CameraInfo> left(nh_, "/leap/left/camera_info"),
      right(nh_, "/leap/right/camera_info");
  Inbox<LeapCalibration> exact(nh_, "/leap/calibration");
  ASSERT_TRUE(
      eventually([&] { return left.size() > 0 && right.size() > 0 && exact.size() > 0; }, 30));
  const auto left_info = left.messages()[0], right_info = right.messages()[0];
  EXPECT_EQ("rational_polynomial", left_info.distortion_model);
  EXPECT_EQ(8U, left_info.D.size());
  EXPECT_NEAR(0.04001085, calibrationFrom(&left_info, &right_info).baseline, 1e-7);
  const LeapCalibration message = exact.messages()[0];
  EXPECT_TRUE(message.valid);
  EXPECT_EQ(240U, message.height);
  EXPECT_NEAR(132.565445, message.left.fx, 1e-5);
  EXPECT_NEAR(132.565445 / 2, message.left.fy, 1e-5);
  EXPECT_NEAR(0.04001085, message.baseline, 1e-7);
}

TEST_F(LiveChain, changesSettingsWhilePicturesFlow) {
  Inbox<LeapFrameInfo> infos(nh_, "/leap/frame_info");
  dynamic_reconfigure::Client<LeapDriverConfig> client("/leap/driver");
  LeapDriverConfig config;
  ASSERT_TRUE(client.getCurrentConfiguration(config, ros::Duration(20)));
  const LeapDriverConfig before = config;
  config.auto_exposure = false;
  config.exposure_us = 137;
  config.led_centre = false;
  ASSERT_TRUE(client.setConfiguration(config));
  EXPECT_TRUE(eventually(
      [&] {
        const auto messages = infos.messages();
        return !messages.empty() && messages.back().exposure == 137;
      },
      20));
  EXPECT_TRUE(client.setConfiguration(before));
}

TEST_F(LiveChain, tellsDiagnosticsHowItFares) {
  Inbox<diagnostic_msgs::DiagnosticArray> diagnostics(nh_, "/diagnostics");
  const auto valueOf = [&](const std::string& key) {
    std::string value;
    for (const auto& message : diagnostics.messages())
      for (const auto& status : message.status)
        for (const auto& pair : status.values)
          if (pair.key == key) value = pair.value;
    return value;
  };
  EXPECT_TRUE(eventually([&] { return valueOf("serial number") == "LP10000000001"; }, 30));
  EXPECT_EQ("640x240", valueOf("mode"));
  EXPECT_EQ("0", valueOf("re-connections"));
  EXPECT_FALSE(valueOf("exposure [us]").empty());
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argument_count, char** arguments) {
  testing::InitGoogleTest(&argument_count, arguments);
  ros::init(argument_count, arguments, "live_chain_test");
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
