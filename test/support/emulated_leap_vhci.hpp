#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <thread>

#include "emulated_leap.hpp"

namespace leap_object_tracker {

/// Attaches an emulated Leap to this computer's own kernel: the driver vhci_hcd gets one end of a
/// socket, and the other end speaks USB/IP (Documentation/usb/usbip_protocol.rst) here. Needs root
/// and the module vhci-hcd.
class EmulatedVhci {
 public:
  ~EmulatedVhci();

  /// @throw std::runtime_error if the kernel does not take it
  void plug(EmulatedLeap& leap);
  void unplug();

 private:
  struct Request {
    std::uint32_t number = 0;
    std::uint32_t flags = 0;
    std::uint32_t length = 0;
    bool in = false;
    Bytes data;
    std::size_t filled = 0;
  };

  bool receive(void* bytes, std::size_t count);
  void send(const Bytes& message);
  void reply(const Request& request, int status);
  void readRequests();
  void answerControl(Request& request, const std::uint8_t* setup);
  void unlink(std::uint32_t number, std::uint32_t victim);
  void serveBulk();
  bool fill(Request& request);

  EmulatedLeap* leap_ = nullptr;
  int socket_ = -1;
  std::mutex send_mutex_;
  std::mutex mutex_;  ///< guards what follows:
  std::condition_variable changed_;
  std::deque<Request> waiting_;
  std::deque<std::uint32_t> unanswered_;
  Bytes current_;
  std::size_t current_taken_ = 0;
  bool stop_ = false;
  std::thread reader_;
  std::thread server_;
};

}  // namespace leap_object_tracker
