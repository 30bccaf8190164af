#pragma once

#include <linux/usbdevice_fs.h>

#include <condition_variable>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <thread>

#include "emulated_leap.hpp"

namespace leap_object_tracker {

/// The device file of one plugged-in Leap as the kernel's usbfs would serve it
/// (drivers/usb/core/devio.c): what ioctl() does, and a thread in the place of the host controller.
class EmulatedUsbfs {
 public:
  using Clock = EmulatedLeap::Clock;

  /// @param readable called with whether a finished request waits to be fetched
  EmulatedUsbfs(EmulatedLeap& leap, std::function<void(bool)> readable);
  ~EmulatedUsbfs();

  /// @return what the system call returns, or -errno
  int ioctl(unsigned long request, void* argument);
  void closed();
  bool gone() const;

  // The person with the device in hand.
  void unplug();
  /// Another program has claimed the interfaces.
  void setHeldByOther(bool held);
  /// uvcvideo is bound to the interfaces.
  bool kernelDriverBound() const;
  /// Finished requests become visible only after this time from now, in order.
  void setDelay(std::function<Clock::duration()> delay);
  /// The next bulk requests end with -errno.
  void failTransfers(int error, int count);
  void setFastLink(bool fast);

  struct Leftovers {
    int requests = 0;
    int claims = 0;
    int closes = 0;
  };
  Leftovers leftovers() const;
  int pendingTransfers() const;

 private:
  struct Urb {
    usbdevfs_urb* user;
    unsigned char type;
    unsigned flags;
    void* buffer;
    Bytes data;
    std::size_t filled = 0;
    int status = 0;
    Clock::time_point visible;
  };
  using UrbPtr = std::shared_ptr<Urb>;

  int claim(unsigned number);
  int submit(usbdevfs_urb* user);
  int submitControl(const UrbPtr& urb);
  int reap(std::unique_lock<std::mutex>& lock, bool wait, void* argument);
  int discard(void* user);
  void finish(const UrbPtr& urb, int status);
  void show();
  void serve();
  bool fill(Urb& urb);

  EmulatedLeap& leap_;
  std::function<void(bool)> readable_;

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::deque<UrbPtr> bulk_;      ///< waiting for the device
  std::deque<UrbPtr> silent_;    ///< control requests that the device does not answer
  std::deque<UrbPtr> finished_;  ///< not visible yet
  std::deque<UrbPtr> visible_;
  std::set<unsigned> claimed_;
  std::set<unsigned> bound_ = {0, 1};
  std::function<Clock::duration()> delay_;
  Bytes current_;
  std::size_t current_taken_ = 0;
  bool held_by_other_ = false;
  bool fast_ = true;
  bool gone_ = false;
  bool stop_ = false;
  bool refuse_continuations_ = false;
  int failing_transfers_ = 0;
  int failure_ = 0;
  std::size_t memory_used_ = 0;
  Leftovers leftovers_;
  std::thread thread_;
};

/// Device files that the system calls of this process are answered for.
class EmulatedFiles {
 public:
  static EmulatedFiles& instance();
  void add(int fd, const std::shared_ptr<EmulatedUsbfs>& device);
  std::shared_ptr<EmulatedUsbfs> find(int fd);
  /// Opening a path that ends like this fails with EACCES.
  void deny(const std::string& path_end);
  void allowAll();
  bool isDenied(const char* path);

  /// Adds up the CPU time of all threads that is spent for the emulation instead of in the driver,
  /// from its construction to its destruction. Does nothing until metering is switched on.
  class Meter {
   public:
    Meter();
    ~Meter();

   private:
    std::int64_t start_ = 0;  ///< [ns]
  };
  void setMetered(bool metered) { metered_ = metered; }
  double meteredSeconds() const { return 1e-9 * static_cast<double>(metered_nanoseconds_); }

 private:
  std::mutex mutex_;
  std::map<std::pair<unsigned long, unsigned long>, std::weak_ptr<EmulatedUsbfs>> devices_;
  std::set<std::string> denied_;
  std::atomic<bool> metered_{false};
  std::atomic<std::int64_t> metered_nanoseconds_{0};
};

}  // namespace leap_object_tracker
