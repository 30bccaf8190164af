#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <mutex>
#include <opencv2/core.hpp>
#include <optional>
#include <string>
#include <vector>

#include "emulated_leap_calibration.hpp"

namespace leap_object_tracker {

/// The Leap Motion of firmware 1.7.1 as a state machine: descriptors, controls, memory, and a
/// stream of payloads. Knows nothing of how it is attached. All functions may be called from any
/// thread.
class EmulatedLeap {
 public:
  using Clock = std::chrono::steady_clock;

  struct Setup {
    std::uint8_t type, request;
    std::uint16_t value, index, length;

    /// Reads the 8 bytes of a setup packet (USB 2.0, table 9-2).
    static Setup fromBytes(const std::uint8_t* bytes);
  };
  struct Request {
    Setup setup;
    Bytes data;  ///< of writes
  };

  /// What controls were set to, as pictures depend on it.
  struct Settings {
    int exposure_us = 200;
    int analog_gain = 16;
    int digital_gain = 4;
    bool gamma = true;
    bool hdr = false;
    bool rotated = false;
    bool led[3] = {true, true, true};
    int dark_interval = 0;
  };

  struct Frame {
    std::uint32_t index = 0;
    cv::Size size;
    Settings settings;
    bool lit = true;
  };
  /// Fills 2 * width * height bytes, left and right pixel in turn.
  using Picture = std::function<void(const Frame&, std::uint8_t*)>;

  struct Payload {
    Bytes bytes;
    std::uint32_t frame = 0;
    int number = 0;
    bool last = false;
  };
  /// What comes out of the device instead of a payload: nothing, it, several, or something else. An
  /// empty one is a transfer of length zero.
  using Tamper = std::function<std::vector<Bytes>(const Payload&)>;

  enum class ControlBehaviour { kNormal, kStall, kShort, kGarbage, kSilent };

  EmulatedLeap();

  // The person with the device in hand; before plugging in, or while it runs.
  void setSerial(const std::string& serial);
  void setCalibration(const Bytes& calibration);
  /// Reads of the memory give wrong bytes for this many addresses first.
  void disturbMemory(int reads);
  void setLocked(bool locked);
  void setPicture(Picture picture);
  void setTamper(Tamper tamper);
  void setControlBehaviour(ControlBehaviour behaviour);
  /// Real rate as a share of the nominal one; 0: as fast as the host asks.
  void setRate(double share);
  bool hasRate() const;
  void setFourByteControls(bool only);
  /// As firmware that stops by itself.
  void stopStreaming();

  // The host's side.
  static Bytes deviceDescriptor();
  static Bytes configurationDescriptor();
  static constexpr std::uint8_t kEndpoint = 0x83;
  static constexpr int kNoReply = -1000;
  /// @return bytes moved, -errno, or kNoReply
  int control(const Setup& setup, std::uint8_t* data);
  void powerOn();
  void clearHalt();
  void reset();
  /// Halts the endpoint after so many more payloads.
  void haltAfter(int payloads);
  bool halted() const;

  /// Puts what is due into the device's buffer; what does not fit is lost.
  /// @return when to call again
  Clock::time_point produce(Clock::time_point now, bool host_waits);
  std::optional<Bytes> takePayload();

  // For assertions.
  Settings settings() const;
  std::vector<Request> requests() const;
  void forgetRequests();
  /// Requests that harm a real device.
  std::vector<std::string> forbidden() const;
  bool streaming() const;
  std::uint32_t framesBegun() const;
  std::uint64_t payloadsLost() const;
  /// Start of a frame's read-out.
  Clock::time_point readOutOf(std::uint32_t frame) const;

  /// A picture that differs in each frame and holds its number; its last samples are metadata.
  static void noise(const Frame& frame, std::uint8_t* interleaved);
  static std::uint32_t numberInNoise(const cv::Mat& left);
  static Bytes metadataOf(const Frame& frame);

 private:
  int classRequest(const Setup& setup, std::uint8_t* data);
  int probeRequest(const Setup& setup, std::uint8_t* data);
  int unitRequest(const Setup& setup, std::uint8_t* data);
  void apply(std::uint8_t unit, std::uint8_t selector, std::uint32_t value);
  void stop();
  void beginFrame(Clock::time_point start);
  void makePayload();

  mutable std::mutex mutex_;
  Bytes memory_;
  int memory_disturbance_ = 0;
  bool locked_ = false;
  bool crashed_ = false;
  bool four_byte_controls_ = false;
  double rate_ = 0;
  ControlBehaviour behaviour_ = ControlBehaviour::kNormal;
  Picture picture_;
  Tamper tamper_;

  Settings settings_;
  std::map<std::uint16_t, std::uint32_t> registers_;
  std::uint8_t address_ = 0;
  bool probed_ = false;
  int probed_frame_ = 4;
  Clock::time_point power_on_;

  bool streaming_ = false;
  bool halted_ = false;
  int halt_after_ = -1;
  bool frame_id_ = false;
  Frame frame_;
  Bytes raster_;
  std::size_t sent_ = 0;
  int payload_number_ = 0;
  Clock::time_point frame_start_;
  Clock::duration period_{};
  std::deque<Bytes> buffer_;
  std::uint64_t payloads_lost_ = 0;
  std::uint32_t frames_begun_ = 0;
  std::map<std::uint32_t, Clock::time_point> read_outs_;

  std::vector<Request> requests_;
  std::vector<std::string> forbidden_;
};

}  // namespace leap_object_tracker
