#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <leap_object_tracker/StartTracking.h>
#include <rosbag/view.h>
#include <std_srvs/Trigger.h>
#include <tf2_msgs/TFMessage.h>

#include <boost/make_shared.hpp>
#include <fstream>

#include "leap_object_tracker/evaluation/trajectory.hpp"
#include "ros/conversions.hpp"
#include "ros/stereo_bag.hpp"
#include "support/nodelet_chain.hpp"
#include "support/program_run.hpp"
#include "support/stereo_camera_player.hpp"
#include "support/stereo_messages.hpp"
#include "support/temporary_folder.hpp"

namespace leap_object_tracker {
namespace {

const char* const kBag = LEAP_SOURCE_FOLDER "/bags/wobble_prism.bag";
const char* const kObject = LEAP_SOURCE_FOLDER "/config/objects/prism.yaml";
constexpr int kFrames = 25;

/// The first pairs of a bag, as they were recorded.
std::vector<StereoMessages> readPairs(const std::string& path) {
  std::vector<StereoMessages> pairs;
  StereoMatcher matcher(Eyes::kBoth);
  rosbag::Bag bag(path);
  for (const auto& entry : rosbag::View(bag)) {
    StereoMessages part;
    ros::Time stamp;
    const bool left = entry.getTopic().find("left") != std::string::npos;
    if (const auto image = entry.instantiate<sensor_msgs::Image>()) {
      (left ? part.left : part.right) = image;
      stamp = image->header.stamp;
    } else if (const auto info = entry.instantiate<sensor_msgs::CameraInfo>()) {
      (left ? part.left_info : part.right_info) = info;
      stamp = info->header.stamp;
    } else {
      continue;
    }
    const auto pair = matcher.add(stamp, part);
    if (pair) pairs.push_back(*pair);
    if (pairs.size() == kFrames) break;
  }
  return pairs;
}

std::string textFrom(const Pose& pose) {
  const geometry_msgs::Pose m = messageFrom(pose);
  std::ostringstream text;
  text.precision(17);
  text << m.position.x << ' ' << m.position.y << ' ' << m.position.z << ' ' << m.orientation.x
       << ' ' << m.orientation.y << ' ' << m.orientation.z << ' ' << m.orientation.w;
  return text.str();
}

class TrackerNodelet : public NodeletChain {
 protected:
  TrackerNodelet()
      : pairs_(readPairs(kBag)),
        truth_(StereoBag(kBag, {}, Eyes::kBoth).firstTruth().value().camera_from_object),
        camera_(nh_),
        status_(nh_, "/leap/tracker/status"),
        poses_(nh_, "/leap/tracker/pose"),
        transforms_(nh_, "/tf") {}

  void start(const std::string& how) {
    ros::param::set("/leap/tracker/object", std::string(kObject));
    ros::param::set("/leap/tracker/start", how);
    ASSERT_TRUE(load("/leap/rectify", "RectifyNodelet"));
    ASSERT_TRUE(load("/leap/tracker", "TrackerNodelet"));
    ASSERT_TRUE(eventually([&] { return camera_.heard() && poses_.connected(); }));
  }

  /// Gives a pair and waits for the tracker's answer to it.
  bool play(const StereoMessages& pair) {
    const std::size_t before = status_.size();
    camera_.publish(pair);
    return eventually([&] { return status_.size() > before; });
  }
  std::uint8_t state() const { return status_.messages().back().state; }
  Pose firstTruth() const { return truth_; }

  std::vector<StereoMessages> pairs_;
  Pose truth_;
  StereoCameraPlayer camera_;
  Inbox<TrackerStatus> status_;
  Inbox<geometry_msgs::PoseWithCovarianceStamped> poses_;
  Inbox<tf2_msgs::TFMessage> transforms_;
};

TEST_F(TrackerNodelet, givesThePosesOfTrackBag) {
  const std::string how = textFrom(firstTruth());
  start(how);
  for (const auto& pair : pairs_) ASSERT_TRUE(play(pair));
  ASSERT_TRUE(eventually([&] { return poses_.size() >= kFrames / 2; }));

  const TemporaryFolder folder;
  const ProgramRun run = runProgram(std::string(TRACK_BAG " ") + kBag + " --object " + kObject +
                                    " --start '" + how + "' --out " + folder.file("poses.tum"));
  ASSERT_EQ(run.exit_code, 0) << run.output;
  const Trajectory offline = readTum(folder.file("poses.tum"));
  const auto live = poses_.messages();
  ASSERT_GE(offline.size(), live.size());
  for (std::size_t i = 0; i < live.size(); ++i) {
    ASSERT_EQ(stampFrom(live[i].header.stamp), offline[i].stamp);
    const Pose pose = poseFrom(live[i].pose.pose);
    EXPECT_LT((pose.translation() - offline[i].camera_from_object.translation()).norm(), 1e-7);
    EXPECT_LT(angleBetween(pose.linear(), offline[i].camera_from_object.linear()), 1e-6);
  }
}

TEST_F(TrackerNodelet, publishesTheTransformFromCameraToObjectAtTheExposure) {
  start(textFrom(firstTruth()));
  ASSERT_TRUE(play(pairs_[0]));
  ASSERT_TRUE(eventually([&] { return transforms_.size() > 0 && poses_.size() > 0; }));
  const auto transform = transforms_.messages()[0].transforms.at(0);
  EXPECT_EQ(transform.header.stamp, pairs_[0].left->header.stamp);
  EXPECT_EQ(transform.header.frame_id, "leap_left_optical_frame");
  EXPECT_EQ(transform.child_frame_id, "prism");
  const Pose pose = poseFrom(poses_.messages()[0].pose.pose);
  EXPECT_TRUE(poseFrom(transform).isApprox(pose, 1e-9));
  EXPECT_LT((pose.translation() - firstTruth().translation()).norm(), 0.003);
}

TEST_F(TrackerNodelet, stopsAndStartsWhenTold) {
  start("wait");
  ASSERT_TRUE(play(pairs_[0]));
  EXPECT_EQ(state(), TrackerStatus::IDLE);

  StartTracking order;
  order.request.pose.header.frame_id = "leap_left_optical_frame";
  order.request.pose.pose = messageFrom(firstTruth());
  ASSERT_TRUE(ros::service::call("/leap/tracker/start", order));
  EXPECT_TRUE(order.response.success) << order.response.message;
  ASSERT_TRUE(play(pairs_[1]));
  EXPECT_EQ(state(), TrackerStatus::TRACKING);

  std_srvs::Trigger stop;
  ASSERT_TRUE(ros::service::call("/leap/tracker/stop", stop));
  ASSERT_TRUE(play(pairs_[2]));
  EXPECT_EQ(state(), TrackerStatus::IDLE);

  std_srvs::Trigger restart;
  ASSERT_TRUE(ros::service::call("/leap/tracker/restart", restart));
  ASSERT_TRUE(play(pairs_[3]));
  EXPECT_NE(state(), TrackerStatus::IDLE);
}

TEST_F(TrackerNodelet, refusesAStartPoseThatIsNone) {
  start("wait");
  StartTracking order;  // a quaternion of length zero
  ASSERT_TRUE(ros::service::call("/leap/tracker/start", order));
  EXPECT_FALSE(order.response.success);
  EXPECT_NE(order.response.message.find("quaternion"), std::string::npos);
}

TEST_F(TrackerNodelet, startsFromAPoseOnATopic) {
  ros::Publisher publisher =
      nh_.advertise<geometry_msgs::PoseWithCovarianceStamped>("/leap/initialpose", 1);
  start("wait");
  ASSERT_TRUE(play(pairs_[0]));
  ASSERT_TRUE(eventually([&] { return publisher.getNumSubscribers() > 0; }));
  geometry_msgs::PoseWithCovarianceStamped message;
  message.header.frame_id = "leap_left_optical_frame";
  message.pose.pose = messageFrom(firstTruth());
  publisher.publish(message);
  EXPECT_TRUE(eventually([&] { return play(pairs_[1]) && state() == TrackerStatus::TRACKING; }));
}

TEST_F(TrackerNodelet, goesOnWhenTimeJumpsBack) {
  start("search");
  for (int round = 0; round < 2; ++round)
    for (int i = 0; i < 10; ++i) ASSERT_TRUE(play(pairs_[static_cast<std::size_t>(i)]));
  EXPECT_EQ(state(), TrackerStatus::TRACKING);
}

TEST_F(TrackerNodelet, saysWhatIsWrongWithItsObjectAndStaysQuiet) {
  const LogRecorder log;
  ros::param::set("/leap/tracker/object", std::string("/nowhere.yaml"));
  load("/leap/tracker", "TrackerNodelet");
  EXPECT_TRUE(eventually([&] { return log.holds("/nowhere.yaml"); }));
  EXPECT_FALSE(poses_.connected());
}

TEST_F(TrackerNodelet, takesTheCameraToBeAtRestWhenNobodyKnowsItsMotion) {
  const LogRecorder log;
  ros::param::set("/leap/tracker/fixed_frame", std::string("nowhere"));
  start(textFrom(firstTruth()));
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(play(pairs_[static_cast<std::size_t>(i)]));
  EXPECT_EQ(state(), TrackerStatus::TRACKING);
  EXPECT_TRUE(eventually([&] { return log.holds("taken to be at rest"); }));
}

TEST_F(TrackerNodelet, leavesOutPairsThatAreNotOfTheSizeOfTheirCamera) {
  const LogRecorder log;
  StereoCameraPlayer rectified(nh_, "image_rect", "/leap/rect/");
  ros::param::set("/leap/tracker/object", std::string(kObject));
  ASSERT_TRUE(load("/leap/tracker", "TrackerNodelet"));
  ASSERT_TRUE(eventually([&] { return rectified.heard(); }));
  StereoMessages pair;
  const ros::Time time(5);
  pair.left = boost::make_shared<sensor_msgs::Image>(grayImage(32, 48, 50, time));
  pair.right = boost::make_shared<sensor_msgs::Image>(grayImage(32, 48, 50, time));
  pair.left_info = boost::make_shared<sensor_msgs::CameraInfo>(smallCamera(false, time));
  pair.right_info = boost::make_shared<sensor_msgs::CameraInfo>(smallCamera(true, time));
  rectified.publish(pair);
  EXPECT_TRUE(eventually([&] { return log.holds("size is not that of its camera_info"); }));
}

TEST_F(TrackerNodelet, dropsPairsThatWaitBehindANewerOne) {
  start("search");
  for (const auto& pair : pairs_) camera_.publish(pair);
  const ros::Time last = pairs_.back().left->header.stamp;
  ASSERT_TRUE(eventually(
      [&] { return status_.size() > 0 && status_.messages().back().header.stamp == last; }));
  EXPECT_LT(status_.size(), pairs_.size());
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "tracker_nodelet_test");
  const ros::NodeHandle stays_to_the_end;  // the last one to go would end ROS and its log
  return RUN_ALL_TESTS();
}
