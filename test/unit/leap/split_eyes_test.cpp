#include "leap_object_tracker/leap/split_eyes.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace leap_object_tracker {
namespace {

TEST(SplitEyes, givesEvenBytesToTheLeftAndOddOnesToTheRightForAnyLength) {
  for (std::size_t pixels = 0; pixels < 300; ++pixels) {
    std::vector<std::uint8_t> interleaved(2 * pixels);
    for (std::size_t i = 0; i < interleaved.size(); ++i)
      interleaved[i] = static_cast<std::uint8_t>(i * 37 + i / 256);
    std::vector<std::uint8_t> left(pixels + 1, 0xee), right(pixels + 1, 0xee);
    splitEyes(interleaved.data(), pixels, left.data(), right.data());
    for (std::size_t i = 0; i < pixels; ++i) {
      ASSERT_EQ(interleaved[2 * i], left[i]);
      ASSERT_EQ(interleaved[2 * i + 1], right[i]);
    }
    EXPECT_EQ(0xee, left[pixels]);
    EXPECT_EQ(0xee, right[pixels]);
  }
}

}  // namespace
}  // namespace leap_object_tracker
