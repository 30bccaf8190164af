#pragma once

#include <chrono>
#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/leap/bulk_stream.hpp"
#include "leap_object_tracker/leap/clock_filter.hpp"
#include "leap_object_tracker/leap/control_history.hpp"
#include "leap_object_tracker/leap/frame_assembler.hpp"
#include "leap_object_tracker/leap/leap_protocol.hpp"
#include "leap_object_tracker/leap/usb_link.hpp"

namespace leap_object_tracker {

/// One stereo pair and what is known about it.
struct LeapFrame {
  RawStereoFrame images;
  std::shared_ptr<void> owner;  ///< as given by the FrameBufferSource
  FrameMetadata metadata;
  LeapControls taken_with;      ///< settings in force during the exposure
  std::uint32_t device_ms = 0;  ///< clock of the device [ms]
  double transport = 0;         ///< [s] from the stamp until the last byte was there
};

/// What a device says of itself.
struct LeapIdentity {
  std::string location;                   ///< on the bus
  std::string serial;                     ///< from the device's memory; empty if unreadable
  std::vector<std::uint8_t> firmware;     ///< memory bytes 0x60 to 0x63, of which the last two look
                                          ///< like a version
  std::vector<std::uint8_t> calibration;  ///< 156 bytes; empty if never read with a good checksum
  LeapLayout layout;
};

struct LeapCounters {
  AssemblerCounters frames;
  BulkStreamCounters transfers;
  std::uint64_t dropped = 0;  ///< whole frames that were not fetched in time
  std::uint64_t missing = 0;  ///< frames that the device's clock says should have come
};

struct LeapStreamParams {
  LeapMode mode = LeapMode::k640x240;
  int transfers = 32;         ///< in flight; each holds about 0.47 ms of pictures
  int queue = 2;              ///< whole frames that wait for grab(); the oldest is dropped
  double stamp_offset = 0;    ///< [s] added to each stamp
  FrameBufferSource buffers;  ///< where frames go; allocates if empty
};

/// One Leap Motion on the USB bus, open from construction to destruction.
///
/// While it streams it owns one thread, which serves USB and puts frames together; grab() hands
/// them over. All other functions are for one thread at a time.
class LeapDevice {
 public:
  /// Opens the first Leap that can be had.
  /// @param serial empty: any
  /// @param reset whether to reset the device first, which cures some that stopped sending
  /// @throw LeapError
  LeapDevice(UsbContext& context, const std::string& serial, bool reset = false);
  ~LeapDevice();

  const LeapIdentity& identity() const { return identity_; }

  /// Writes all controls and starts pictures. @throw LeapError
  void start(const LeapStreamParams& params, const LeapControls& controls);

  /// @return the next frame, or nullopt after `timeout` without one
  /// @throw LeapError when it is unplugged, was never going to send, or stopped sending
  std::optional<LeapFrame> grab(std::chrono::milliseconds timeout);

  /// Sends what differs from the settings before. @throw LeapError
  void setControls(const LeapControls& controls);
  const LeapControls& controls() const { return controls_; }

  LeapCounters counters() const;

 private:
  struct WaitingFrame {
    AssembledFrame frame;
    double begin = 0;  ///< [s] arrival without delays, on the steady clock
    double end = 0;    ///< [s] arrival of the last payload, on the same
  };

  std::vector<std::uint8_t> readMemory(int first, int count, std::chrono::milliseconds pause);
  std::string readSerial();
  void readIdentity();
  void write(const LeapControlWrite& write);
  void writeAll();
  void negotiate(LeapMode mode);
  void receive(ByteView payload, Arrival arrival);
  void countMissing(const AssembledFrame& frame);
  [[noreturn]] void explainSilence();
  LeapFrame finished(WaitingFrame&& waiting);

  std::unique_ptr<UsbLink> link_;
  LeapIdentity identity_;
  LeapStreamParams params_;
  LeapControls controls_;
  ControlHistory history_;
  std::size_t transfer_bytes_ = 0;
  double first_payload_time_ = 0;  ///< [s] from the start of read-out to the first whole payload
  Stamp last_stamp_;
  std::chrono::steady_clock::time_point last_sign_;  ///< of pictures
  bool first_frame_seen_ = false;

  mutable std::mutex mutex_;  ///< guards what both threads use:
  std::condition_variable frame_came_;
  std::optional<FrameAssembler> assembler_;
  std::optional<ClockFilter> clock_;
  std::deque<WaitingFrame> waiting_;
  std::optional<std::uint32_t> last_device_ms_;
  std::uint64_t dropped_ = 0;
  std::uint64_t missing_ = 0;

  std::unique_ptr<BulkStream> stream_;
};

}  // namespace leap_object_tracker
