#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

#include "leap_object_tracker/leap/frame_assembler.hpp"
#include "leap_object_tracker/leap/usb_link.hpp"

struct libusb_transfer;

namespace leap_object_tracker {

struct BulkStreamCounters {
  std::uint64_t payloads = 0;
  std::uint64_t errors = 0;  ///< transfers that ended with an error or an overflow
  std::uint64_t halts = 0;   ///< times that the endpoint was halted
};

/// Keeps bulk transfers in flight and hands over what they bring, on a thread of its own that also
/// serves all other events of the USB session. That thread must not be held up.
class BulkStream {
 public:
  struct Consumer {
    std::function<void(ByteView, Arrival)> payload;
    std::function<void()> interrupted;  ///< bytes between the last payload and the next are lost
  };

  /// @throw LeapError when the kernel takes no transfer
  BulkStream(UsbLink& link, std::uint8_t endpoint, int transfers, std::size_t transfer_bytes,
             Consumer consumer);
  /// Cancels what is in flight and waits for it.
  ~BulkStream();
  BulkStream(const BulkStream&) = delete;
  BulkStream& operator=(const BulkStream&) = delete;

  /// The device is gone.
  bool unplugged() const { return unplugged_; }
  /// Errors did not stop; only closing and opening again can help.
  bool failed() const { return failed_; }
  BulkStreamCounters counters() const;

 private:
  struct Transfer;

  static void completed(libusb_transfer* transfer);
  void complete(Transfer& transfer);
  void submit(Transfer& transfer);
  void failedOnce();
  void run();
  void recover();
  bool allInFlight();
  void cancelAll();
  void drain();

  UsbLink& link_;
  std::uint8_t endpoint_;
  Consumer consumer_;
  std::vector<std::unique_ptr<Transfer>> transfers_;

  std::atomic<bool> stopping_{false};
  std::atomic<bool> unplugged_{false};
  std::atomic<bool> failed_{false};
  std::atomic<std::uint64_t> payloads_{0};
  std::atomic<std::uint64_t> errors_{0};
  std::atomic<std::uint64_t> halts_{0};

  /// Guards what follows: a thread that waits for a control request serves events as well.
  std::mutex mutex_;
  int in_flight_ = 0;
  int failures_in_row_ = 0;
  bool halted_ = false;
  Arrival retry_at_;

  std::thread thread_;
};

}  // namespace leap_object_tracker
