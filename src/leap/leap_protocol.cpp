#include "leap_object_tracker/leap/leap_protocol.hpp"

#include <algorithm>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

// Descriptor types and subtypes of UVC 1.0, appendix A.
constexpr std::uint8_t kInterfaceDescriptor = 0x04;
constexpr std::uint8_t kEndpointDescriptor = 0x05;
constexpr std::uint8_t kClassInterfaceDescriptor = 0x24;
constexpr std::uint8_t kVideoClass = 0x0e;
constexpr std::uint8_t kVideoControl = 0x01;
constexpr std::uint8_t kVideoStreaming = 0x02;
constexpr std::uint8_t kInputTerminal = 0x02;
constexpr std::uint8_t kProcessingUnit = 0x05;
constexpr std::uint8_t kUncompressedFormat = 0x04;
constexpr std::uint8_t kUncompressedFrame = 0x05;
constexpr std::uint16_t kCameraTerminal = 0x0201;
constexpr std::uint8_t kBulk = 0x02;

// Switches of LeapSelector::kSwitch; number 6 (vertical zoom) stops the firmware and has no name.
enum Switch : std::uint16_t {
  kHdr = 0,
  kRotate = 1,
  kLedLeft = 2,
  kLedCentre = 3,
  kLedRight = 4,
  kVerticalCentre = 5
};
constexpr std::uint16_t kCentredWindow = 240;

std::uint32_t read32(const std::uint8_t* bytes) {
  return bytes[0] | bytes[1] << 8 | bytes[2] << 16 | static_cast<std::uint32_t>(bytes[3]) << 24;
}
std::uint16_t read16(const std::uint8_t* bytes) {
  return static_cast<std::uint16_t>(bytes[0] | bytes[1] << 8);
}
void write32(std::uint8_t* bytes, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) bytes[i] = static_cast<std::uint8_t>(value >> (8 * i));
}

LeapControlWrite switchWrite(Switch which, std::uint16_t value) {
  return {LeapSelector::kSwitch, static_cast<std::uint16_t>(value << 6 | which)};
}

/// In the order in which the vendor's program writes them: exposure and gain last and together.
std::vector<LeapControlWrite> pictureWrites(const LeapControls& c) {
  return {switchWrite(kHdr, c.hdr),
          switchWrite(kLedLeft, c.led_left),
          switchWrite(kLedCentre, c.led_centre),
          switchWrite(kLedRight, c.led_right),
          {LeapSelector::kGamma, static_cast<std::uint16_t>(c.gamma)},
          {LeapSelector::kDarkInterval, static_cast<std::uint16_t>(c.dark_interval)},
          {LeapSelector::kDigitalGain, static_cast<std::uint16_t>(c.digital_gain)},
          {LeapSelector::kExposure, static_cast<std::uint16_t>(c.exposure_us)},
          {LeapSelector::kAnalogGain, static_cast<std::uint16_t>(c.analog_gain)}};
}

}  // namespace

const std::array<LeapModeInfo, 6>& leapModes() {
  static const std::array<LeapModeInfo, 6> modes = {{
      {LeapMode::k640x480, "640x480", 1, {640, 480}, 173913},
      {LeapMode::k640x240, "640x240", 2, {640, 240}, 86956},
      {LeapMode::k640x120, "640x120", 3, {640, 120}, 46728},
      {LeapMode::k752x480, "752x480", 4, {752, 480}, 200000},
      {LeapMode::k752x240, "752x240", 5, {752, 240}, 100000},
      {LeapMode::k752x120, "752x120", 6, {752, 120}, 52631},
  }};
  return modes;
}

const LeapModeInfo& leapModeInfo(LeapMode mode) {
  return leapModes().at(static_cast<std::size_t>(mode));
}

std::optional<LeapMode> leapModeFromName(const std::string& name) {
  for (const LeapModeInfo& info : leapModes())
    if (name == info.name) return info.mode;
  return std::nullopt;
}

bool operator==(const LeapControls& a, const LeapControls& b) {
  return pictureWrites(a) == pictureWrites(b);
}

bool operator==(const LeapControlWrite& a, const LeapControlWrite& b) {
  return a.selector == b.selector && a.value == b.value;
}

LeapControls clamped(const LeapControls& controls) {
  LeapControls c = controls;
  c.exposure_us = std::clamp(c.exposure_us, kShortestExposureUs, kLongestExposureUs);
  c.analog_gain = std::clamp(c.analog_gain, kLeastAnalogGain, kMostAnalogGain);
  c.digital_gain = std::clamp(c.digital_gain, kLeastDigitalGain, kMostDigitalGain);
  c.dark_interval = std::clamp(c.dark_interval, 0, kLongestDarkInterval);
  return c;
}

std::vector<LeapControlWrite> allControlWrites(const LeapControls& controls) {
  std::vector<LeapControlWrite> writes = {switchWrite(kRotate, 0),
                                          switchWrite(kVerticalCentre, kCentredWindow),
                                          {LeapSelector::kFrameRatio, 1000}};
  const std::vector<LeapControlWrite> picture = pictureWrites(clamped(controls));
  writes.insert(writes.end(), picture.begin(), picture.end());
  return writes;
}

std::vector<LeapControlWrite> changedControlWrites(const LeapControls& before,
                                                   const LeapControls& after) {
  const std::vector<LeapControlWrite> old_writes = pictureWrites(clamped(before));
  std::vector<LeapControlWrite> writes = pictureWrites(clamped(after));
  writes.erase(std::remove_if(writes.begin(), writes.end(),
                              [&](const LeapControlWrite& write) {
                                return std::find(old_writes.begin(), old_writes.end(), write) !=
                                       old_writes.end();
                              }),
               writes.end());
  return writes;
}

std::array<std::uint8_t, kProbeBytes> encodeProbe(const LeapProbe& probe) {
  std::array<std::uint8_t, kProbeBytes> bytes{};
  bytes[0] = 1;  // bmHint: keep the interval
  bytes[2] = probe.format_index;
  bytes[3] = probe.frame_index;
  write32(&bytes[4], probe.interval_100ns);
  write32(&bytes[18], 752 * 480 * 2);  // the device says this for every mode
  write32(&bytes[22], probe.largest_payload);
  return bytes;
}

std::optional<LeapProbe> decodeProbe(ByteView bytes) {
  if (bytes.size < kProbeBytes) return std::nullopt;
  return LeapProbe{bytes[2], bytes[3], read32(bytes.data + 4), read32(bytes.data + 22)};
}

LeapLayout::Frame LeapLayout::frame(LeapMode mode) const {
  const LeapModeInfo& info = leapModeInfo(mode);
  for (const Frame& frame : frames)
    if (frame.size == info.size) return frame;
  return {info.frame_index, info.size, info.interval_100ns};
}

LeapLayout parseLayout(ByteView bytes) {
  LeapLayout layout;
  std::uint8_t video_part = 0;  // subclass of the interface that the bytes belong to
  std::uint8_t interface_number = 0;
  bool in_uncompressed_format = false;
  for (std::size_t at = 0; at + 2 <= bytes.size;) {
    const std::uint8_t length = bytes[at];
    if (length < 3 || at + length > bytes.size) break;
    const std::uint8_t* d = bytes.data + at;
    at += length;
    switch (d[1]) {
      case kInterfaceDescriptor:
        if (length < 9) break;
        interface_number = d[2];
        video_part = d[5] == kVideoClass ? d[6] : 0;
        if (video_part == kVideoControl) layout.control_interface = interface_number;
        if (video_part == kVideoStreaming) layout.streaming_interface = interface_number;
        break;
      case kEndpointDescriptor:
        if (length >= 7 && video_part == kVideoStreaming && (d[3] & 3) == kBulk && (d[2] & 0x80))
          layout.bulk_endpoint = d[2];
        break;
      case kClassInterfaceDescriptor:
        if (video_part == kVideoControl) {
          if (d[2] == kInputTerminal && length >= 8 && read16(d + 4) == kCameraTerminal)
            layout.camera_terminal = d[3];
          if (d[2] == kProcessingUnit && length >= 8) layout.processing_unit = d[3];
        } else if (video_part == kVideoStreaming) {
          if (d[2] == kUncompressedFormat && length >= 22) {
            in_uncompressed_format = d[21] == 16;  // bits of one pair of samples
            if (in_uncompressed_format) layout.format_index = d[3];
          } else if (d[2] == kUncompressedFrame && in_uncompressed_format && length >= 26) {
            layout.frames.push_back({d[3], cv::Size(read16(d + 5), read16(d + 7)), read32(d + 21)});
          }
        }
        break;
    }
  }
  return layout;
}

}  // namespace leap_object_tracker
