#include "leap_object_tracker/leap/frame_metadata.hpp"

namespace leap_object_tracker {
namespace {

constexpr std::uint8_t kTag = 0x78;

}  // namespace

FrameMetadata decodeMetadata(const std::uint8_t* samples) {
  FrameMetadata metadata;
  metadata.tagged = samples[0] == kTag;
  metadata.label2 = (samples[1] & 0x0f) << 4 | (samples[2] & 0x0f);
  metadata.label1 = samples[3] >> 4 & 1;
  metadata.exposure_bits = (samples[3] & 0x0f) << 5 | (samples[4] & 0x1f);
  metadata.gain_bits = samples[5] & 0x1f;
  return metadata;
}

std::array<std::uint8_t, kMetadataSamples> encodeMetadata(const FrameMetadata& metadata) {
  const auto byte = [](int value) { return static_cast<std::uint8_t>(value); };
  return {metadata.tagged ? kTag : byte(0),
          byte(metadata.label2 >> 4 & 0x0f),
          byte(metadata.label2 & 0x0f),
          byte(metadata.label1 << 4 | (metadata.exposure_bits >> 5 & 0x0f)),
          byte(metadata.exposure_bits & 0x1f),
          byte(metadata.gain_bits & 0x1f)};
}

}  // namespace leap_object_tracker
