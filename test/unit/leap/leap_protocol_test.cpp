#include "leap_object_tracker/leap/leap_protocol.hpp"

#include <gtest/gtest.h>

#include "support/emulated_leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

const Bytes& retailDescriptor() {
  static const Bytes bytes = fromHex(
      "0902630102010080fa080b00020e03000009040000010e0100000d240100015000e80300000101"
      "1224020201020000000000000000032802000c240505020000037b0200001c240606"
      "ffffffffffffffffffffffffffffffff000105030000000009240303010100060007058203400008"
      "052503400009040100010e0200000e240101dd0083000300000001001b2404010659555932000010"
      "00800000aa00389b711004000000001e240501008002e0010080d8100080d8100060090059a70200"
      "0159a702001e240502008002f0000080d8100080d81000b00400ac53010001ac5301001e24050300"
      "800278000080ac0f0080ac0f0058020088b600000188b600001e24050400f002e001004036110040"
      "361100040b00400d030001400d03001e24050500f002f000004036110040361100820500a0860100"
      "01a08601001e24050600f002780000f0591000f0591000c1020097cd00000197cd00000705830200"
      "0201");
  return bytes;
}

TEST(LeapProtocol, readsTheDescriptorOfARetailUnit) {
  const LeapLayout layout = parseLayout(retailDescriptor());
  EXPECT_EQ(0, layout.control_interface);
  EXPECT_EQ(1, layout.streaming_interface);
  EXPECT_EQ(2, layout.camera_terminal);
  EXPECT_EQ(5, layout.processing_unit);
  EXPECT_EQ(0x83, layout.bulk_endpoint);
  EXPECT_EQ(1, layout.format_index);
  ASSERT_EQ(6u, layout.frames.size());
  for (const LeapModeInfo& mode : leapModes()) {
    EXPECT_EQ(mode.frame_index, layout.frame(mode.mode).index);
    EXPECT_EQ(mode.interval_100ns, layout.frame(mode.mode).interval_100ns);
  }
}

TEST(LeapProtocol, followsADescriptorThatNumbersItsPartsInAnotherWay) {
  Bytes bytes = retailDescriptor();
  bytes[42] = 9;             // camera terminal
  bytes[60] = 7;             // processing unit
  bytes[350] = 0x84;         // endpoint
  bytes[228 - 30 + 3] = 11;  // frame 640x240
  const LeapLayout layout = parseLayout(bytes);
  EXPECT_EQ(9, layout.camera_terminal);
  EXPECT_EQ(7, layout.processing_unit);
  EXPECT_EQ(0x84, layout.bulk_endpoint);
  EXPECT_EQ(11, layout.frame(LeapMode::k640x240).index);
}

TEST(LeapProtocol, fallsBackToTheRetailValuesForADescriptorCutShort) {
  for (std::size_t size = 0; size < retailDescriptor().size(); ++size) {
    const Bytes part(retailDescriptor().begin(),
                     retailDescriptor().begin() + static_cast<std::ptrdiff_t>(size));
    const LeapLayout layout = parseLayout(part);
    EXPECT_EQ(5, layout.processing_unit);
    EXPECT_EQ(0x83, layout.bulk_endpoint);
    EXPECT_EQ(2, layout.frame(LeapMode::k640x240).index);
  }
}

TEST(LeapProtocol, encodesTheProbeOfTheMakersProgram) {
  LeapProbe probe;
  probe.frame_index = 2;
  probe.interval_100ns = 86956;
  const auto bytes = encodeProbe(probe);
  EXPECT_EQ(fromHex("01000102ac530100000000000000000000 00 00040b0000400000"),
            Bytes(bytes.begin(), bytes.end()));
}

TEST(LeapProtocol, decodesAProbeAndRefusesAShortOne) {
  const Bytes reply = fromHex("00000102ac530100000000000000000000 00 00040b0000400000");
  const auto probe = decodeProbe(reply);
  ASSERT_TRUE(probe);
  EXPECT_EQ(1, probe->format_index);
  EXPECT_EQ(2, probe->frame_index);
  EXPECT_EQ(86956u, probe->interval_100ns);
  EXPECT_EQ(16384u, probe->largest_payload);
  EXPECT_FALSE(decodeProbe(ByteView(reply.data(), 25)));
}

TEST(LeapProtocol, namesItsModes) {
  EXPECT_EQ(LeapMode::k752x120, leapModeFromName("752x120"));
  EXPECT_FALSE(leapModeFromName("320x240"));
  EXPECT_NEAR(115.0, leapModeInfo(LeapMode::k640x240).rate(), 0.01);
  EXPECT_EQ(307200u, leapModeInfo(LeapMode::k640x240).frameBytes());
}

TEST(LeapProtocol, writesTheSwitchesAsTheDeviceCodesThem) {
  LeapControls controls;
  controls.hdr = true;
  controls.led_left = false;
  std::vector<std::uint16_t> codes;
  for (const LeapControlWrite& write : allControlWrites(controls))
    if (write.selector == LeapSelector::kSwitch) codes.push_back(write.value);
  EXPECT_EQ((std::vector<std::uint16_t>{0x0001, 0x3c05, 0x0040, 0x0002, 0x0043, 0x0044}), codes);
}

TEST(LeapProtocol, neverWritesTheVerticalZoomNorTheMemory) {
  for (int i = 0; i < 64; ++i) {
    LeapControls controls;
    controls.hdr = i & 1, controls.led_left = i & 2, controls.led_centre = i & 4;
    controls.led_right = i & 8, controls.gamma = i & 16, controls.dark_interval = i;
    for (const LeapControlWrite& write : allControlWrites(controls)) {
      EXPECT_NE(LeapSelector::kMemoryByte, write.selector);
      EXPECT_FALSE(write.selector == LeapSelector::kSwitch && (write.value & 0x3f) == 6);
    }
  }
}

TEST(LeapProtocol, writesOnlyWhatChanged) {
  LeapControls before, after;
  EXPECT_TRUE(changedControlWrites(before, after).empty());
  after.exposure_us = 99;
  after.led_centre = false;
  const std::vector<LeapControlWrite> expected = {{LeapSelector::kSwitch, 0x0003},
                                                  {LeapSelector::kExposure, 99}};
  EXPECT_EQ(expected, changedControlWrites(before, after));
}

TEST(LeapProtocol, clampsToWhatTheDeviceTakes) {
  LeapControls wild;
  wild.exposure_us = 0;
  wild.analog_gain = 200;
  wild.digital_gain = 0;
  wild.dark_interval = 1000;
  const LeapControls tame = clamped(wild);
  EXPECT_EQ(10, tame.exposure_us);
  EXPECT_EQ(63, tame.analog_gain);
  EXPECT_EQ(4, tame.digital_gain);
  EXPECT_EQ(127, tame.dark_interval);
}

}  // namespace
}  // namespace leap_object_tracker
