#include "leap_object_tracker/leap/leap_device.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "emulated_leap_bus.hpp"
#include "leap_object_tracker/leap/leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

using std::chrono::milliseconds;
using ControlBehaviour = EmulatedLeap::ControlBehaviour;

constexpr milliseconds kPatience{5000};

class LeapDeviceTest : public testing::Test {
 protected:
  ~LeapDeviceTest() override { EXPECT_TRUE(leap_.forbidden().empty()) << leap_.forbidden()[0]; }

  void plug() { port().plug(leap_); }
  EmulatedBus::Port& port() { return bus_.port(1); }

  UsbContext& context() {
    if (!context_) context_ = std::make_unique<UsbContext>();
    return *context_;
  }
  /// Waits for libusb to notice.
  std::unique_ptr<LeapDevice> open() {
    plug();
    return std::make_unique<LeapDevice>(context(), "");
  }
  static LeapStreamParams mode(LeapMode mode) {
    LeapStreamParams params;
    params.mode = mode;
    params.queue = 1000;
    return params;
  }
  static std::optional<LeapFrame> next(LeapDevice& device) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end)
      if (auto frame = device.grab(milliseconds(50))) return frame;
    return std::nullopt;
  }
  /// Fails at the first pixel that differs from what the device sent.
  static void expectUnchanged(const LeapFrame& frame) {
    EmulatedLeap::Frame sent;
    sent.index = EmulatedLeap::numberInNoise(frame.images.left);
    sent.size = frame.images.left.size();
    Bytes raster(2 * static_cast<std::size_t>(sent.size.area()));
    EmulatedLeap::noise(sent, raster.data());
    const std::size_t pixels = raster.size() / 2 - kMetadataSamples;
    for (std::size_t i = 0; i < pixels; ++i)
      if (raster[2 * i] != frame.images.left.data[i] ||
          raster[2 * i + 1] != frame.images.right.data[i])
        FAIL() << "frame " << sent.index << " differs at pixel " << i;
  }
  LeapFault faultOf(const std::function<void()>& action) {
    try {
      action();
    } catch (const LeapError& error) {
      message_ = error.what();
      return error.fault();
    }
    ADD_FAILURE() << "nothing was thrown";
    return LeapFault::kUsb;
  }
  static void grabUntilThrow(LeapDevice& device) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < end) device.grab(milliseconds(20));
  }

  EmulatedLeap leap_;
  EmulatedLeap other_;
  EmulatedBus bus_;
  std::unique_ptr<UsbContext> context_;
  std::string message_;
};

TEST_F(LeapDeviceTest, readsWhatTheDeviceSaysOfItself) {
  leap_.setSerial("LP23456789012");
  leap_.setCalibration(calibrationOfUnitB());
  const auto device = open();
  EXPECT_EQ("LP23456789012", device->identity().serial);
  EXPECT_EQ(calibrationOfUnitB(), device->identity().calibration);
  EXPECT_EQ((Bytes{0x08, 0x09, 0x11, 0x00}), device->identity().firmware);
  EXPECT_EQ(6u, device->identity().layout.frames.size());
  EXPECT_NE(std::string::npos, device->identity().location.find("1-1"));
}

TEST_F(LeapDeviceTest, takesTheDeviceFromTheKernelAndGivesItBack) {
  plug();
  EXPECT_TRUE(port().usbfs().kernelDriverBound());
  {
    LeapDevice device(context(), "");
    EXPECT_FALSE(port().usbfs().kernelDriverBound());
  }
  EXPECT_TRUE(port().usbfs().kernelDriverBound());
  EXPECT_EQ(0, port().usbfs().leftovers().claims);
}

class EveryMode : public LeapDeviceTest, public testing::WithParamInterface<LeapMode> {};

TEST_P(EveryMode, streamsEachBitAsSent) {
  leap_.setRate(1);
  auto device = open();
  device->start(mode(GetParam()), {});
  std::uint32_t last = 0;
  for (int i = 0; i < 60; ++i) {
    const auto frame = next(*device);
    ASSERT_TRUE(frame);
    EXPECT_EQ(leapModeInfo(GetParam()).size, frame->images.left.size());
    ASSERT_NO_FATAL_FAILURE(expectUnchanged(*frame));
    const std::uint32_t number = EmulatedLeap::numberInNoise(frame->images.left);
    EXPECT_TRUE(i == 0 || number == last + 1) << last << " before " << number;
    last = number;
  }
  EXPECT_EQ(0u, device->counters().frames.torn);
  EXPECT_EQ(0u, device->counters().missing);
  EXPECT_EQ(0u, device->counters().dropped);
}

INSTANTIATE_TEST_SUITE_P(All, EveryMode,
                         testing::Values(LeapMode::k640x480, LeapMode::k640x240, LeapMode::k640x120,
                                         LeapMode::k752x480, LeapMode::k752x240,
                                         LeapMode::k752x120));

TEST_F(LeapDeviceTest, keepsTheMetadataOutOfThePicture) {
  auto device = open();
  LeapControls controls;
  controls.exposure_us = 300;
  controls.analog_gain = 20;
  device->start(mode(LeapMode::k640x240), controls);
  const auto frame = next(*device);
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->metadata.tagged);
  EXPECT_EQ(1, frame->metadata.label1);
  EXPECT_EQ(300, frame->metadata.exposure_bits);
  EXPECT_EQ(20, frame->metadata.gain_bits);
  EXPECT_EQ(300, frame->taken_with.exposure_us);
  const cv::Mat& left = frame->images.left;
  for (int u = left.cols - kMetadataSamples; u < left.cols; ++u)
    EXPECT_EQ(left.at<std::uint8_t>(left.rows - 2, u), left.at<std::uint8_t>(left.rows - 1, u));
}

TEST_F(LeapDeviceTest, writesEachControlBeforePicturesBegin) {
  auto device = open();
  leap_.forgetRequests();
  LeapControls controls;
  controls.exposure_us = 321;
  controls.analog_gain = 33;
  controls.digital_gain = 7;
  controls.hdr = true;
  controls.led_centre = false;
  controls.dark_interval = 5;
  device->start(mode(LeapMode::k640x240), controls);

  struct Expected {
    std::uint16_t index, value;
    unsigned data;
  };
  const std::vector<Expected> expected = {
      {0x0500, 0x0300, 0x0001}, {0x0500, 0x0300, 0x3c05}, {0x0200, 0x0600, 1000},
      {0x0500, 0x0300, 0x0040}, {0x0500, 0x0300, 0x0042}, {0x0500, 0x0300, 0x0003},
      {0x0500, 0x0300, 0x0044}, {0x0500, 0x0900, 0},      {0x0500, 0x0a00, 5},
      {0x0500, 0x0200, 7},      {0x0200, 0x0b00, 321},    {0x0500, 0x0400, 33}};
  auto requests = leap_.requests();
  ASSERT_LT(expected.size(), requests.size());
  EXPECT_EQ(0x0b, requests[0].setup.request);  // SET_INTERFACE of the streaming interface
  EXPECT_EQ(1, requests[0].setup.index);
  requests.erase(requests.begin());
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(0x21, requests[i].setup.type) << i;
    EXPECT_EQ(0x01, requests[i].setup.request) << i;
    EXPECT_EQ(expected[i].index, requests[i].setup.index) << i;
    EXPECT_EQ(expected[i].value, requests[i].setup.value) << i;
    ASSERT_EQ(2u, requests[i].data.size()) << i;
    EXPECT_EQ(expected[i].data, requests[i].data[0] + 256u * requests[i].data[1]) << i;
  }
  // Probe, its answer, and commit, byte for byte as the maker's program sends them.
  const Bytes probe = fromHex("01000102ac530100000000000000000000 00 00040b0000400000");
  ASSERT_EQ(expected.size() + 3, requests.size());
  EXPECT_EQ(0x0100, requests[expected.size()].setup.value);
  EXPECT_EQ(probe, requests[expected.size()].data);
  EXPECT_EQ(0x81, requests[expected.size() + 1].setup.request);
  EXPECT_EQ(0x0200, requests[expected.size() + 2].setup.value);
  EXPECT_EQ(probe, requests[expected.size() + 2].data);
}

TEST_F(LeapDeviceTest, sendsOnlyWhatChangesWhilePicturesFlow) {
  auto device = open();
  LeapControls controls;
  device->start(mode(LeapMode::k640x240), controls);
  ASSERT_TRUE(next(*device));
  leap_.forgetRequests();
  controls.exposure_us = 77;
  controls.led_left = false;
  device->setControls(controls);
  const auto requests = leap_.requests();
  ASSERT_EQ(2u, requests.size());
  EXPECT_EQ((Bytes{0x02, 0x00}), requests[0].data);
  EXPECT_EQ((Bytes{77, 0}), requests[1].data);
  EXPECT_EQ(77, leap_.settings().exposure_us);
  EXPECT_FALSE(leap_.settings().led[0]);
}

TEST_F(LeapDeviceTest, sendsFourBytesWhereTwoAreRefused) {
  leap_.setFourByteControls(true);
  plug();
  EXPECT_THROW(LeapDevice(context(), ""), LeapError);  // the memory is read with two bytes
  leap_.setFourByteControls(false);
  LeapDevice device(context(), "");
  leap_.setFourByteControls(true);
  LeapControls controls;
  controls.exposure_us = 123;
  device.start(mode(LeapMode::k640x240), controls);
  EXPECT_EQ(123, leap_.settings().exposure_us);
}

TEST_F(LeapDeviceTest, readsTheCalibrationAgainUntilItsChecksumHolds) {
  leap_.disturbMemory(60);
  const auto device = open();
  EXPECT_EQ(calibrationOfUnitA(), device->identity().calibration);
}

TEST_F(LeapDeviceTest, streamsWithoutACalibrationThatHolds) {
  Bytes calibration = calibrationOfUnitA();
  calibration[20] ^= 1;
  leap_.setCalibration(calibration);
  auto device = open();
  EXPECT_TRUE(device->identity().calibration.empty());
  device->start(mode(LeapMode::k640x240), {});
  EXPECT_TRUE(next(*device));
}

TEST_F(LeapDeviceTest, saysThatNoneIsThere) {
  EXPECT_EQ(LeapFault::kAbsent, faultOf([&] { LeapDevice device(context(), ""); }));
}

TEST_F(LeapDeviceTest, namesTheRuleWhenItMayNotOpenTheFile) {
  plug();
  port().denyAccess();
  EXPECT_EQ(LeapFault::kNoPermission, faultOf([&] { LeapDevice device(context(), ""); }));
  EXPECT_NE(std::string::npos, message_.find("60-leap-motion.rules")) << message_;
}

TEST_F(LeapDeviceTest, saysWhoMayHoldIt) {
  plug();
  port().usbfs().setHeldByOther(true);
  EXPECT_EQ(LeapFault::kBusy, faultOf([&] { LeapDevice device(context(), ""); }));
  EXPECT_NE(std::string::npos, message_.find("leapd")) << message_;
}

TEST_F(LeapDeviceTest, refusesASlowLink) {
  port().setSlowLink(true);
  plug();
  EXPECT_EQ(LeapFault::kSlowLink, faultOf([&] { LeapDevice device(context(), ""); }));
}

TEST_F(LeapDeviceTest, saysThatStockFirmwareIsLocked) {
  leap_.setLocked(true);
  auto device = open();
  device->start(mode(LeapMode::k640x240), {});
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(LeapFault::kLockedFirmware, faultOf([&] { grabUntilThrow(*device); }));
  EXPECT_GE(std::chrono::steady_clock::now() - start, milliseconds(2900));
  EXPECT_NE(std::string::npos, message_.find("1.7.1")) << message_;
}

TEST_F(LeapDeviceTest, findsTheOneWithTheWantedSerialNumber) {
  other_.setSerial("LP99999999999");
  bus_.port(2).plug(other_);
  plug();
  LeapDevice first(context(), "LP10000000001");
  LeapDevice second(context(), "LP99999999999");
  EXPECT_EQ("LP10000000001", first.identity().serial);
  EXPECT_EQ("LP99999999999", second.identity().serial);
  EXPECT_EQ(LeapFault::kAbsent, faultOf([&] { LeapDevice third(context(), "LP00000000000"); }));
}

TEST_F(LeapDeviceTest, leavesTheOtherLeapToItsDriver) {
  other_.setSerial("LP99999999999");
  bus_.port(2).plug(other_);
  plug();
  LeapDevice device(context(), "LP10000000001");
  EXPECT_TRUE(bus_.port(2).usbfs().kernelDriverBound());
}

struct Damage {
  const char* name;
  EmulatedLeap::Tamper tamper;
  int frame;  ///< that is damaged
};

class DamagedFrames : public LeapDeviceTest, public testing::WithParamInterface<Damage> {};

TEST_P(DamagedFrames, costOnlyTheFrameThatIsDamaged) {
  leap_.setTamper(GetParam().tamper);
  auto device = open();
  device->start(mode(LeapMode::k640x240), {});
  std::vector<std::uint32_t> numbers;
  for (int i = 0; i < 20; ++i) {
    const auto frame = next(*device);
    ASSERT_TRUE(frame);
    ASSERT_NO_FATAL_FAILURE(expectUnchanged(*frame));
    numbers.push_back(EmulatedLeap::numberInNoise(frame->images.left));
  }
  for (std::size_t i = 1; i < numbers.size(); ++i) {
    const bool over_the_gap = numbers[i - 1] < 10 && numbers[i] > 10;
    const bool kept = GetParam().frame < 0;
    EXPECT_EQ(over_the_gap && !kept ? 11 : numbers[i - 1] + 1, numbers[i]);
  }
}

using Out = std::vector<Bytes>;
EmulatedLeap::Tamper inFrame10(int payload, std::function<Out(Bytes)> change) {
  return [=](const EmulatedLeap::Payload& p) {
    return p.frame == 10 && p.number == payload ? change(p.bytes) : Out{p.bytes};
  };
}

INSTANTIATE_TEST_SUITE_P(
    Each, DamagedFrames,
    testing::Values(Damage{"lost", inFrame10(5, [](Bytes) { return Out{}; }), 10},
                    Damage{"lostFirst", inFrame10(0, [](Bytes) { return Out{}; }), 10},
                    Damage{"lostEnd", inFrame10(18, [](Bytes) { return Out{}; }), 10},
                    Damage{"short",
                           inFrame10(7,
                                     [](Bytes b) {
                                       b.resize(1000);
                                       return Out{b};
                                     }),
                           10},
                    Damage{"onlyHeader",
                           inFrame10(7,
                                     [](Bytes b) {
                                       b.resize(12);
                                       return Out{b};
                                     }),
                           10},
                    Damage{"long",
                           inFrame10(7,
                                     [](Bytes b) {
                                       b.resize(16383, 9);
                                       return Out{b};
                                     }),
                           10},
                    Damage{"tooLongForTheTransfer",
                           inFrame10(7,
                                     [](Bytes b) {
                                       b.resize(20000, 9);
                                       return Out{b};
                                     }),
                           10},
                    Damage{"errorBit",
                           inFrame10(3,
                                     [](Bytes b) {
                                       b[1] |= 0x40;
                                       return Out{b};
                                     }),
                           10},
                    Damage{"badHeaderLength",
                           inFrame10(3,
                                     [](Bytes b) {
                                       b[0] = 255;
                                       return Out{b};
                                     }),
                           10},
                    Damage{"headerTooLong",
                           inFrame10(18,
                                     [](Bytes b) {
                                       b.resize(5);
                                       return Out{b};
                                     }),
                           10},
                    Damage{"noEndOfHeader",
                           inFrame10(3,
                                     [](Bytes b) {
                                       b[1] &= 0x7f;
                                       return Out{b};
                                     }),
                           10},
                    Damage{"timeJumpsInTheFrame",
                           inFrame10(3,
                                     [](Bytes b) {
                                       b[3] ^= 0xff;
                                       return Out{b};
                                     }),
                           10},
                    Damage{"repeated",
                           inFrame10(6,
                                     [](Bytes b) {
                                       return Out{b, b};
                                     }),
                           -1},
                    Damage{"repeatedEnd",
                           inFrame10(18,
                                     [](Bytes b) {
                                       return Out{b, b};
                                     }),
                           -1},
                    Damage{"empty",
                           inFrame10(6,
                                     [](Bytes b) {
                                       return Out{{}, b};
                                     }),
                           -1},
                    Damage{"headerOfTwoBytes",
                           [](const EmulatedLeap::Payload& p) {
                             Bytes b = p.bytes;
                             b.erase(b.begin() + 2, b.begin() + 12);
                             b[0] = 2, b[1] &= 0xf3;
                             return Out{b};
                           },
                           -1},
                    Damage{"frameIdStuck",
                           [](const EmulatedLeap::Payload& p) {
                             Bytes b = p.bytes;
                             b[1] &= 0xfe;
                             return Out{b};
                           },
                           -1},
                    Damage{"oneLostAndOneRepeated",
                           [](const EmulatedLeap::Payload& p) {
                             if (p.frame == 10 && p.number == 4) return Out{};
                             if (p.frame == 10 && p.number == 9) return Out{p.bytes, p.bytes};
                             return Out{p.bytes};
                           },
                           10},
                    Damage{"frameIdStuckAndEndLost",
                           [](const EmulatedLeap::Payload& p) {
                             Bytes b = p.bytes;
                             b[1] &= 0xfe;
                             return p.frame == 10 && p.last ? Out{} : Out{b};
                           },
                           10}),
    [](const auto& info) { return info.param.name; });

TEST_F(LeapDeviceTest, goesOnAfterAHalt) {
  auto device = open();
  device->start(mode(LeapMode::k640x240), {});
  ASSERT_TRUE(next(*device));
  leap_.haltAfter(100);
  std::uint32_t number = 0;
  while (device->counters().transfers.halts == 0 || number < 40) {
    const auto frame = next(*device);
    ASSERT_TRUE(frame);
    ASSERT_NO_FATAL_FAILURE(expectUnchanged(*frame));
    number = EmulatedLeap::numberInNoise(frame->images.left);
  }
  EXPECT_EQ(1u, device->counters().transfers.halts);
}

TEST_F(LeapDeviceTest, goesOnAfterTransferErrors) {
  auto device = open();
  device->start(mode(LeapMode::k640x240), {});
  ASSERT_TRUE(next(*device));
  port().usbfs().failTransfers(EPROTO, 10);
  while (device->counters().transfers.errors < 10) ASSERT_TRUE(next(*device));
  for (int i = 0; i < 10; ++i) {
    const auto frame = next(*device);
    ASSERT_TRUE(frame);
    ASSERT_NO_FATAL_FAILURE(expectUnchanged(*frame));
  }
}

TEST_F(LeapDeviceTest, givesUpWhenThereAreOnlyErrors) {
  auto device = open();
  device->start(mode(LeapMode::k640x240), {});
  ASSERT_TRUE(next(*device));
  port().usbfs().failTransfers(EPROTO, 1000000);
  EXPECT_EQ(LeapFault::kStalled, faultOf([&] { grabUntilThrow(*device); }));
}

TEST_F(LeapDeviceTest, noticesThatItWasUnpluggedWhileStreaming) {
  for (const bool announced : {true, false}) {
    auto device = open();
    device->start(mode(LeapMode::k640x240), {});
    ASSERT_TRUE(next(*device));
    port().unplug(announced);
    EXPECT_EQ(LeapFault::kUnplugged, faultOf([&] { grabUntilThrow(*device); }));
    device.reset();
    EXPECT_EQ(0, port().usbfs().leftovers().requests);
    context_.reset();
  }
}

TEST_F(LeapDeviceTest, noticesThatItWasUnpluggedWhileIdle) {
  auto device = open();
  port().unplug();
  EXPECT_EQ(LeapFault::kUnplugged, faultOf([&] { device->start(mode(LeapMode::k640x240), {}); }));
}

TEST_F(LeapDeviceTest, noticesThatItWasUnpluggedDuringAControlRequest) {
  auto device = open();
  device->start(mode(LeapMode::k640x240), {});
  ASSERT_TRUE(next(*device));
  leap_.setControlBehaviour(ControlBehaviour::kSilent);
  std::thread hand([&] {
    std::this_thread::sleep_for(milliseconds(100));
    port().unplug();
  });
  LeapControls controls;
  controls.exposure_us = 999;
  EXPECT_EQ(LeapFault::kUnplugged, faultOf([&] { device->setControls(controls); }));
  hand.join();
}

TEST_F(LeapDeviceTest, doesNotWaitForeverForAControl) {
  auto device = open();
  leap_.setControlBehaviour(ControlBehaviour::kSilent);
  LeapControls controls;
  controls.exposure_us = 999;
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(LeapFault::kUsb, faultOf([&] { device->setControls(controls); }));
  EXPECT_LT(std::chrono::steady_clock::now() - start, milliseconds(2000));
}

TEST_F(LeapDeviceTest, saysThatAWeakDeviceAnswersWithNothing) {
  plug();
  leap_.setControlBehaviour(ControlBehaviour::kShort);
  EXPECT_EQ(LeapFault::kBadReply, faultOf([&] { LeapDevice device(context(), ""); }));
  EXPECT_NE(std::string::npos, message_.find("power")) << message_;
}

TEST_F(LeapDeviceTest, trustsNoGarbage) {
  plug();
  leap_.setControlBehaviour(ControlBehaviour::kGarbage);
  try {
    LeapDevice device(context(), "");
    EXPECT_TRUE(device.identity().calibration.empty());
    device.start(mode(LeapMode::k640x240), {});
    FAIL() << "a senseless answer to the mode was taken";
  } catch (const LeapError& error) {
    EXPECT_EQ(LeapFault::kBadReply, error.fault()) << error.what();
  }
}

TEST_F(LeapDeviceTest, leavesNothingBehindWhenClosedWhileStreaming) {
  leap_.setRate(1);
  {
    auto device = open();
    device->start(mode(LeapMode::k640x240), {});
    ASSERT_TRUE(next(*device));
    EXPECT_GT(port().usbfs().pendingTransfers(), 0);
  }
  EXPECT_EQ(0, port().usbfs().leftovers().requests);
  EXPECT_EQ(0, port().usbfs().leftovers().claims);
  EXPECT_EQ(1, port().usbfs().leftovers().closes);
}

TEST_F(LeapDeviceTest, startsAgainInAnotherMode) {
  auto device = open();
  for (const LeapMode each : {LeapMode::k640x240, LeapMode::k752x480, LeapMode::k640x120}) {
    device->start(mode(each), {});
    const auto frame = next(*device);
    ASSERT_TRUE(frame);
    EXPECT_EQ(leapModeInfo(each).size, frame->images.left.size());
    ASSERT_NO_FATAL_FAILURE(expectUnchanged(*frame));
  }
}

TEST_F(LeapDeviceTest, dropsTheOldestFrameWhenNobodyFetchesThem) {
  leap_.setRate(1);
  auto device = open();
  LeapStreamParams params = mode(LeapMode::k640x240);
  params.queue = 2;
  device->start(params, {});
  ASSERT_TRUE(next(*device));
  std::this_thread::sleep_for(milliseconds(200));
  const std::uint32_t begun = leap_.framesBegun();
  const auto frame = next(*device);
  ASSERT_TRUE(frame);
  EXPECT_GE(EmulatedLeap::numberInNoise(frame->images.left) + 6, begun);
  EXPECT_GT(device->counters().dropped, 5u);
}

}  // namespace
}  // namespace leap_object_tracker
