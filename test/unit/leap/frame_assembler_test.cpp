#include "leap_object_tracker/leap/frame_assembler.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

#include "support/emulated_leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

const cv::Size kSize(32, 4);           // 256 bytes
constexpr std::size_t kPayload = 100;  // bytes of pixels: three payloads a frame

/// Header as the device sends it, and pixels.
Bytes payload(bool frame_id, bool end, std::uint32_t ms, const Bytes& data) {
  Bytes bytes = {12, static_cast<std::uint8_t>(0x8c | frame_id | end << 1)};
  for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<std::uint8_t>(ms >> (8 * i)));
  bytes.resize(12);
  bytes.insert(bytes.end(), data.begin(), data.end());
  return bytes;
}

/// Noise that is the same for the same number.
Bytes raster(std::uint32_t number) {
  std::mt19937 random(number + 1);
  Bytes bytes(2 * static_cast<std::size_t>(kSize.area()));
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
  bytes[0] = static_cast<std::uint8_t>(number);
  bytes[2] = static_cast<std::uint8_t>(number >> 8);
  return bytes;
}
std::uint32_t numberOf(const AssembledFrame& frame) {
  return frame.images.left.data[0] | frame.images.left.data[1] << 8;
}

std::vector<Bytes> payloadsOf(std::uint32_t number) {
  const Bytes pixels = raster(number);
  std::vector<Bytes> payloads;
  for (std::size_t at = 0; at < pixels.size(); at += kPayload) {
    const std::size_t end = std::min(pixels.size(), at + kPayload);
    payloads.push_back(payload(number & 1, end == pixels.size(), 9 * number,
                               Bytes(pixels.begin() + static_cast<std::ptrdiff_t>(at),
                                     pixels.begin() + static_cast<std::ptrdiff_t>(end))));
  }
  return payloads;
}

::testing::AssertionResult isUnchanged(const AssembledFrame& frame) {
  const Bytes pixels = raster(numberOf(frame));
  for (std::size_t i = 0; i < pixels.size() / 2 - kMetadataSamples; ++i)
    if (pixels[2 * i] != frame.images.left.data[i] ||
        pixels[2 * i + 1] != frame.images.right.data[i])
      return ::testing::AssertionFailure() << "frame " << numberOf(frame) << " at pixel " << i;
  return ::testing::AssertionSuccess();
}

class FrameAssemblerTest : public testing::Test {
 protected:
  void push(const Bytes& bytes) {
    if (auto frame = assembler_.push(bytes, {})) {
      EXPECT_TRUE(isUnchanged(*frame));
      delivered_.push_back(numberOf(*frame));
    }
  }
  void pushFrame(std::uint32_t number) {
    for (const Bytes& bytes : payloadsOf(number)) push(bytes);
  }

  FrameAssembler assembler_{kSize};
  std::vector<std::uint32_t> delivered_;
};

TEST_F(FrameAssemblerTest, beginsAtTheFirstBoundary) {
  for (std::uint32_t number = 0; number < 3; ++number) pushFrame(number);
  EXPECT_EQ((std::vector<std::uint32_t>{1, 2}), delivered_);
  EXPECT_EQ(2u, assembler_.counters().good);
  EXPECT_EQ(0u, assembler_.counters().torn);
}

TEST_F(FrameAssemblerTest, readsTheHeadersOfARealStream) {
  FrameAssembler assembler(kSize);
  const Bytes end_of_one = fromHex("0c8f85d303000000000000 00");
  Bytes next = fromHex("0c8c8fd303000000000000 00");
  EXPECT_FALSE(assembler.push(end_of_one, {}));
  const Bytes pixels = raster(7);
  next.insert(next.end(), pixels.begin(), pixels.end());
  next[1] |= 2;
  const auto frame = assembler.push(next, {});
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->has_device_ms);
  EXPECT_EQ(250767u, frame->device_ms);
}

TEST_F(FrameAssemblerTest, stampsAFrameWithTheArrivalOfItsFirstPayload) {
  pushFrame(0);
  const auto payloads = payloadsOf(1);
  std::optional<AssembledFrame> frame;
  for (std::size_t i = 0; i < payloads.size(); ++i)
    frame = assembler_.push(payloads[i], Arrival(std::chrono::milliseconds(100 + i)));
  ASSERT_TRUE(frame);
  EXPECT_EQ(Arrival(std::chrono::milliseconds(100)), frame->arrival);
}

TEST_F(FrameAssemblerTest, readsTheMetadataAndHidesIt) {
  pushFrame(0);
  Bytes pixels = raster(1);
  const Bytes metadata = fromHex("787800000000 1f1f1f1f1616");
  std::copy(metadata.begin(), metadata.end(), pixels.end() - 12);
  const auto frame = assembler_.push(payload(true, true, 9, pixels), {});
  ASSERT_TRUE(frame);
  EXPECT_EQ(511, frame->metadata.exposure_bits);
  EXPECT_EQ(22, frame->metadata.gain_bits);
  for (int u = kSize.width - kMetadataSamples; u < kSize.width; ++u) {
    EXPECT_EQ(frame->images.left.at<std::uint8_t>(2, u), frame->images.left.at<std::uint8_t>(3, u));
    EXPECT_EQ(frame->images.right.at<std::uint8_t>(2, u),
              frame->images.right.at<std::uint8_t>(3, u));
  }
}

TEST_F(FrameAssemblerTest, fillsTheMemoryThatItIsGiven) {
  auto memory = std::make_shared<std::vector<std::uint8_t>>(2 * kSize.area());
  FrameAssembler assembler(kSize, [&](cv::Size size) {
    FrameBuffers buffers;
    buffers.left = cv::Mat(size, CV_8UC1, memory->data());
    buffers.right = cv::Mat(size, CV_8UC1, memory->data() + size.area());
    buffers.owner = memory;
    return buffers;
  });
  std::optional<AssembledFrame> frame;
  for (std::uint32_t number = 0; number < 2; ++number)
    for (const Bytes& bytes : payloadsOf(number)) frame = assembler.push(bytes, {});
  ASSERT_TRUE(frame);
  EXPECT_EQ(memory, frame->images.owner);
  EXPECT_EQ(memory->data(), frame->images.left.data);
  EXPECT_EQ(raster(1)[4], (*memory)[2]);
}

TEST_F(FrameAssemblerTest, joinsPayloadsThatEndInTheMiddleOfAPair) {
  pushFrame(0);
  const Bytes pixels = raster(1);
  const auto part = [&](int from, int to, bool end) {
    push(payload(true, end, 9, Bytes(pixels.begin() + from, pixels.begin() + to)));
  };
  part(0, 51, false);
  part(51, 102, false);
  part(102, 153, false);
  part(153, 204, false);
  part(204, 255, false);
  part(255, 256, true);
  EXPECT_EQ((std::vector<std::uint32_t>{1}), delivered_);
}

TEST_F(FrameAssemblerTest, keepsEqualPayloadsOfOneColour) {
  pushFrame(0);
  const Bytes black(64, 0);
  std::optional<AssembledFrame> frame;
  for (int i = 0; i < 4; ++i) frame = assembler_.push(payload(true, i == 3, 9, black), {});
  EXPECT_TRUE(frame);
}

TEST_F(FrameAssemblerTest, ignoresTransfersOfLengthZero) {
  pushFrame(0);
  for (const Bytes& bytes : payloadsOf(1)) {
    push({});
    push(bytes);
  }
  EXPECT_EQ((std::vector<std::uint32_t>{1}), delivered_);
  EXPECT_EQ(3u, assembler_.counters().empty_transfers);
}

TEST_F(FrameAssemblerTest, countsAFrameWhoseEndNeverCame) {
  pushFrame(0);
  auto payloads = payloadsOf(1);
  payloads.pop_back();
  for (const Bytes& bytes : payloads) push(bytes);
  pushFrame(2);
  EXPECT_EQ((std::vector<std::uint32_t>{2}), delivered_);
  EXPECT_EQ(1u, assembler_.counters().lost_end);
  EXPECT_EQ(1u, assembler_.counters().torn);
}

TEST_F(FrameAssemblerTest, givesUpAFrameThatTheDeviceCallsBroken) {
  pushFrame(0);
  auto payloads = payloadsOf(1);
  payloads[1][1] |= 0x40;
  for (const Bytes& bytes : payloads) push(bytes);
  pushFrame(2);
  EXPECT_EQ((std::vector<std::uint32_t>{2}), delivered_);
  EXPECT_EQ(1u, assembler_.counters().error_bit);
}

TEST_F(FrameAssemblerTest, forgetsTheFrameInProgressWhenRestarted) {
  pushFrame(0);
  push(payloadsOf(1)[0]);
  assembler_.restart();
  push(payloadsOf(1)[2]);
  pushFrame(2);
  EXPECT_EQ((std::vector<std::uint32_t>{2}), delivered_);
}

/// One fault of many kinds. @return whether the frame is still whole
bool damage(std::mt19937& random, std::vector<Bytes>& payloads) {
  const std::size_t at = random() % payloads.size();
  const auto position = payloads.begin() + static_cast<std::ptrdiff_t>(at);
  Bytes& hit = payloads[at];
  switch (random() % 11) {
    case 0:
      payloads.erase(position);
      return false;
    case 1:
      payloads.insert(position, hit);
      return true;
    case 2:
      payloads.insert(position, Bytes{});
      return true;
    case 3:
      hit.resize(12 + random() % (hit.size() - 12));
      return false;
    case 4:
      hit.resize(hit.size() + 1 + random() % 3000, 0x55);
      return false;
    case 5:
      hit[1] |= 0x40;
      return false;
    case 6:
      hit[1] &= 0x7f;
      return false;
    case 7:
      hit[0] = static_cast<std::uint8_t>(random() % 2 ? 255 : 1);
      return false;
    case 8:
      hit.resize(random() % 12);
      return false;
    case 9:
      if (hit[0] != 12) return true;  // no time in there
      hit[2] ^= 0x10;
      return false;
    default:
      if (hit[0] != 12) return true;
      hit.erase(hit.begin() + 2, hit.begin() + 12);  // a header without time
      hit[0] = 2;
      hit[1] &= 0xf3;
      return true;
  }
}

TEST_F(FrameAssemblerTest, deliversEveryGoodFrameBetweenTenThousandFaultsAndNoTornOne) {
  std::mt19937 random(1);
  std::vector<std::uint32_t> whole;
  int faults = 0;
  pushFrame(0);
  for (std::uint32_t number = 1; faults < 10000; ++number) {
    std::vector<Bytes> payloads = payloadsOf(number);
    bool is_whole = true;
    for (int i = random() % 3; i > 0 && !payloads.empty(); --i, ++faults) {
      const bool has_pixels = std::all_of(payloads.begin(), payloads.end(),
                                          [](const Bytes& bytes) { return bytes.size() > 13; });
      if (!has_pixels) break;
      is_whole &= damage(random, payloads);
    }
    for (const Bytes& bytes : payloads) push(bytes);
    if (is_whole) whole.push_back(number & 0xffff);
  }
  // Two faults may cancel out, so more may come than that; none may be missing.
  std::size_t at = 0;
  for (const std::uint32_t number : delivered_) at += at < whole.size() && whole[at] == number;
  EXPECT_EQ(whole.size(), at);
  EXPECT_GT(whole.size(), 5000u);
}

}  // namespace
}  // namespace leap_object_tracker
