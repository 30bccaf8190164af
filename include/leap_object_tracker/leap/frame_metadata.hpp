#pragma once

#include <array>
#include <cstdint>

namespace leap_object_tracker {

/// What the last six samples of each eye's picture carry instead of light.
struct FrameMetadata {
  bool tagged = false;    ///< the tag 0x78 seen on all known units is there
  int label1 = 0;         ///< 1 on frames that were lit
  int label2 = 0;         ///< counts within the dark-frame cycle, it seems
  int exposure_bits = 0;  ///< exposure [us] modulo 512
  int gain_bits = 0;      ///< analog gain [1/16] modulo 32

  /// The label as the vendor's program combines it.
  int label() const { return (label1 > label2 ? label1 : label2) & 0x7f; }
};

constexpr int kMetadataSamples = 6;

/// @param samples the last six of one eye's picture, in reading order
FrameMetadata decodeMetadata(const std::uint8_t* samples);
std::array<std::uint8_t, kMetadataSamples> encodeMetadata(const FrameMetadata& metadata);

}  // namespace leap_object_tracker
