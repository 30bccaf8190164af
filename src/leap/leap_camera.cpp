#include "leap_object_tracker/leap/leap_camera.hpp"

#include <libusb-1.0/libusb.h>

#include <algorithm>

namespace leap_object_tracker {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds kLookAgain{200};  // for one that is absent
constexpr milliseconds kTryAgain{1000};  // one that refused
constexpr milliseconds kTryLockedAgain{5000};
constexpr std::chrono::seconds kUnrest{30};
constexpr std::size_t kManyDisconnections = 3;

milliseconds pauseAfter(LeapFault fault) {
  switch (fault) {
    case LeapFault::kAbsent:
    case LeapFault::kUnplugged:
    case LeapFault::kStalled:
      return kLookAgain;
    case LeapFault::kLockedFirmware:
      return kTryLockedAgain;
    default:
      return kTryAgain;
  }
}

LeapCounters sum(const LeapCounters& a, const LeapCounters& b) {
  LeapCounters s = a;
  s.frames.good += b.frames.good;
  s.frames.torn += b.frames.torn;
  s.frames.lost_end += b.frames.lost_end;
  s.frames.error_bit += b.frames.error_bit;
  s.frames.empty_transfers += b.frames.empty_transfers;
  s.frames.bad_headers += b.frames.bad_headers;
  s.frames.repeated_payloads += b.frames.repeated_payloads;
  s.transfers.payloads += b.transfers.payloads;
  s.transfers.errors += b.transfers.errors;
  s.transfers.halts += b.transfers.halts;
  s.dropped += b.dropped;
  s.missing += b.missing;
  return s;
}

}  // namespace

LeapCamera::LeapCamera(const LeapCameraParams& params)
    : params_(params), next_attempt_(Clock::now()) {}

LeapCamera::~LeapCamera() = default;

std::optional<LeapFrame> LeapCamera::grab(milliseconds timeout) {
  try {
    if (!device_) {
      const auto pause = std::chrono::duration_cast<milliseconds>(next_attempt_ - Clock::now());
      if (pause.count() > 0) {
        // Messages about devices that come and go are read here while no stream does it.
        const milliseconds wait = std::min(pause, timeout);
        timeval limit = {wait.count() / 1000, wait.count() % 1000 * 1000};
        libusb_handle_events_timeout_completed(context_.get(), &limit, nullptr);
        return std::nullopt;
      }
      connect();
    }
    applyControls();
    std::optional<LeapFrame> frame = device_->grab(timeout);
    publishStatus();
    return frame;
  } catch (const LeapError& error) {
    disconnect(error);
    return std::nullopt;
  }
}

void LeapCamera::connect() {
  auto device = std::make_unique<LeapDevice>(context_, params_.serial, reset_next_);
  reset_next_ = false;
  device->start(params_.stream, controls());
  device_ = std::move(device);
}

void LeapCamera::disconnect(const LeapError& error) {
  if (device_) earlier_ = sum(earlier_, device_->counters());
  device_.reset();
  reset_next_ = error.fault() == LeapFault::kStalled;
  next_attempt_ = Clock::now() + pauseAfter(error.fault());

  std::string message = error.what();
  if (error.fault() == LeapFault::kUnplugged) disconnections_.push_back(Clock::now());
  while (!disconnections_.empty() && Clock::now() - disconnections_.front() > kUnrest)
    disconnections_.pop_front();
  if (disconnections_.size() >= kManyDisconnections)
    message +=
        "; it left the bus several times within half a minute, which looks like too little "
        "power: use another port, a shorter cable or a powered hub";

  const std::lock_guard<std::mutex> lock(mutex_);
  status_.state = LeapState::kWaiting;
  status_.message = message;
  status_.counters = earlier_;
}

void LeapCamera::applyControls() {
  const LeapControls wanted = controls();
  if (wanted != device_->controls()) device_->setControls(wanted);
}

void LeapCamera::publishStatus() {
  const LeapCounters counters = sum(earlier_, device_->counters());
  const std::lock_guard<std::mutex> lock(mutex_);
  status_.counters = counters;
  const bool pictures_flow = counters.frames.good > earlier_.frames.good;
  if (status_.state == LeapState::kStreaming || !pictures_flow) return;
  status_.state = LeapState::kStreaming;
  status_.identity = device_->identity();
  status_.message = "Leap " + status_.identity.serial + " at " + status_.identity.location +
                    " streams " + leapModeInfo(params_.stream.mode).name;
  ++status_.connections;
}

void LeapCamera::setControls(const LeapControls& wanted) {
  const std::lock_guard<std::mutex> lock(mutex_);
  wanted_ = clamped(wanted);
}

LeapControls LeapCamera::controls() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return wanted_;
}

LeapStatus LeapCamera::status() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return status_;
}

}  // namespace leap_object_tracker
