#include "leap_object_tracker/leap/frame_metadata.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

TEST(FrameMetadata, decodesTheSamplesOfRealFrames) {
  const std::uint8_t first[] = {0x78, 0x00, 0x00, 0x1f, 0x1f, 0x16};
  const FrameMetadata a = decodeMetadata(first);
  EXPECT_TRUE(a.tagged);
  EXPECT_EQ(1, a.label1);
  EXPECT_EQ(0, a.label2);
  EXPECT_EQ(1, a.label());
  EXPECT_EQ(511, a.exposure_bits);
  EXPECT_EQ(22, a.gain_bits);

  const std::uint8_t second[] = {0x78, 0x00, 0x00, 0x1f, 0x1f, 0x1f};
  EXPECT_EQ(31, decodeMetadata(second).gain_bits);
}

TEST(FrameMetadata, decodesWhatItEncodes) {
  FrameMetadata sent;
  sent.tagged = true;
  sent.label1 = 1;
  sent.label2 = 0x5a;
  sent.exposure_bits = 300;
  sent.gain_bits = 17;
  const FrameMetadata seen = decodeMetadata(encodeMetadata(sent).data());
  EXPECT_EQ(sent.tagged, seen.tagged);
  EXPECT_EQ(sent.label1, seen.label1);
  EXPECT_EQ(sent.label2, seen.label2);
  EXPECT_EQ(sent.label(), seen.label());
  EXPECT_EQ(sent.exposure_bits, seen.exposure_bits);
  EXPECT_EQ(sent.gain_bits, seen.gain_bits);
}

}  // namespace
}  // namespace leap_object_tracker
