// The driver over a real kernel: usbfs, usbcore, uvcvideo. Started by scripts/test_kernel in a
// virtual machine; nothing here depends on time, because that machine is slow.
#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <thread>

#include "emulated_leap_vhci.hpp"
#include "leap_object_tracker/leap/leap_camera.hpp"

namespace leap_object_tracker {
namespace {

using std::chrono::milliseconds;
namespace fs = std::filesystem;

constexpr std::chrono::seconds kPatience{60};

bool eventually(const std::function<bool()>& holds) {
  const auto end = std::chrono::steady_clock::now() + kPatience;
  while (!holds()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(milliseconds(50));
  }
  return true;
}

/// Name of the kernel's driver of an interface of the Leap; empty without one.
std::string kernelDriver(int interface_number) {
  const std::string end = ":1." + std::to_string(interface_number);
  for (const auto& entry : fs::directory_iterator("/sys/bus/usb/devices")) {
    const std::string name = entry.path().filename();
    const bool is_leap = name.size() > end.size() && name[0] != 'u' &&
                         name.compare(name.size() - end.size(), end.size(), end) == 0 &&
                         name.find("-0") == std::string::npos;
    if (is_leap && fs::exists(entry.path() / "driver"))
      return fs::read_symlink(entry.path() / "driver").filename();
  }
  return "";
}

class RealKernel : public testing::Test {
 protected:
  LeapCamera& camera() {
    if (!camera_) camera_ = std::make_unique<LeapCamera>(LeapCameraParams());
    return *camera_;
  }
  std::optional<LeapFrame> next() {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end)
      if (auto frame = camera().grab(milliseconds(100))) return frame;
    return std::nullopt;
  }
  static void expectUnchanged(const LeapFrame& frame) {
    EmulatedLeap::Frame sent;
    sent.index = EmulatedLeap::numberInNoise(frame.images.left);
    sent.size = frame.images.left.size();
    Bytes raster(2 * frame.images.left.total());
    EmulatedLeap::noise(sent, raster.data());
    for (std::size_t i = 0; i < raster.size() / 2 - kMetadataSamples; ++i)
      if (raster[2 * i] != frame.images.left.data[i] ||
          raster[2 * i + 1] != frame.images.right.data[i])
        FAIL() << "frame " << sent.index << " differs at pixel " << i;
  }

  EmulatedLeap leap_;
  EmulatedVhci port_;
  std::unique_ptr<LeapCamera> camera_;
};

TEST_F(RealKernel, takesTheLeapFromUvcvideoStreamsAndGivesItBack) {
  port_.plug(leap_);
  ASSERT_TRUE(eventually([] {
    return kernelDriver(0) == "uvcvideo" && kernelDriver(1) == "uvcvideo";
  })) << kernelDriver(0)
      << " " << kernelDriver(1);
  for (int i = 0; i < 10; ++i) {
    const auto frame = next();
    ASSERT_TRUE(frame) << camera().status().message;
    ASSERT_NO_FATAL_FAILURE(expectUnchanged(*frame));
  }
  EXPECT_EQ("LP10000000001", camera().status().identity.serial);
  EXPECT_EQ(calibrationOfUnitA(), [&] {
    const auto bytes = camera().status().identity.calibration;
    return Bytes(bytes.begin(), bytes.end());
  }());
  EXPECT_EQ("usbfs", kernelDriver(1));
  camera_.reset();
  EXPECT_TRUE(
      eventually([] { return kernelDriver(0) == "uvcvideo" && kernelDriver(1) == "uvcvideo"; }));
}

TEST_F(RealKernel, setsWhatTheDeviceObeys) {
  port_.plug(leap_);
  LeapControls controls;
  controls.exposure_us = 321;
  controls.led_centre = false;
  camera().setControls(controls);
  ASSERT_TRUE(next()) << camera().status().message;
  EXPECT_EQ(321, leap_.settings().exposure_us);
  EXPECT_FALSE(leap_.settings().led[1]);
}

TEST_F(RealKernel, survivesBeingUnpluggedAndPluggedAgain) {
  port_.plug(leap_);
  ASSERT_TRUE(next()) << camera().status().message;
  port_.unplug();
  ASSERT_TRUE(eventually([&] {
    camera().grab(milliseconds(20));
    return camera().status().state == LeapState::kWaiting;
  }));
  port_.plug(leap_);
  const auto frame = next();
  ASSERT_TRUE(frame) << camera().status().message;
  expectUnchanged(*frame);
  EXPECT_EQ(2, camera().status().connections);
}

TEST_F(RealKernel, clearsAHalt) {
  port_.plug(leap_);
  ASSERT_TRUE(next()) << camera().status().message;
  leap_.haltAfter(30);
  ASSERT_TRUE(eventually([&] {
    camera().grab(milliseconds(20));
    return camera().status().counters.transfers.halts > 0;
  }));
  const auto frame = next();
  ASSERT_TRUE(frame) << camera().status().message;
  expectUnchanged(*frame);
}

}  // namespace
}  // namespace leap_object_tracker
