#include "leap_object_tracker/leap/leap_device.hpp"

#include <libusb-1.0/libusb.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "leap_object_tracker/leap/leap_calibration.hpp"

namespace leap_object_tracker {
namespace {

using std::chrono::milliseconds;

// Memory map.
constexpr int kSerialAddress = 0x00, kSerialBytes = 14;
constexpr int kFirmwareAddress = 0x60, kFirmwareBytes = 4;
constexpr int kCalibrationAddress = 0x64;
constexpr int kParkingAddress = 0x30;  // zeros; a stray write there harms nothing

constexpr milliseconds kMemoryTimeout{200}, kControlTimeout{500}, kNegotiationTimeout{1000};
constexpr milliseconds kSilence{3000};
constexpr int kMemoryAttempts = 3;
constexpr milliseconds kSlowMemoryPause{4};
constexpr std::size_t kSmallestTransfer = 16384, kLargestTransfer = 1 << 20;
constexpr std::size_t kTransferStep = 1024;  // packets of both speeds divide it
constexpr double kPayloadBytes = 16368;      // of pixels

std::uint16_t indexOf(std::uint8_t unit, std::uint8_t interface_number) {
  return static_cast<std::uint16_t>(unit << 8 | interface_number);
}

bool isSerialCharacter(std::uint8_t byte) { return byte >= '-' && byte <= 'z'; }

/// ASCII up to the first NUL; empty if there is anything else.
std::string serialFromMemory(const std::vector<std::uint8_t>& bytes) {
  const auto end = std::find(bytes.begin(), bytes.end(), 0);
  if (!std::all_of(bytes.begin(), end, isSerialCharacter)) return "";
  return std::string(bytes.begin(), end);
}

double onSteadyClock(Arrival arrival) {
  return std::chrono::duration<double>(arrival.time_since_epoch()).count();
}

}  // namespace

LeapDevice::LeapDevice(UsbContext& context, const std::string& serial, bool reset) {
  const std::vector<UsbDevice> leaps = context.leaps();
  if (leaps.empty())
    throw LeapError(LeapFault::kAbsent,
                    "no Leap Motion (USB f182:0003) on the bus; plug it in, or check the cable");
  context.forgetAbsent(leaps);
  std::optional<LeapError> refusal;
  std::string others;
  for (const UsbDevice& leap : leaps) {
    const auto known = context.serials.find(leap.number());
    if (!serial.empty() && known != context.serials.end() && known->second != serial) {
      others += (others.empty() ? "" : ", ") + known->second;
      continue;
    }
    try {
      link_ = std::make_unique<UsbLink>(context, leap);
      if (reset) link_->reset();
      identity_ = {};
      identity_.location = link_->location();
      identity_.layout = parseLayout(link_->configurationDescriptor());
      identity_.serial = readSerial();
      if (serial.empty() || identity_.serial == serial) {
        readIdentity();
        return;
      }
      if (!identity_.serial.empty()) context.serials[leap.number()] = identity_.serial;
      others += (others.empty() ? "" : ", ") + identity_.serial;
    } catch (const LeapError& error) {
      refusal = error;
    }
    link_.reset();
  }
  if (refusal) throw *refusal;
  throw LeapError(LeapFault::kAbsent,
                  "no Leap with serial number " + serial + " on the bus, only: " + others);
}

LeapDevice::~LeapDevice() = default;

/// A byte of the device's memory comes by writing its address to one control and reading another.
std::vector<std::uint8_t> LeapDevice::readMemory(int first, int count, milliseconds pause) {
  const LeapLayout& layout = identity_.layout;
  const std::uint16_t index = indexOf(layout.processing_unit, layout.control_interface);
  const auto value = [](LeapSelector selector) {
    return static_cast<std::uint16_t>(uvcSelector(selector) << 8);
  };
  std::vector<std::uint8_t> bytes;
  for (int i = 0; i < count; ++i) {
    const std::vector<std::uint8_t> address = {static_cast<std::uint8_t>(first + i), 0};
    int code = link_->write(kUvcWrite, kSetCur, value(LeapSelector::kMemoryAddress), index, address,
                            kMemoryTimeout);
    std::vector<std::uint8_t> reply(2);
    if (code >= 0) {
      if (pause.count() > 0) std::this_thread::sleep_for(pause);
      code = link_->read(kUvcRead, kGetCur, value(LeapSelector::kMemoryByte), index, reply,
                         kMemoryTimeout);
    }
    if (code < 0) link_->fail(code, "reading its memory");
    if (reply.empty())
      throw LeapError(LeapFault::kBadReply,
                      "Leap at " + link_->location() +
                          ": it answers with nothing, as it does with too little power; use "
                          "another port, a shorter cable or a powered hub");
    bytes.push_back(reply[0]);
  }
  return bytes;
}

std::string LeapDevice::readSerial() {
  for (int attempt = 0; attempt < kMemoryAttempts; ++attempt) {
    const bool last = attempt + 1 == kMemoryAttempts;
    try {
      const std::string serial = serialFromMemory(
          readMemory(kSerialAddress, kSerialBytes, last ? kSlowMemoryPause : milliseconds(0)));
      if (!serial.empty()) return serial;
    } catch (const LeapError& error) {
      if (last || error.fault() == LeapFault::kUnplugged) throw;
    }
  }
  return "";
}

void LeapDevice::readIdentity() {
  for (int attempt = 0; attempt < kMemoryAttempts && identity_.calibration.empty(); ++attempt) {
    const bool last = attempt + 1 == kMemoryAttempts;
    const milliseconds pause = last ? kSlowMemoryPause : milliseconds(0);
    try {
      identity_.firmware = readMemory(kFirmwareAddress, kFirmwareBytes, pause);
      const std::vector<std::uint8_t> calibration =
          readMemory(kCalibrationAddress, kCalibrationBytes, pause);
      if (calibrationChecksumHolds(calibration)) identity_.calibration = calibration;
    } catch (const LeapError& error) {
      if (last || error.fault() == LeapFault::kUnplugged) throw;
    }
  }
  readMemory(kParkingAddress, 1, milliseconds(0));
}

void LeapDevice::start(const LeapStreamParams& params, const LeapControls& controls) {
  stream_.reset();
  params_ = params;
  controls_ = clamped(controls);
  const LeapModeInfo& mode = leapModeInfo(params.mode);
  const double period = 1 / mode.rate();
  first_payload_time_ = period / std::ceil(static_cast<double>(mode.frameBytes()) / kPayloadBytes);

  link_->selectInterface(identity_.layout.streaming_interface);
  link_->clearHalt(identity_.layout.bulk_endpoint);
  writeAll();

  {
    const std::lock_guard<std::mutex> lock(mutex_);
    assembler_.emplace(mode.size, params.buffers);
    clock_.emplace(period);
    waiting_.clear();
    last_device_ms_.reset();
  }
  // The size of payloads is agreed on before the first transfer, and the stream begins after.
  negotiate(params.mode);
  last_sign_ = std::chrono::steady_clock::now();
  first_frame_seen_ = false;
}

/// Probe, transfers, commit (UVC 1.0, section 4.3.1).
void LeapDevice::negotiate(LeapMode mode) {
  const LeapLayout& layout = identity_.layout;
  const LeapLayout::Frame wanted = layout.frame(mode);
  const std::uint16_t interface_number = layout.streaming_interface;
  LeapProbe probe;
  probe.format_index = layout.format_index;
  probe.frame_index = wanted.index;
  probe.interval_100ns = wanted.interval_100ns;

  const auto send = [&](std::uint8_t selector, const char* doing) {
    const auto bytes = encodeProbe(probe);
    const int code =
        link_->write(kUvcWrite, kSetCur, static_cast<std::uint16_t>(selector << 8),
                     interface_number, ByteView(bytes.data(), bytes.size()), kNegotiationTimeout);
    if (code < 0) link_->fail(code, doing);
  };
  send(kProbeSelector, "asking for a mode");

  std::vector<std::uint8_t> reply(kProbeBytes);
  const int code = link_->read(kUvcRead, kGetCur, kProbeSelector << 8, interface_number, reply,
                               kNegotiationTimeout);
  if (code < 0) link_->fail(code, "reading the mode back");
  const std::optional<LeapProbe> agreed = decodeProbe(reply);
  if (!agreed || agreed->format_index != probe.format_index ||
      agreed->frame_index != probe.frame_index)
    throw LeapError(LeapFault::kBadReply, "Leap at " + link_->location() +
                                              ": it does not agree to mode " +
                                              leapModeInfo(mode).name + "; choose another one");
  probe.largest_payload = agreed->largest_payload;

  const std::size_t payload =
      std::clamp<std::size_t>(probe.largest_payload, kSmallestTransfer, kLargestTransfer);
  transfer_bytes_ = (payload + kTransferStep - 1) / kTransferStep * kTransferStep;
  stream_ = std::make_unique<BulkStream>(
      *link_, layout.bulk_endpoint, params_.transfers, transfer_bytes_,
      BulkStream::Consumer{[this](ByteView bytes, Arrival arrival) { receive(bytes, arrival); },
                           [this] {
                             const std::lock_guard<std::mutex> lock(mutex_);
                             assembler_->restart();
                           }});
  send(kCommitSelector, "starting pictures");
}

void LeapDevice::write(const LeapControlWrite& write) {
  const LeapLayout& layout = identity_.layout;
  const std::uint8_t unit =
      isOfCameraTerminal(write.selector) ? layout.camera_terminal : layout.processing_unit;
  const std::vector<std::uint8_t> data = {static_cast<std::uint8_t>(write.value & 0xff),
                                          static_cast<std::uint8_t>(write.value >> 8), 0, 0};
  const auto send = [&](std::size_t bytes) {
    return link_->write(
        kUvcWrite, kSetCur, static_cast<std::uint16_t>(uvcSelector(write.selector) << 8),
        indexOf(unit, layout.control_interface), ByteView(data.data(), bytes), kControlTimeout);
  };
  int code = send(2);
  if (code == LIBUSB_ERROR_PIPE) code = send(4);  // some firmware wants 32 bits
  const bool essential =
      write.selector == LeapSelector::kExposure || write.selector == LeapSelector::kAnalogGain;
  if (code == LIBUSB_ERROR_NO_DEVICE || (code < 0 && essential))
    link_->fail(code, "setting exposure, gain, LEDs and the like");
}

void LeapDevice::writeAll() {
  for (const LeapControlWrite& each : allControlWrites(controls_)) write(each);
  history_.sent(controls_);
}

void LeapDevice::setControls(const LeapControls& controls) {
  const LeapControls next = clamped(controls);
  for (const LeapControlWrite& each : changedControlWrites(controls_, next)) write(each);
  controls_ = next;
  history_.sent(next);
}

/// On the thread of the stream: must be quick.
void LeapDevice::receive(ByteView payload, Arrival arrival) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::optional<AssembledFrame> frame = assembler_->push(payload, arrival);
  if (!frame) return;
  countMissing(*frame);
  WaitingFrame waiting;
  waiting.begin = frame->has_device_ms
                      ? clock_->push(frame->device_ms, onSteadyClock(frame->arrival))
                      : onSteadyClock(frame->arrival);
  waiting.end = onSteadyClock(arrival);
  waiting.frame = std::move(*frame);
  waiting_.push_back(std::move(waiting));
  if (waiting_.size() > static_cast<std::size_t>(std::max(1, params_.queue))) {
    waiting_.pop_front();
    ++dropped_;
  }
  frame_came_.notify_one();
}

void LeapDevice::countMissing(const AssembledFrame& frame) {
  if (!frame.has_device_ms) return;
  if (last_device_ms_) {
    const auto elapsed = static_cast<std::int32_t>(frame.device_ms - *last_device_ms_);
    const double periods = std::round(elapsed / 1000.0 / clock_->period());
    if (periods > 1 && periods < 1000) missing_ += static_cast<std::uint64_t>(periods) - 1;
  }
  last_device_ms_ = frame.device_ms;
}

std::optional<LeapFrame> LeapDevice::grab(milliseconds timeout) {
  WaitingFrame waiting;
  {
    std::unique_lock<std::mutex> lock(mutex_);
    frame_came_.wait_for(lock, timeout, [this] {
      return !waiting_.empty() || stream_->unplugged() || stream_->failed();
    });
    if (!waiting_.empty()) {
      waiting = std::move(waiting_.front());
      waiting_.pop_front();
    }
  }
  if (waiting.frame.images.left.empty()) {
    if (stream_->unplugged())
      throw LeapError(LeapFault::kUnplugged, "Leap at " + link_->location() + " was unplugged");
    if (stream_->failed())
      throw LeapError(LeapFault::kStalled,
                      "Leap at " + link_->location() +
                          ": nothing but transfer errors; use another port or cable");
    if (std::chrono::steady_clock::now() - last_sign_ > kSilence) explainSilence();
    return std::nullopt;
  }
  last_sign_ = std::chrono::steady_clock::now();
  if (!first_frame_seen_) {
    // Some units take settings only while pictures flow.
    first_frame_seen_ = true;
    writeAll();
  }
  return finished(std::move(waiting));
}

void LeapDevice::explainSilence() {
  const std::string where = "Leap at " + link_->location() + ": ";
  const LeapCounters seen = counters();
  if (seen.transfers.payloads == 0)
    throw LeapError(
        LeapFault::kLockedFirmware,
        where +
            "it accepts everything and sends no picture. Stock firmware (1.7.0 and older) "
            "delivers no frames without the maker's challenge-response handshake; this driver "
            "needs firmware 1.7.1 or newer (\"LeapUVC\"). Update it with UnlockDevice.exe from "
            "github.com/leapmotion/leapuvc on Windows");
  if (!first_frame_seen_)
    throw LeapError(LeapFault::kStalled,
                    where + "pictures arrive only in parts (" + std::to_string(seen.frames.torn) +
                        " torn); another device may share the bus, or the computer is too busy");
  throw LeapError(LeapFault::kStalled, where + "pictures stopped; it is started again");
}

LeapFrame LeapDevice::finished(WaitingFrame&& waiting) {
  LeapFrame frame;
  frame.metadata = waiting.frame.metadata;
  frame.taken_with = history_.ofFrame(frame.metadata);
  frame.device_ms = waiting.frame.device_ms;
  frame.owner = std::move(waiting.frame.images.owner);
  frame.images.left = std::move(waiting.frame.images.left);
  frame.images.right = std::move(waiting.frame.images.right);

  // The exposure ends when read-out begins.
  const double middle = waiting.begin - first_payload_time_ -
                        frame.taken_with.exposure_us * 1e-6 / 2 + params_.stamp_offset;
  frame.transport = waiting.end - middle;
  const auto since_now = std::chrono::duration_cast<std::chrono::nanoseconds>(
      std::chrono::duration<double>(middle - onSteadyClock(Arrival::clock::now())));
  const Stamp now =
      std::chrono::time_point_cast<std::chrono::nanoseconds>(std::chrono::system_clock::now());
  frame.images.stamp = std::max(now + since_now, last_stamp_ + std::chrono::nanoseconds(1));
  last_stamp_ = frame.images.stamp;
  return frame;
}

LeapCounters LeapDevice::counters() const {
  LeapCounters counters;
  const std::lock_guard<std::mutex> lock(mutex_);
  if (assembler_) counters.frames = assembler_->counters();
  if (stream_) counters.transfers = stream_->counters();
  counters.dropped = dropped_;
  counters.missing = missing_;
  return counters;
}

}  // namespace leap_object_tracker
