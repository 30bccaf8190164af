#pragma once

#include <chrono>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "leap_object_tracker/leap/leap_device.hpp"

namespace leap_object_tracker {

struct LeapCameraParams {
  std::string serial;  ///< empty: the first Leap that can be had
  LeapStreamParams stream;
};

enum class LeapState { kWaiting, kStreaming };

/// How the camera fares.
struct LeapStatus {
  LeapState state = LeapState::kWaiting;
  std::string message;    ///< why it waits, and what to do; changes only with the reason
  LeapIdentity identity;  ///< of the present or last device
  LeapCounters counters;  ///< of all connections together
  int connections = 0;    ///< since construction
};

/// A Leap that may come and go: waits for it, sets it up, and does so again after it was unplugged
/// or stopped, with the same settings.
class LeapCamera {
 public:
  /// @throw LeapError only if there is no USB at all
  explicit LeapCamera(const LeapCameraParams& params);
  ~LeapCamera();

  /// Call it in a loop from one thread; all work on the bus is done in here.
  /// @return the next frame, or nullopt after about `timeout`
  std::optional<LeapFrame> grab(std::chrono::milliseconds timeout);

  /// Takes effect within the next grab() and stays for all later connections. From any thread.
  void setControls(const LeapControls& controls);
  LeapControls controls() const;

  /// From any thread.
  LeapStatus status() const;

 private:
  using Clock = std::chrono::steady_clock;

  void connect();
  void disconnect(const LeapError& error);
  void applyControls();
  void publishStatus();

  LeapCameraParams params_;
  UsbContext context_;
  std::unique_ptr<LeapDevice> device_;
  bool reset_next_ = false;
  Clock::time_point next_attempt_;
  std::deque<Clock::time_point> disconnections_;  ///< of the last half minute
  LeapCounters earlier_;                          ///< of connections before the present one

  mutable std::mutex mutex_;
  LeapControls wanted_;
  LeapStatus status_;
};

}  // namespace leap_object_tracker
