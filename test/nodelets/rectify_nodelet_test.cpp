#include <gtest/gtest.h>

#include <boost/make_shared.hpp>

#include "ros/conversions.hpp"
#include "support/nodelet_chain.hpp"
#include "support/stereo_camera_player.hpp"
#include "support/stereo_messages.hpp"

namespace leap_object_tracker {
namespace {

class RectifyNodelet : public NodeletChain {
 protected:
  RectifyNodelet() : camera_(nh_) {}

  /// A grey pair of the small camera, with `focal_length` [px].
  void publish(double stamp, double focal_length = 100) {
    StereoMessages pair;
    const ros::Time time(stamp);
    pair.left = boost::make_shared<sensor_msgs::Image>(grayImage(64, 48, 50, time));
    pair.right = boost::make_shared<sensor_msgs::Image>(grayImage(64, 48, 70, time));
    for (const bool right : {false, true}) {
      auto info = boost::make_shared<sensor_msgs::CameraInfo>(smallCamera(right, time));
      info->K[0] = info->K[4] = focal_length;
      (right ? pair.right_info : pair.left_info) = info;
    }
    camera_.publish(pair);
  }

  StereoCameraPlayer camera_;
};

TEST_F(RectifyNodelet, listensOnlyWhileSomebodyListensToIt) {
  ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
  EXPECT_FALSE(eventually([&] { return !camera_.unheard(); }, 2));
  {
    Inbox<sensor_msgs::Image> listener(nh_, "/leap/rect/left/image_rect");
    EXPECT_TRUE(eventually([&] { return camera_.heard(); }));
  }
  EXPECT_TRUE(eventually([&] { return camera_.unheard(); }));
}

TEST_F(RectifyNodelet, publishesPairsWithTheirCameraAndStamp) {
  ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
  Inbox<sensor_msgs::Image> left(nh_, "/leap/rect/left/image_rect"),
      right(nh_, "/leap/rect/right/image_rect");
  Inbox<sensor_msgs::CameraInfo> left_info(nh_, "/leap/rect/left/camera_info"),
      right_info(nh_, "/leap/rect/right/camera_info");
  ASSERT_TRUE(eventually([&] { return camera_.heard() && right_info.connected(); }));
  publish(5);
  ASSERT_TRUE(eventually([&] {
    return left.size() > 0 && right.size() > 0 && left_info.size() > 0 && right_info.size() > 0;
  }));
  const sensor_msgs::Image image = left.messages()[0];
  EXPECT_EQ(image.header.stamp, ros::Time(5));
  EXPECT_EQ(image.header.frame_id, "leap_left_optical_frame");
  EXPECT_EQ(image.encoding, "mono8");
  EXPECT_EQ(imageFrom(image).at<std::uint8_t>(24, 32), 50);
  const sensor_msgs::CameraInfo left_camera = left_info.messages()[0],
                                right_camera = right_info.messages()[0];
  EXPECT_EQ(left_camera.header.stamp, ros::Time(5));
  EXPECT_EQ(left_camera.R, smallCamera(false).R);
  EXPECT_DOUBLE_EQ(rectifiedCameraFrom(&left_camera, &right_camera).baseline, 0.1);
}

TEST_F(RectifyNodelet, followsACameraThatChanges) {
  ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
  Inbox<sensor_msgs::CameraInfo> info(nh_, "/leap/rect/left/camera_info");
  ASSERT_TRUE(eventually([&] { return camera_.heard(); }));
  publish(5, 100);
  ASSERT_TRUE(eventually([&] { return info.size() == 1; }));
  publish(6, 120);
  ASSERT_TRUE(eventually([&] { return info.size() == 2; }));
  EXPECT_DOUBLE_EQ(info.messages()[0].P[0], 100);
  EXPECT_DOUBLE_EQ(info.messages()[1].P[0], 120);
}

TEST_F(RectifyNodelet, prefersTheExactMapOfALeap) {
  ros::Publisher publisher = nh_.advertise<LeapCalibration>("/leap/calibration", 1, true);
  ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
  Inbox<sensor_msgs::CameraInfo> info(nh_, "/leap/rect/left/camera_info");
  ASSERT_TRUE(eventually([&] { return camera_.heard() && publisher.getNumSubscribers() > 0; }));
  LeapCalibration message;
  message.valid = 1;
  message.width = 64;
  message.height = 48;
  message.baseline = 0.04;
  for (auto* eye : {&message.left, &message.right}) {
    eye->fx = eye->fy = 140;
    eye->R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  }
  publisher.publish(message);
  double stamp = 5;
  EXPECT_TRUE(eventually([&] {
    const std::size_t before = info.size();
    publish(stamp += 1, 100);
    return eventually([&] { return info.size() > before; }) && info.messages().back().P[0] == 140;
  }));
}

TEST_F(RectifyNodelet, saysWhenStampsNeverAgree) {
  const LogRecorder log;
  ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
  Inbox<sensor_msgs::Image> listener(nh_, "/leap/rect/left/image_rect");
  ASSERT_TRUE(eventually([&] { return camera_.heard(); }));
  double stamp = 5;
  EXPECT_TRUE(eventually([&] {
    StereoMessages pair;
    const ros::Time left(stamp), right(stamp + 0.004);
    pair.left = boost::make_shared<sensor_msgs::Image>(grayImage(64, 48, 50, left));
    pair.right = boost::make_shared<sensor_msgs::Image>(grayImage(64, 48, 50, right));
    pair.left_info = boost::make_shared<sensor_msgs::CameraInfo>(smallCamera(false, left));
    pair.right_info = boost::make_shared<sensor_msgs::CameraInfo>(smallCamera(true, right));
    camera_.publish(pair);
    stamp += 0.01;
    return log.holds("stamps never agree");
  }));
  EXPECT_EQ(listener.size(), 0u);
}

TEST_F(RectifyNodelet, leavesOutFramesThatItCannotUseAndGoesOn) {
  const LogRecorder log;
  ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
  Inbox<sensor_msgs::Image> listener(nh_, "/leap/rect/left/image_rect");
  ASSERT_TRUE(eventually([&] { return camera_.heard(); }));
  publish(5, 0);
  EXPECT_TRUE(eventually([&] { return log.holds("not calibrated"); }));
  publish(6);
  EXPECT_TRUE(eventually([&] { return listener.size() == 1; }));
}

TEST_F(RectifyNodelet, goesOnWhenTimeJumpsBack) {
  ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
  Inbox<sensor_msgs::Image> listener(nh_, "/leap/rect/left/image_rect");
  ASSERT_TRUE(eventually([&] { return camera_.heard(); }));
  publish(1000);
  ASSERT_TRUE(eventually([&] { return listener.size() == 1; }));
  publish(5);
  EXPECT_TRUE(eventually([&] { return listener.size() == 2; }));
}

TEST_F(RectifyNodelet, refusesAnUnknownParameterAndNamesIt) {
  const LogRecorder log;
  ros::param::set("/leap/rectify/widht", 320);
  load("/leap/rectify", "RectifyNodelet");
  EXPECT_TRUE(eventually([&] { return log.holds("widht"); }));
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "rectify_nodelet_test");
  const ros::NodeHandle stays_to_the_end;  // the last one to go would end ROS and its log
  return RUN_ALL_TESTS();
}
