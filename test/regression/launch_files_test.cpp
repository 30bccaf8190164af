// Listens to what a launch file started, as a user would, and compares it with the truth that is
// played beside it. Parameters: ~trackers, ~object, ~poses, ~jumps_back.
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <gtest/gtest.h>
#include <tf2_msgs/TFMessage.h>

#include <map>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "ros/conversions.hpp"
#include "support/nodelet_chain.hpp"

namespace leap_object_tracker {
namespace {

class LaunchFile : public testing::Test {
 protected:
  using Poses = Inbox<geometry_msgs::PoseWithCovarianceStamped>;

  LaunchFile()
      : private_nh_("~"),
        object_(loadObject(private_nh_.param<std::string>("object", ""))),
        needed_(static_cast<std::size_t>(private_nh_.param("poses", 20))),
        truth_(nh_, "/ground_truth/pose"),
        transforms_(nh_, "/tf"),
        spinner_(2) {
    std::istringstream names(private_nh_.param<std::string>("trackers", "tracker"));
    for (std::string name; names >> name;)
      poses_.push_back(std::make_unique<Poses>(nh_, "/leap/" + name + "/pose"));
    spinner_.start();
  }

  bool jumpedBack() const {
    const auto poses = poses_[0]->messages();
    for (std::size_t i = 1; i < poses.size(); ++i)
      if (poses[i].header.stamp < poses[i - 1].header.stamp) return true;
    return false;
  }

  /// Share of the poses with a truth of the same stamp that are within 5 mm and 5 deg.
  double goodShare(const Poses& inbox) const {
    std::map<ros::Time, Pose> truth;
    for (const auto& message : truth_.messages())
      truth[message.header.stamp] = poseFrom(message.pose);
    int known = 0, good = 0;
    for (const auto& message : inbox.messages()) {
      const auto found = truth.find(message.header.stamp);
      if (found == truth.end()) continue;
      ++known;
      const Pose pose = poseFrom(message.pose.pose);
      const double offset = (pose.translation() - found->second.translation()).norm();
      const double turn =
          angleBetween(pose.linear(), found->second.linear(), object_.symmetry) * 180 / M_PI;
      if (offset < 0.005 && turn < 5) ++good;
    }
    return known == 0 ? 0 : static_cast<double>(good) / known;
  }

  ros::NodeHandle nh_, private_nh_;
  ObjectModel object_;
  std::size_t needed_;
  Inbox<geometry_msgs::PoseStamped> truth_;
  Inbox<tf2_msgs::TFMessage> transforms_;
  std::vector<std::unique_ptr<Poses>> poses_;
  ros::AsyncSpinner spinner_;
};

TEST_F(LaunchFile, endsInPosesNearTheTruth) {
  ASSERT_TRUE(eventually(
      [&] {
        for (const auto& inbox : poses_)
          if (inbox->size() < needed_) return false;
        return true;
      },
      60))
      << poses_[0]->size() << " poses came";
  for (const auto& inbox : poses_) EXPECT_GT(goodShare(*inbox), 0.9);
  EXPECT_GT(transforms_.size(), 0u);
  if (private_nh_.param("jumps_back", false)) {
    EXPECT_TRUE(eventually([&] { return jumpedBack(); }));
  }
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "launch_files_test");
  const ros::NodeHandle stays_to_the_end;  // the last one to go would end ROS and its log
  return RUN_ALL_TESTS();
}
