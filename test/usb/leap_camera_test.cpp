#include "leap_object_tracker/leap/leap_camera.hpp"

#include <dirent.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "emulated_leap_bus.hpp"

namespace leap_object_tracker {
namespace {

using std::chrono::milliseconds;
using Clock = std::chrono::steady_clock;

class LeapCameraTest : public testing::Test {
 protected:
  ~LeapCameraTest() override { EXPECT_TRUE(leap_.forbidden().empty()); }

  EmulatedBus::Port& port() { return bus_.port(1); }
  LeapCamera& camera() {
    if (!camera_) camera_ = std::make_unique<LeapCamera>(params_);
    return *camera_;
  }
  std::optional<LeapFrame> next(milliseconds patience = milliseconds(5000)) {
    const auto end = Clock::now() + patience;
    while (Clock::now() < end)
      if (auto frame = camera().grab(milliseconds(20))) return frame;
    return std::nullopt;
  }
  void waitForMessage(const std::string& part) {
    const auto end = Clock::now() + milliseconds(8000);
    while (Clock::now() < end) {
      camera().grab(milliseconds(20));
      if (camera().status().message.find(part) != std::string::npos) return;
    }
    FAIL() << "waited for \"" << part << "\", had: " << camera().status().message;
  }

  EmulatedLeap leap_;
  EmulatedLeap other_;
  EmulatedBus bus_;
  LeapCameraParams params_;
  std::unique_ptr<LeapCamera> camera_;
};

TEST_F(LeapCameraTest, waitsForADeviceThatIsAbsentAtFirst) {
  waitForMessage("no Leap Motion");
  EXPECT_EQ(LeapState::kWaiting, camera().status().state);
  port().plug(leap_);
  EXPECT_TRUE(next(milliseconds(1000)));
  EXPECT_EQ(LeapState::kStreaming, camera().status().state);
}

TEST_F(LeapCameraTest, streamsAgainWithinASecondWithTheSameSettings) {
  LeapControls controls;
  controls.exposure_us = 444;
  controls.led_right = false;
  port().plug(leap_);
  camera().setControls(controls);
  ASSERT_TRUE(next());
  for (int i = 0; i < 3; ++i) {
    port().unplug();
    waitForMessage("was unplugged");
    port().plug(leap_);
    ASSERT_TRUE(next(milliseconds(1000))) << camera().status().message;
    EXPECT_EQ(444, leap_.settings().exposure_us);
    EXPECT_FALSE(leap_.settings().led[2]);
  }
  EXPECT_EQ(4, camera().status().connections);
}

TEST_F(LeapCameraTest, suspectsThePowerOfADeviceThatLeavesAgainAndAgain) {
  port().plug(leap_);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(next());
    port().unplug();
    waitForMessage("was unplugged");
    if (i < 2) port().plug(leap_);
  }
  EXPECT_NE(std::string::npos, camera().status().message.find("powered hub"));
}

TEST_F(LeapCameraTest, takesSettingsFromAnotherThread) {
  port().plug(leap_);
  ASSERT_TRUE(next());
  LeapControls controls;
  controls.exposure_us = 55;
  std::thread([&] { camera().setControls(controls); }).join();
  ASSERT_TRUE(next());
  EXPECT_EQ(55, leap_.settings().exposure_us);
}

TEST_F(LeapCameraTest, getsADeviceThatAnotherProgramLetsGo) {
  port().plug(leap_);
  port().usbfs().setHeldByOther(true);
  waitForMessage("another program holds it");
  port().usbfs().setHeldByOther(false);
  EXPECT_TRUE(next(milliseconds(3000)));
}

TEST_F(LeapCameraTest, startsADeviceThatStoppedSending) {
  port().plug(leap_);
  ASSERT_TRUE(next());
  leap_.stopStreaming();
  waitForMessage("pictures stopped");
  EXPECT_TRUE(next());
}

TEST_F(LeapCameraTest, recoversFromABrownOut) {
  port().plug(leap_);
  ASSERT_TRUE(next());
  leap_.setControlBehaviour(EmulatedLeap::ControlBehaviour::kShort);
  port().unplug();
  port().plug(leap_);
  waitForMessage("too little power");
  leap_.setControlBehaviour(EmulatedLeap::ControlBehaviour::kGarbage);
  waitForMessage("does not agree");
  leap_.setControlBehaviour(EmulatedLeap::ControlBehaviour::kNormal);
  EXPECT_TRUE(next());
}

TEST_F(LeapCameraTest, findsItsOwnDeviceAmongTwoInAnyOrder) {
  params_.serial = "LP77777777777";
  leap_.setSerial("LP77777777777");
  bus_.port(2).plug(other_);
  port().plug(leap_);
  ASSERT_TRUE(next());
  EXPECT_EQ("LP77777777777", camera().status().identity.serial);
  port().unplug();
  bus_.port(2).unplug();
  waitForMessage("no Leap Motion");
  bus_.port(2).plug(leap_);
  port().plug(other_);
  ASSERT_TRUE(next());
  EXPECT_EQ("LP77777777777", camera().status().identity.serial);
  EXPECT_TRUE(port().usbfs().kernelDriverBound());
}

TEST_F(LeapCameraTest, twoCamerasShareTheBus) {
  leap_.setRate(0.3);
  other_.setRate(0.3);
  other_.setSerial("LP22222222222");
  bus_.port(2).plug(other_);
  port().plug(leap_);
  params_.serial = "LP10000000001";
  LeapCameraParams second_params;
  second_params.serial = "LP22222222222";
  LeapCamera second(second_params);
  int of_second = 0;
  const auto end = Clock::now() + milliseconds(5000);
  int of_first = 0;
  while ((of_first < 20 || of_second < 20) && Clock::now() < end) {
    of_first += camera().grab(milliseconds(5)).has_value();
    of_second += second.grab(milliseconds(5)).has_value();
  }
  EXPECT_GE(of_first, 20);
  EXPECT_GE(of_second, 20);
}

int openFiles() {
  int count = 0;
  DIR* folder = opendir("/proc/self/fd");
  while (readdir(folder)) ++count;
  closedir(folder);
  return count;
}

// The bus below opens files of its own for moments, from other threads.
int openFilesAtRest() {
  int fewest = openFiles();
  for (int i = 0; i < 50; ++i) {
    std::this_thread::sleep_for(milliseconds(2));
    fewest = std::min(fewest, openFiles());
  }
  return fewest;
}

TEST_F(LeapCameraTest, leavesNothingBehindAfterAThousandConnections) {
  port().plug(leap_);
  int files = 0;
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(next()) << "connection " << i << ": " << camera_->status().message;
    if (i % 2 == 0) {
      camera_.reset();
    } else {
      port().unplug();
      camera_.reset();
      port().plug(leap_);
    }
    ASSERT_EQ(0, port().usbfs().leftovers().requests) << "connection " << i;
    if (i == 20) files = openFilesAtRest();
  }
  EXPECT_EQ(files, openFilesAtRest());
}

}  // namespace
}  // namespace leap_object_tracker
