#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <tf2_msgs/TFMessage.h>

#include "ros/conversions.hpp"
#include "support/nodelet_chain.hpp"

namespace leap_object_tracker {
namespace {

const std::string kScenes = LEAP_SOURCE_FOLDER "/config/scenes/";

class SimulatorNodelet : public NodeletChain {
 protected:
  bool loadScene(const std::string& scene) {
    ros::param::set("/leap/simulator/scene", kScenes + scene);
    return load("/leap/simulator", "SimulatorNodelet");
  }
};

TEST_F(SimulatorNodelet, publishesPairsWithCameraAndTruthUnderOneStamp) {
  ASSERT_TRUE(loadScene("x10_cube.yaml"));
  Inbox<sensor_msgs::Image> left(nh_, "/leap/left/image_raw"), right(nh_, "/leap/right/image_raw");
  Inbox<sensor_msgs::CameraInfo> left_info(nh_, "/leap/left/camera_info"),
      right_info(nh_, "/leap/right/camera_info");
  Inbox<geometry_msgs::PoseStamped> truth(nh_, "/ground_truth/pose");
  ASSERT_TRUE(eventually([&] {
    return left.size() > 4 && right.size() > 4 && right_info.size() > 4 && truth.size() > 4;
  }));
  const sensor_msgs::Image image = left.messages().back();
  EXPECT_EQ(image.encoding, "mono8");
  EXPECT_EQ(image.width, 640U);
  EXPECT_EQ(image.height, 240U);
  EXPECT_EQ(image.header.frame_id, "leap_left_optical_frame");
  EXPECT_EQ(right.messages().back().header.frame_id, "leap_right_optical_frame");

  const ros::Time stamp = right.messages()[2].header.stamp;
  const auto hasStamp = [&](const auto& inbox) {
    for (const auto& message : inbox.messages())
      if (message.header.stamp == stamp) return true;
    return false;
  };
  EXPECT_TRUE(hasStamp(left));
  EXPECT_TRUE(hasStamp(left_info));
  EXPECT_TRUE(hasStamp(right_info));
  EXPECT_TRUE(hasStamp(truth));
  EXPECT_NEAR(truth.messages()[2].pose.position.z, 0.1, 0.001);

  const auto left_camera = left_info.messages().back(), right_camera = right_info.messages().back();
  const StereoCalibration calibration = calibrationFrom(&left_camera, &right_camera);
  EXPECT_NEAR(calibration.baseline, 0.04001085, 1e-9);
}

TEST_F(SimulatorNodelet, restsWhileNobodyListens) {
  ASSERT_TRUE(loadScene("x10_cube.yaml"));
  {
    Inbox<geometry_msgs::PoseStamped> truth(nh_, "/ground_truth/pose");
    ASSERT_TRUE(eventually([&] { return truth.size() > 0; }));
  }
  Inbox<geometry_msgs::PoseStamped> again(nh_, "/ground_truth/pose");
  EXPECT_TRUE(eventually([&] { return again.size() > 0; }));
}

TEST_F(SimulatorNodelet, tellsTfWhereAMovingCameraIs) {
  ASSERT_TRUE(loadScene("eye_in_hand_bracket.yaml"));
  Inbox<geometry_msgs::PoseStamped> truth(nh_, "/ground_truth/pose");
  Inbox<tf2_msgs::TFMessage> tf(nh_, "/tf");
  ASSERT_TRUE(eventually([&] { return truth.size() > 1 && tf.size() > 1; }, 60));
  const geometry_msgs::TransformStamped transform = tf.messages()[0].transforms[0];
  EXPECT_EQ(transform.header.frame_id, "base_link");
  EXPECT_EQ(transform.child_frame_id, "leap_left_optical_frame");
}

TEST_F(SimulatorNodelet, saysWhichSceneItCannotRead) {
  const LogRecorder log;
  loadScene("no_such_scene.yaml");
  EXPECT_TRUE(eventually([&] { return log.holds("no_such_scene.yaml': cannot open the file"); }));
}

TEST_F(SimulatorNodelet, refusesUnknownParameters) {
  const LogRecorder log;
  ros::param::set("/leap/simulator/scenery", 1);
  loadScene("x10_cube.yaml");
  EXPECT_TRUE(eventually([&] { return log.holds("scenery"); }));
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "simulator_nodelet_test");
  const ros::NodeHandle stays_to_the_end;  // the last one to go would end ROS and its log
  return RUN_ALL_TESTS();
}
