#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "support/nodelet_chain.hpp"

namespace leap_object_tracker {
namespace {

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Pictures repeat to and fro, so exposure control has nothing to control; all else is as in use.
TEST(LiveRate, tracksTheObjectWhileUsbRunsAtFullRate) {
  ros::NodeHandle nh;
  double seconds = 5;
  nh.getParam("/seconds", seconds);
  Inbox<TrackerStatus> statuses(nh, "/leap/tracker/status");
  const auto isTracking = [&] {
    const auto messages = statuses.messages();
    return !messages.empty() && messages.back().state == TrackerStatus::TRACKING;
  };
  ASSERT_TRUE(eventually(isTracking, 60));

  const std::size_t first = statuses.size();
  const std::uint32_t dropped_before = statuses.messages().back().dropped;
  ros::WallDuration(seconds).sleep();
  const auto messages = statuses.messages();
  std::vector<double> ages;
  int tracked = 0;
  for (std::size_t i = first; i < messages.size(); ++i) {
    ages.push_back(1000 * messages[i].age);
    tracked += messages[i].state == TrackerStatus::TRACKING;
  }
  ASSERT_FALSE(ages.empty());
  std::printf(
      "%.0f s: %zu frames reached the tracker (%.1f/s), %d tracked, %u dropped; age of the pose: "
      "median %.1f ms, 99 %% %.1f ms\n",
      seconds, ages.size(), static_cast<double>(ages.size()) / seconds, tracked,
      messages.back().dropped - dropped_before, quantile(ages, 0.5), quantile(ages, 0.99));
  EXPECT_GT(tracked, 0.5 * static_cast<double>(ages.size()));
  EXPECT_GT(static_cast<double>(ages.size()) / seconds, 15);
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argument_count, char** arguments) {
  testing::InitGoogleTest(&argument_count, arguments);
  ros::init(argument_count, arguments, "live_rate_test");
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
