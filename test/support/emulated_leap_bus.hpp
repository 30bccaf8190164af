#pragma once

#include <memory>
#include <string>

#include "emulated_leap.hpp"
#include "emulated_leap_usbfs.hpp"

struct _UMockdevTestbed;

namespace leap_object_tracker {

/// A USB bus in a sandbox of umockdev, seen by libusb and libudev of this process alone. Make it
/// before a libusb session and let it outlive that; one at a time. Needs LD_PRELOAD of
/// libumockdev-preload and emulated_leap_syscalls.cpp in the program.
class EmulatedBus {
 public:
  EmulatedBus();
  ~EmulatedBus();
  EmulatedBus(const EmulatedBus&) = delete;
  EmulatedBus& operator=(const EmulatedBus&) = delete;

  /// A place where a Leap can be plugged in.
  class Port {
   public:
    Port(EmulatedBus& bus, int number) : bus_(bus), number_(number) {}
    ~Port();

    /// @param announce whether udev tells of it
    void plug(EmulatedLeap& leap, bool announce = true);
    void unplug(bool announce = true);
    bool occupied() const { return occupied_; }
    /// Of the present or the last device in here.
    EmulatedUsbfs& usbfs() { return *usbfs_; }
    /// Opening the device file fails with EACCES.
    void denyAccess();
    /// From the next plug() on: 12 Mbit/s.
    void setSlowLink(bool slow) { slow_ = slow; }

   private:
    void setReadable(bool readable);

    EmulatedBus& bus_;
    int number_;
    bool slow_ = false;
    bool occupied_ = false;
    std::string system_path_;
    std::string device_file_;
    std::mutex fifo_mutex_;
    int fifo_ = -1;
    std::shared_ptr<EmulatedUsbfs> usbfs_;
  };

  Port& port(int number);

 private:
  _UMockdevTestbed* testbed_;
  std::string root_;
  int next_address_ = 2;
  std::map<int, std::unique_ptr<Port>> ports_;
};

/// Starts the program again with umockdev's library loaded first, if it is not. Call it first in
/// main().
void restartWithUmockdev(char** arguments);

}  // namespace leap_object_tracker
