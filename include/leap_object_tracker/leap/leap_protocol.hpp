#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/leap/byte_view.hpp"

namespace leap_object_tracker {

constexpr std::uint16_t kLeapVendor = 0xf182;
constexpr std::uint16_t kLeapProduct = 0x0003;

/// The picture sizes that the device offers, each at one rate.
enum class LeapMode { k640x480, k640x240, k640x120, k752x480, k752x240, k752x120 };

struct LeapModeInfo {
  LeapMode mode;
  const char* name;              ///< as in configuration files
  std::uint8_t frame_index;      ///< bFrameIndex of the retail descriptor
  cv::Size size;                 ///< [px] of one eye
  std::uint32_t interval_100ns;  ///< dwFrameInterval [100 ns]

  double rate() const { return 1e7 / interval_100ns; }  ///< [1/s], nominal
  std::size_t frameBytes() const { return 2 * static_cast<std::size_t>(size.area()); }
};

const std::array<LeapModeInfo, 6>& leapModes();
const LeapModeInfo& leapModeInfo(LeapMode mode);
/// @param name such as "640x240"
std::optional<LeapMode> leapModeFromName(const std::string& name);

// Requests of USB Video Class 1.0 (table A-8) that this device may be sent. GET_DEF and GET_LEN are
// missing on purpose: the streaming interface does not answer them for five seconds.
constexpr std::uint8_t kUvcWrite = 0x21;  ///< bmRequestType: class, to an interface
constexpr std::uint8_t kUvcRead = 0xa1;   ///< bmRequestType: class, from an interface
constexpr std::uint8_t kSetCur = 0x01;
constexpr std::uint8_t kGetCur = 0x81;
constexpr std::uint8_t kProbeSelector = 0x01;
constexpr std::uint8_t kCommitSelector = 0x02;

/// The standard control that carries each of the device's own ones.
enum class LeapSelector : std::uint16_t {
  kFrameRatio = 0x0106,     ///< camera terminal, focus [1/1000 of the mode's rate]
  kExposure = 0x010b,       ///< camera terminal, zoom [us]
  kDigitalGain = 0x0202,    ///< processing unit, brightness [1/4]
  kSwitch = 0x0203,         ///< processing unit, contrast: value << 6 | switch
  kAnalogGain = 0x0204,     ///< processing unit, gain [1/16]
  kMemoryByte = 0x0207,     ///< processing unit, saturation: read only, a write may reach the flash
  kMemoryAddress = 0x0208,  ///< processing unit, sharpness
  kGamma = 0x0209,          ///< processing unit, gamma
  kDarkInterval = 0x020a,   ///< processing unit, white balance temperature
};
constexpr bool isOfCameraTerminal(LeapSelector selector) {
  return (static_cast<std::uint16_t>(selector) >> 8) == 1;
}
constexpr std::uint8_t uvcSelector(LeapSelector selector) {
  return static_cast<std::uint8_t>(static_cast<std::uint16_t>(selector) & 0xff);
}

// Ranges that the device takes.
constexpr int kShortestExposureUs = 10;
constexpr int kLongestExposureUs = 65535;
constexpr int kLeastAnalogGain = 16;  // [1/16]
constexpr int kMostAnalogGain = 63;   // [1/16]
constexpr int kLeastDigitalGain = 4;  // [1/4]
constexpr int kMostDigitalGain = 15;  // [1/4]
constexpr int kLongestDarkInterval = 127;

/// All that can be set while pictures flow. Values outside the device's range are clamped.
struct LeapControls {
  int exposure_us = 200;  ///< [us], 10 to 65535
  int analog_gain = 16;   ///< [1/16], 16 to 63
  int digital_gain = 4;   ///< [1/4], 4 to 15
  bool gamma = false;     ///< square-root response instead of a linear one
  bool hdr = false;       ///< multi-slope exposure
  bool led_left = true;
  bool led_centre = true;
  bool led_right = true;
  int dark_interval = 0;  ///< 0: LEDs in each frame, 1: in none, n: one dark frame in about n

  /// Light gathered, in units of one microsecond at gain 1.
  double light() const { return exposure_us * (analog_gain / 16.0) * (digital_gain / 4.0); }
};
bool operator==(const LeapControls& a, const LeapControls& b);
inline bool operator!=(const LeapControls& a, const LeapControls& b) { return !(a == b); }
LeapControls clamped(const LeapControls& controls);

struct LeapControlWrite {
  LeapSelector selector;
  std::uint16_t value;
};
bool operator==(const LeapControlWrite& a, const LeapControlWrite& b);

/// Everything a device must be told after it was connected: it forgets all, and some defaults are
/// unknown.
std::vector<LeapControlWrite> allControlWrites(const LeapControls& controls);
/// Only what differs.
std::vector<LeapControlWrite> changedControlWrites(const LeapControls& before,
                                                   const LeapControls& after);

/// The part of a UVC probe and commit block (26 bytes, UVC 1.0) that matters here.
struct LeapProbe {
  std::uint8_t format_index = 1;
  std::uint8_t frame_index = 0;
  std::uint32_t interval_100ns = 0;       ///< [100 ns]
  std::uint32_t largest_payload = 16384;  ///< dwMaxPayloadTransferSize [bytes]
};
constexpr std::size_t kProbeBytes = 26;
std::array<std::uint8_t, kProbeBytes> encodeProbe(const LeapProbe& probe);
/// @return nullopt for fewer than 26 bytes.
std::optional<LeapProbe> decodeProbe(ByteView bytes);

/// Where the device's parts are, as its configuration descriptor says.
struct LeapLayout {
  std::uint8_t control_interface = 0;
  std::uint8_t streaming_interface = 1;
  std::uint8_t camera_terminal = 2;
  std::uint8_t processing_unit = 5;
  std::uint8_t bulk_endpoint = 0x83;
  std::uint8_t format_index = 1;
  struct Frame {
    std::uint8_t index;
    cv::Size size;                 ///< [px] of one eye
    std::uint32_t interval_100ns;  ///< [100 ns]
  };
  std::vector<Frame> frames;

  /// The frame of a mode: the device's own entry, or that of the retail firmware.
  Frame frame(LeapMode mode) const;
};

/// Reads a whole configuration descriptor; parts that it does not have keep the retail values.
LeapLayout parseLayout(ByteView configuration_descriptor);

}  // namespace leap_object_tracker
