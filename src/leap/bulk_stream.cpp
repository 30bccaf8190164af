#include "leap_object_tracker/leap/bulk_stream.hpp"

#include <libusb-1.0/libusb.h>
#include <pthread.h>

#include <algorithm>

namespace leap_object_tracker {
namespace {

constexpr int kFewestTransfers = 4;
constexpr int kMostFailuresInRow = 50;
constexpr std::chrono::milliseconds kPauseAfterError{5};
constexpr std::chrono::microseconds kRest{1000};
constexpr std::chrono::seconds kDrainTimeout{2};
constexpr int kPriority = 10;  // of real-time threads

timeval toTimeval(std::chrono::microseconds duration) {
  return {duration.count() / 1000000, duration.count() % 1000000};
}

/// Lets a thread go first, where the user may do that: pictures are lost if it comes late.
void hurry(std::thread& thread) {
  sched_param priority{};
  priority.sched_priority = kPriority;
  pthread_setschedparam(thread.native_handle(), SCHED_FIFO, &priority);
}

void handleEvents(libusb_context* context, std::chrono::microseconds timeout) {
  timeval wait = toTimeval(timeout);
  const int code = libusb_handle_events_timeout_completed(context, &wait, nullptr);
  const bool did_not_wait = code != LIBUSB_SUCCESS && code != LIBUSB_ERROR_INTERRUPTED;
  if (did_not_wait) std::this_thread::sleep_for(kPauseAfterError);
}

}  // namespace

struct BulkStream::Transfer {
  Transfer(BulkStream& owner, std::size_t bytes)
      : stream(owner), buffer(bytes), usb(libusb_alloc_transfer(0)) {}
  ~Transfer() { libusb_free_transfer(usb); }

  BulkStream& stream;
  std::vector<std::uint8_t> buffer;
  libusb_transfer* usb;
  bool in_flight = false;
};

BulkStream::BulkStream(UsbLink& link, std::uint8_t endpoint, int transfers,
                       std::size_t transfer_bytes, Consumer consumer)
    : link_(link), endpoint_(endpoint), consumer_(std::move(consumer)) {
  int code = LIBUSB_SUCCESS;
  for (int i = 0; i < transfers && code == LIBUSB_SUCCESS; ++i) {
    transfers_.push_back(std::make_unique<Transfer>(*this, transfer_bytes));
    Transfer& transfer = *transfers_.back();
    libusb_fill_bulk_transfer(transfer.usb, link.handle(), endpoint, transfer.buffer.data(),
                              static_cast<int>(transfer_bytes), &BulkStream::completed, &transfer,
                              0);
    code = libusb_submit_transfer(transfer.usb);
    transfer.in_flight = code == LIBUSB_SUCCESS;
    in_flight_ += transfer.in_flight;
  }
  if (in_flight_ < std::min(transfers, kFewestTransfers)) {
    stopping_ = true;
    drain();
    link.fail(code,
              "asking for pictures (memory for USB transfers: "
              "/sys/module/usbcore/parameters/usbfs_memory_mb)");
  }
  thread_ = std::thread([this] { run(); });
  pthread_setname_np(thread_.native_handle(), "leap_usb");
  hurry(thread_);
}

BulkStream::~BulkStream() {
  stopping_ = true;
  libusb_interrupt_event_handler(link_.context().get());
  thread_.join();
}

BulkStreamCounters BulkStream::counters() const { return {payloads_, errors_, halts_}; }

void LIBUSB_CALL BulkStream::completed(libusb_transfer* usb) {
  Transfer& transfer = *static_cast<Transfer*>(usb->user_data);
  transfer.stream.complete(transfer);
}

void BulkStream::complete(Transfer& transfer) {
  const Arrival arrival = Arrival::clock::now();
  const std::lock_guard<std::mutex> lock(mutex_);
  transfer.in_flight = false;
  --in_flight_;
  const libusb_transfer& usb = *transfer.usb;
  switch (usb.status) {
    case LIBUSB_TRANSFER_COMPLETED:
    case LIBUSB_TRANSFER_TIMED_OUT:
      failures_in_row_ = 0;
      ++payloads_;
      consumer_.payload(ByteView(usb.buffer, static_cast<std::size_t>(usb.actual_length)), arrival);
      submit(transfer);
      return;
    case LIBUSB_TRANSFER_NO_DEVICE:
      unplugged_ = true;
      return;
    case LIBUSB_TRANSFER_CANCELLED:
      return;
    case LIBUSB_TRANSFER_STALL:
      halted_ = true;
      return;
    case LIBUSB_TRANSFER_OVERFLOW:
      ++errors_;
      submit(transfer);
      return;
    case LIBUSB_TRANSFER_ERROR:
      failedOnce();
      return;
  }
}

void BulkStream::failedOnce() {
  ++errors_;
  ++failures_in_row_;
  retry_at_ = Arrival::clock::now() + kPauseAfterError * std::min(failures_in_row_, 10);
}

/// A refused submission may be the only sign of an unplugged device.
void BulkStream::submit(Transfer& transfer) {
  if (stopping_ || unplugged_ || halted_) return;
  const int code = libusb_submit_transfer(transfer.usb);
  if (code == LIBUSB_SUCCESS) {
    transfer.in_flight = true;
    ++in_flight_;
  } else if (code == LIBUSB_ERROR_NO_DEVICE) {
    unplugged_ = true;
  } else {
    failedOnce();
  }
}

void BulkStream::run() {
  while (!stopping_ && !unplugged_ && !failed_) {
    const std::uint64_t before = payloads_;
    handleEvents(link_.context().get(),
                 allInFlight() ? std::chrono::milliseconds(100) : kPauseAfterError);
    recover();
    // Several payloads are fetched at one waking; the transfers in flight last far longer.
    if (payloads_ != before) std::this_thread::sleep_for(kRest);
  }
  drain();
  // Control requests and hot-plug messages still want to be served.
  while (!stopping_) handleEvents(link_.context().get(), std::chrono::milliseconds(100));
}

/// Puts transfers that ended in an error back to work, and clears a halt once all have returned.
void BulkStream::recover() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (stopping_ || unplugged_) return;
  if (failures_in_row_ > kMostFailuresInRow) {
    failed_ = true;
    return;
  }
  if (halted_) {
    if (in_flight_ > 0) {
      cancelAll();
      return;
    }
    ++halts_;
    ++failures_in_row_;
    link_.clearHalt(endpoint_);
    consumer_.interrupted();
    halted_ = false;
  }
  if (Arrival::clock::now() < retry_at_) return;
  for (const auto& transfer : transfers_)
    if (!transfer->in_flight) submit(*transfer);
}

bool BulkStream::allInFlight() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return in_flight_ == static_cast<int>(transfers_.size());
}

void BulkStream::cancelAll() {
  for (const auto& transfer : transfers_)
    if (transfer->in_flight) libusb_cancel_transfer(transfer->usb);
}

void BulkStream::drain() {
  const auto left = [this] {
    const std::lock_guard<std::mutex> lock(mutex_);
    cancelAll();
    return in_flight_;
  };
  const auto deadline = std::chrono::steady_clock::now() + kDrainTimeout;
  while (left() > 0 && std::chrono::steady_clock::now() < deadline)
    handleEvents(link_.context().get(), std::chrono::milliseconds(50));
  // The kernel lets go of what is left when the device file is closed; until then the buffers must
  // stay.
  const std::lock_guard<std::mutex> lock(mutex_);
  for (auto& transfer : transfers_)
    if (transfer->in_flight) transfer.release();
}

}  // namespace leap_object_tracker
