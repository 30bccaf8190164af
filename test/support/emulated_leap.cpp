#include "emulated_leap.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace leap_object_tracker {
namespace {

constexpr int kHeaderBytes = 12;
constexpr int kPixelBytes = 16368;  // of a full payload
constexpr std::size_t kDeviceBuffer = 3;
constexpr double kReadOutShare = 0.9;  // of a period in which payloads come
constexpr std::size_t kRememberedFrames = 20000;
constexpr std::chrono::milliseconds kIdle{2};

struct Mode {
  cv::Size size;
  std::uint32_t interval;  // [100 ns]
};
constexpr int kModes = 6;
const Mode& modeOf(int frame_index) {
  static const Mode modes[kModes] = {{{640, 480}, 173913}, {{640, 240}, 86956},
                                     {{640, 120}, 46728},  {{752, 480}, 200000},
                                     {{752, 240}, 100000}, {{752, 120}, 52631}};
  return modes[frame_index - 1];
}

void put32(std::uint8_t* at, std::uint32_t value) {
  for (int i = 0; i < 4; ++i) at[i] = static_cast<std::uint8_t>(value >> (8 * i));
}
std::uint32_t get32(const std::uint8_t* at) {
  return at[0] | at[1] << 8 | at[2] << 16 | static_cast<std::uint32_t>(at[3]) << 24;
}

bool isMailbox(int address) {
  return (address >= 0x10 && address <= 0x13) || (address >= 0x20 && address <= 0x27) ||
         (address >= 0x2c && address <= 0x2f);
}

/// 2 MiB of noise, made once.
const Bytes& noiseTable() {
  static const Bytes table = [] {
    Bytes bytes(1 << 21);
    std::uint32_t state = 1;
    for (std::uint8_t& byte : bytes) {
      state = state * 1664525u + 1013904223u;
      byte = static_cast<std::uint8_t>(state >> 24);
    }
    return bytes;
  }();
  return table;
}

}  // namespace

EmulatedLeap::Setup EmulatedLeap::Setup::fromBytes(const std::uint8_t* bytes) {
  Setup setup;
  setup.type = bytes[0];
  setup.request = bytes[1];
  setup.value = static_cast<std::uint16_t>(bytes[2] | bytes[3] << 8);
  setup.index = static_cast<std::uint16_t>(bytes[4] | bytes[5] << 8);
  setup.length = static_cast<std::uint16_t>(bytes[6] | bytes[7] << 8);
  return setup;
}

EmulatedLeap::EmulatedLeap() : memory_(256, 0), picture_(&EmulatedLeap::noise) {
  setSerial("LP10000000001");
  setCalibration(calibrationOfUnitA());
  memory_[0x0e] = 0x70, memory_[0x0f] = 0x73;
  memory_[0x60] = 0x08, memory_[0x61] = 0x09, memory_[0x62] = 0x11;
  powerOn();
}

void EmulatedLeap::setSerial(const std::string& serial) {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (std::size_t i = 0; i < 14; ++i)
    memory_[i] = i < serial.size() ? static_cast<std::uint8_t>(serial[i]) : 0;
}
void EmulatedLeap::setCalibration(const Bytes& calibration) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::copy(calibration.begin(), calibration.end(), memory_.begin() + 0x64);
}
void EmulatedLeap::disturbMemory(int reads) {
  const std::lock_guard<std::mutex> lock(mutex_);
  memory_disturbance_ = reads;
}
void EmulatedLeap::setLocked(bool locked) {
  const std::lock_guard<std::mutex> lock(mutex_);
  locked_ = locked;
}
void EmulatedLeap::setPicture(Picture picture) {
  const std::lock_guard<std::mutex> lock(mutex_);
  picture_ = std::move(picture);
}
void EmulatedLeap::setTamper(Tamper tamper) {
  const std::lock_guard<std::mutex> lock(mutex_);
  tamper_ = std::move(tamper);
}
void EmulatedLeap::setControlBehaviour(ControlBehaviour behaviour) {
  const std::lock_guard<std::mutex> lock(mutex_);
  behaviour_ = behaviour;
}
void EmulatedLeap::setRate(double share) {
  const std::lock_guard<std::mutex> lock(mutex_);
  rate_ = share;
}
bool EmulatedLeap::hasRate() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return rate_ > 0;
}
void EmulatedLeap::setFourByteControls(bool only) {
  const std::lock_guard<std::mutex> lock(mutex_);
  four_byte_controls_ = only;
}

Bytes EmulatedLeap::deviceDescriptor() { return fromHex("12010002ef02014082f10300000001020001"); }

Bytes EmulatedLeap::configurationDescriptor() {
  return fromHex(
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
}

int EmulatedLeap::control(const Setup& setup, std::uint8_t* data) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const bool reads = setup.type & 0x80;
  requests_.push_back({setup, reads ? Bytes() : Bytes(data, data + setup.length)});
  if (crashed_) return -ENODEV;

  const auto give = [&](const Bytes& bytes) {
    const int count = std::min<int>(setup.length, static_cast<int>(bytes.size()));
    std::copy_n(bytes.begin(), count, data);
    return count;
  };
  if ((setup.type & 0x60) == 0) {  // standard request
    switch (setup.request) {
      case 0x06:
        switch (setup.value >> 8) {
          case 1:
            return give(deviceDescriptor());
          case 2:
            return give(configurationDescriptor());
          default:
            return -EPIPE;
        }
      case 0x01:  // CLEAR_FEATURE, of an endpoint: the halt
        if ((setup.type & 0x1f) == 2) halted_ = false;
        return 0;
      case 0x09:  // SET_CONFIGURATION
        return 0;
      case 0x0b:  // SET_INTERFACE
        stop();
        return 0;
      case 0x00:
        return give({static_cast<std::uint8_t>(halted_ ? 1 : 0), 0});
      case 0x08:
        return give({1});
      case 0x0a:
        return give({0});
      default:
        return -EPIPE;
    }
  }
  switch (behaviour_) {
    case ControlBehaviour::kNormal:
      return classRequest(setup, data);
    case ControlBehaviour::kStall:
      return -EPIPE;
    case ControlBehaviour::kShort:
      return 0;
    case ControlBehaviour::kGarbage:
      for (int i = 0; i < setup.length && reads; ++i)
        data[i] = noiseTable()[requests_.size() * 7 + static_cast<std::size_t>(i)];
      return setup.length;
    case ControlBehaviour::kSilent:
      return kNoReply;
  }
  return -EPIPE;
}

int EmulatedLeap::classRequest(const Setup& setup, std::uint8_t* data) {
  const int unit = setup.index >> 8, number = setup.index & 0xff;
  if (number == 1 && unit == 0) return probeRequest(setup, data);
  if (number == 0 && (unit == 2 || unit == 5)) return unitRequest(setup, data);
  return -EPIPE;
}

int EmulatedLeap::probeRequest(const Setup& setup, std::uint8_t* data) {
  const int selector = setup.value >> 8;
  if (setup.request == 0x87 || setup.request == 0x85) {
    forbidden_.push_back("GET_DEF or GET_LEN on the streaming interface");
    return kNoReply;
  }
  if (selector != 1 && selector != 2) return -EPIPE;
  if (setup.request == 0x01) {
    if (setup.length < 26 || data[2] > 1 || data[3] < 1 || data[3] > kModes) return -EPIPE;
    probed_ = true;
    probed_frame_ = data[3];
    if (selector == 2) {
      stop();
      frame_id_ = false;
      streaming_ = !locked_;
    }
    return setup.length;
  }
  if (setup.request != 0x81 && setup.request != 0x83) return -EPIPE;
  Bytes block(26, 0);
  block[2] = 1;
  block[3] = static_cast<std::uint8_t>(probed_ ? probed_frame_ : 2);
  if (probed_) put32(&block[4], modeOf(probed_frame_).interval);
  if (setup.request == 0x83) block[3] = 2, put32(&block[4], 62500);
  put32(&block[18], 721920);
  put32(&block[22], 16384);
  const int count = std::min<int>(setup.length, 26);
  std::copy_n(block.begin(), count, data);
  return count;
}

int EmulatedLeap::unitRequest(const Setup& setup, std::uint8_t* data) {
  const auto unit = static_cast<std::uint8_t>(setup.index >> 8);
  const auto selector = static_cast<std::uint8_t>(setup.value >> 8);
  static const std::vector<int> of_terminal = {0x04, 0x06, 0x0b};
  static const std::vector<int> of_processing = {0x02, 0x03, 0x04, 0x07, 0x08, 0x09, 0x0a};
  const auto& known = unit == 2 ? of_terminal : of_processing;
  if (std::find(known.begin(), known.end(), selector) == known.end()) return -EPIPE;
  const auto key = static_cast<std::uint16_t>(unit << 8 | selector);

  const auto give = [&](std::uint32_t value) {
    for (int i = 0; i < setup.length; ++i)
      data[i] = static_cast<std::uint8_t>(i < 4 ? value >> (8 * i) : 0);
    return static_cast<int>(setup.length);
  };
  const bool brightness = key == 0x0502;
  switch (setup.request) {
    case 0x86:
      return give(3);
    case 0x82:
      return brightness ? give(4) : -EPIPE;
    case 0x83:
      return brightness ? give(15) : -EPIPE;
    case 0x84:
      return brightness ? give(1) : -EPIPE;
    case 0x87:
      return brightness ? give(4) : -EPIPE;
    case 0x81:
      if (key != 0x0507) return give(registers_[key]);
      if (memory_disturbance_ > 0) {
        --memory_disturbance_;
        return give(static_cast<std::uint32_t>(~memory_[address_]) & 0xff);
      }
      return give(memory_[address_]);
    case 0x01: {
      if (setup.length < 1 || setup.length > 4) return -EPIPE;
      if (four_byte_controls_ && setup.length != 4) return -EPIPE;
      std::uint32_t value = 0;
      for (int i = 0; i < setup.length; ++i)
        value |= static_cast<std::uint32_t>(data[i]) << (8 * i);
      apply(unit, selector, value);
      return setup.length;
    }
    default:
      return -EPIPE;
  }
}

void EmulatedLeap::apply(std::uint8_t unit, std::uint8_t selector, std::uint32_t value) {
  const auto key = static_cast<std::uint16_t>(unit << 8 | selector);
  registers_[key] = value;
  switch (key) {
    case 0x020b:
      settings_.exposure_us = std::max<int>(10, static_cast<int>(value & 0xffff));
      break;
    case 0x0502:
      settings_.digital_gain = static_cast<int>(value);
      break;
    case 0x0504:
      settings_.analog_gain = static_cast<int>(value);
      break;
    case 0x0507:
      if (isMailbox(address_))
        memory_[address_] = static_cast<std::uint8_t>(value);
      else
        forbidden_.push_back("memory written at " + std::to_string(address_));
      break;
    case 0x0508:
      address_ = static_cast<std::uint8_t>(value);
      break;
    case 0x0509:
      settings_.gamma = value != 0;
      break;
    case 0x050a:
      settings_.dark_interval = static_cast<int>(value);
      break;
    case 0x0503: {
      const bool on = value >> 6;
      switch (value & 0x3f) {
        case 0:
          settings_.hdr = on;
          break;
        case 1:
          settings_.rotated = on;
          break;
        case 2:
        case 3:
        case 4:
          settings_.led[(value & 0x3f) - 2] = on;
          break;
        case 6:
          forbidden_.push_back("vertical zoom");
          if (on) crashed_ = true, streaming_ = false;
          break;
      }
      break;
    }
  }
}

void EmulatedLeap::powerOn() {
  const std::lock_guard<std::mutex> lock(mutex_);
  stop();
  settings_ = Settings();
  registers_ = {{0x020b, 200}, {0x0504, 16}, {0x0502, 4}, {0x0509, 1}};
  address_ = 0;
  probed_ = false;
  crashed_ = false;
  frames_begun_ = 0;
  power_on_ = Clock::now();
}

void EmulatedLeap::stopStreaming() {
  const std::lock_guard<std::mutex> lock(mutex_);
  stop();
}

void EmulatedLeap::clearHalt() {
  const std::lock_guard<std::mutex> lock(mutex_);
  halted_ = false;
}

void EmulatedLeap::reset() { powerOn(); }

void EmulatedLeap::haltAfter(int payloads) {
  const std::lock_guard<std::mutex> lock(mutex_);
  halt_after_ = payloads;
}

bool EmulatedLeap::halted() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return halted_;
}

void EmulatedLeap::stop() {
  streaming_ = false;
  halted_ = false;
  sent_ = 0;
  payload_number_ = 0;
  raster_.clear();
  buffer_.clear();
  frame_start_ = {};
}

void EmulatedLeap::beginFrame(Clock::time_point start) {
  frame_start_ = start;
  read_outs_[frames_begun_] = start;
  if (read_outs_.size() > kRememberedFrames) read_outs_.erase(read_outs_.begin());
  frame_.index = frames_begun_++;
  frame_.size = modeOf(probed_frame_).size;
  frame_.settings = settings_;
  const bool any_led = settings_.led[0] || settings_.led[1] || settings_.led[2];
  const bool dark = settings_.dark_interval == 1 ||
                    (settings_.dark_interval >= 2 &&
                     frame_.index % static_cast<std::uint32_t>(settings_.dark_interval) == 0);
  frame_.lit = any_led && !dark;
  raster_.resize(2 * static_cast<std::size_t>(frame_.size.area()));
  picture_(frame_, raster_.data());
  const Bytes metadata = metadataOf(frame_);
  std::copy(metadata.begin(), metadata.end(), raster_.end() - 12);
  sent_ = 0;
  payload_number_ = 0;
  frame_id_ = !frame_id_;
}

void EmulatedLeap::makePayload() {
  const std::size_t count = std::min<std::size_t>(kPixelBytes, raster_.size() - sent_);
  Payload payload;
  payload.frame = frame_.index;
  payload.number = payload_number_++;
  payload.last = sent_ + count == raster_.size();
  payload.bytes.assign(kHeaderBytes, 0);
  payload.bytes[0] = kHeaderBytes;
  payload.bytes[1] = static_cast<std::uint8_t>(0x8c | (frame_id_ ? 1 : 0) | (payload.last ? 2 : 0));
  const auto since = frame_start_ - power_on_;
  put32(&payload.bytes[2],
        static_cast<std::uint32_t>(
            std::chrono::duration_cast<std::chrono::milliseconds>(since).count()));
  const auto from = raster_.begin() + static_cast<std::ptrdiff_t>(sent_);
  payload.bytes.insert(payload.bytes.end(), from, from + static_cast<std::ptrdiff_t>(count));
  sent_ += count;

  std::vector<Bytes> out;
  if (tamper_)
    out = tamper_(payload);
  else
    out.push_back(std::move(payload.bytes));
  for (Bytes& bytes : out) {
    if (rate_ > 0 && buffer_.size() >= kDeviceBuffer)
      ++payloads_lost_;
    else
      buffer_.push_back(std::move(bytes));
  }
  if (halt_after_ >= 0 && halt_after_-- == 0) halted_ = true;
}

EmulatedLeap::Clock::time_point EmulatedLeap::produce(Clock::time_point now, bool host_waits) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!streaming_ || halted_) return now + kIdle;
  const Mode& mode = modeOf(probed_frame_);
  if (rate_ <= 0) {
    // Time still passes on the device's clock as if frames came at the nominal rate.
    while (host_waits && buffer_.empty() && !halted_) {
      if (sent_ == raster_.size())
        beginFrame(power_on_ + std::chrono::nanoseconds(100) * mode.interval * frames_begun_);
      makePayload();
    }
    return now + kIdle;
  }
  const int payloads = static_cast<int>((2 * mode.size.area() + kPixelBytes - 1) / kPixelBytes);
  auto period = std::chrono::nanoseconds(static_cast<std::int64_t>(100.0 * mode.interval / rate_));
  period = std::max(period, std::chrono::nanoseconds(settings_.exposure_us * 1000LL + 500000));
  if (frame_start_ == Clock::time_point()) frame_start_ = now - period;
  for (;;) {
    if (sent_ == raster_.size()) {
      const auto start = frame_start_ + period;
      if (now < start) return start;
      // Pictures that take long to render make a slow device, not one that hurries later.
      beginFrame(now - start > period ? now : start);
    }
    const auto due =
        frame_start_ + std::chrono::duration_cast<Clock::duration>(
                           period * (kReadOutShare * (payload_number_ + 1) / payloads));
    if (now < due) return due;
    // While the host waits, nothing is lost: if the emulation is late, that is not the host's
    // fault.
    if (host_waits && buffer_.size() >= kDeviceBuffer) return now;
    makePayload();
    if (halted_) return now + kIdle;
  }
}

std::optional<Bytes> EmulatedLeap::takePayload() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (buffer_.empty()) return std::nullopt;
  Bytes payload = std::move(buffer_.front());
  buffer_.pop_front();
  return payload;
}

EmulatedLeap::Settings EmulatedLeap::settings() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return settings_;
}
std::vector<EmulatedLeap::Request> EmulatedLeap::requests() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return requests_;
}
void EmulatedLeap::forgetRequests() {
  const std::lock_guard<std::mutex> lock(mutex_);
  requests_.clear();
}
std::vector<std::string> EmulatedLeap::forbidden() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return forbidden_;
}
bool EmulatedLeap::streaming() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return streaming_;
}
std::uint32_t EmulatedLeap::framesBegun() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return frames_begun_;
}
std::uint64_t EmulatedLeap::payloadsLost() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return payloads_lost_;
}
EmulatedLeap::Clock::time_point EmulatedLeap::readOutOf(std::uint32_t frame) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return read_outs_.at(frame);
}

void EmulatedLeap::noise(const Frame& frame, std::uint8_t* interleaved) {
  const auto bytes = 2 * static_cast<std::size_t>(frame.size.area());
  const Bytes& table = noiseTable();
  const std::size_t room = table.size() - bytes;
  std::memcpy(interleaved, &table[frame.index * 4099ULL % room], bytes);
  for (int i = 0; i < 4; ++i)
    interleaved[2 * i] = static_cast<std::uint8_t>(frame.index >> (8 * i));
}

std::uint32_t EmulatedLeap::numberInNoise(const cv::Mat& left) { return get32(left.data); }

Bytes EmulatedLeap::metadataOf(const Frame& frame) {
  const int exposure = frame.settings.exposure_us, gain = frame.settings.analog_gain;
  const int label1 = frame.lit ? 1 : 0;
  const int samples[6] = {0x78,       0, 0, label1 << 4 | (exposure >> 5 & 0x0f), exposure & 0x1f,
                          gain & 0x1f};
  Bytes bytes;
  for (const int sample : samples) bytes.insert(bytes.end(), 2, static_cast<std::uint8_t>(sample));
  return bytes;
}

}  // namespace leap_object_tracker
