#include <gtest/gtest.h>
#include <leap_object_tracker/LeapFrameInfo.h>

#include <algorithm>
#include <cstdio>
#include <map>

#include "support/nodelet_chain.hpp"

namespace leap_object_tracker {
namespace {

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))];
}

/// Times [s] of which the median and the 99 % are told.
struct Times {
  const char* name;
  std::vector<double> values;

  void print() const {
    if (!values.empty())
      std::printf("  %-46s median %5.1f ms, 99 %% %5.1f ms\n", name, 1e3 * quantile(values, 0.5),
                  1e3 * quantile(values, 0.99));
  }
};

/// Pictures repeat to and fro, so exposure control has nothing to control; all else is as in use.
TEST(LiveRate, tracksTheObjectWhileUsbRunsAtFullRate) {
  ros::NodeHandle nh;
  double seconds = 5;
  nh.getParam("/seconds", seconds);
  Inbox<TrackerStatus> statuses(nh, "/leap/tracker/status");
  Inbox<LeapFrameInfo> infos(nh, "/leap/frame_info");
  const auto isTracking = [&] {
    const auto messages = statuses.messages();
    return !messages.empty() && messages.back().state == TrackerStatus::TRACKING;
  };
  ASSERT_TRUE(eventually(isTracking, 60));
  ros::WallDuration(1).sleep();  // the search before took longer than a frame

  const std::size_t first = statuses.size();
  const std::uint32_t dropped_before = statuses.messages().back().dropped;
  ros::WallDuration(seconds).sleep();
  const auto messages = statuses.messages();
  std::map<ros::Time, double> transport;  // by stamp
  for (const LeapFrameInfo& info : infos.messages()) transport[info.header.stamp] = info.transport;
  std::vector<double> ages;
  Times all{"age: from the exposure to the pose", {}};
  Times on_the_bus{"- exposure, read-out and USB, to the last byte", {}};
  Times ours{"- from the last byte to the pose", {}};
  Times tracking{"  - of which tracking", {}};
  int tracked = 0;
  for (std::size_t i = first; i < messages.size(); ++i) {
    ages.push_back(1000 * messages[i].age);
    tracked += messages[i].state == TrackerStatus::TRACKING;
    const auto known = transport.find(messages[i].header.stamp);
    if (known == transport.end()) continue;
    all.values.push_back(messages[i].age);
    on_the_bus.values.push_back(known->second);
    ours.values.push_back(messages[i].age - known->second);
    tracking.values.push_back(1e-3 * messages[i].total_ms);
  }
  ASSERT_FALSE(ages.empty());
  std::printf(
      "%.0f s: %zu frames reached the tracker (%.1f/s), %d tracked, %u dropped; age of the pose: "
      "median %.1f ms, 99 %% %.1f ms\n",
      seconds, ages.size(), static_cast<double>(ages.size()) / seconds, tracked,
      messages.back().dropped - dropped_before, quantile(ages, 0.5), quantile(ages, 0.99));
  for (const Times* times : {&all, &on_the_bus, &ours, &tracking}) times->print();
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
