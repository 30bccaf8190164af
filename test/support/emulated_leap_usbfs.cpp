#include "emulated_leap_usbfs.hpp"

#include <pthread.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <time.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

namespace leap_object_tracker {
namespace {

constexpr std::size_t kMemoryLimit = 16u << 20;  // usbfs_memory_mb
constexpr std::size_t kPacket = 512;
constexpr unsigned kCapabilities =
    USBDEVFS_CAP_ZERO_PACKET | USBDEVFS_CAP_BULK_CONTINUATION | USBDEVFS_CAP_NO_PACKET_SIZE_LIM |
    USBDEVFS_CAP_BULK_SCATTER_GATHER | USBDEVFS_CAP_REAP_AFTER_DISCONNECT;
constexpr int kSetupBytes = 8;
constexpr int kHighSpeed = 3, kFullSpeed = 2;  // enum usb_device_speed

/// Of the calling thread.
std::int64_t cpuNanoseconds() {
  timespec time;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return time.tv_sec * 1000000000LL + time.tv_nsec;
}

}  // namespace

EmulatedUsbfs::EmulatedUsbfs(EmulatedLeap& leap, std::function<void(bool)> readable)
    : leap_(leap), readable_(std::move(readable)) {
  thread_ = std::thread([this] { serve(); });
  pthread_setname_np(thread_.native_handle(), "emulated_leap");
  if (!leap.hasRate()) return;
  // Hardware does not wait for the computer; only with rights.
  sched_param priority{};
  priority.sched_priority = 20;
  pthread_setschedparam(thread_.native_handle(), SCHED_FIFO, &priority);
}

EmulatedUsbfs::~EmulatedUsbfs() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

int EmulatedUsbfs::ioctl(unsigned long request, void* argument) {
  std::unique_lock<std::mutex> lock(mutex_);
  if (request == USBDEVFS_REAPURBNDELAY || request == USBDEVFS_REAPURB)
    return reap(lock, request == USBDEVFS_REAPURB, argument);
  if (gone_) return -ENODEV;
  switch (request) {
    case USBDEVFS_GET_CAPABILITIES:
      *static_cast<unsigned*>(argument) = kCapabilities;
      return 0;
    case USBDEVFS_GET_SPEED:
      return fast_ ? kHighSpeed : kFullSpeed;
    case USBDEVFS_CLAIMINTERFACE:
      return claim(*static_cast<unsigned*>(argument));
    case USBDEVFS_RELEASEINTERFACE:
      return claimed_.erase(*static_cast<unsigned*>(argument)) ? 0 : -EINVAL;
    case USBDEVFS_GETDRIVER: {
      auto* query = static_cast<usbdevfs_getdriver*>(argument);
      if (held_by_other_ || claimed_.count(query->interface))
        std::strcpy(query->driver, "usbfs");
      else if (bound_.count(query->interface))
        std::strcpy(query->driver, "uvcvideo");
      else
        return -ENODATA;
      return 0;
    }
    case USBDEVFS_IOCTL: {
      auto* inner = static_cast<usbdevfs_ioctl*>(argument);
      const auto number = static_cast<unsigned>(inner->ifno);
      if (inner->ioctl_code == static_cast<int>(USBDEVFS_DISCONNECT))
        return bound_.erase(number) ? 0 : -ENODATA;
      if (inner->ioctl_code == static_cast<int>(USBDEVFS_CONNECT)) {
        if (claimed_.count(number)) return -EBUSY;
        bound_.insert(number);
        return 1;
      }
      return -ENOTTY;
    }
    case USBDEVFS_DISCONNECT_CLAIM: {
      auto* both = static_cast<usbdevfs_disconnect_claim*>(argument);
      if (held_by_other_) return -EBUSY;
      bound_.erase(both->interface);
      return claim(both->interface);
    }
    case USBDEVFS_SETINTERFACE: {
      auto* setting = static_cast<usbdevfs_setinterface*>(argument);
      if (!claimed_.count(setting->interface)) return -EINVAL;
      current_.clear();
      current_taken_ = 0;
      leap_.stopStreaming();
      return 0;
    }
    case USBDEVFS_SETCONFIGURATION:
      return bound_.empty() && claimed_.empty() ? 0 : -EBUSY;
    case USBDEVFS_CLEAR_HALT:
      current_.clear();
      current_taken_ = 0;
      leap_.clearHalt();
      changed_.notify_all();
      return 0;
    case USBDEVFS_RESET:
      current_.clear();
      current_taken_ = 0;
      leap_.reset();
      return 0;
    case USBDEVFS_SUBMITURB:
      return submit(static_cast<usbdevfs_urb*>(argument));
    case USBDEVFS_DISCARDURB:
      return discard(argument);
    default:
      return -ENOTTY;
  }
}

int EmulatedUsbfs::claim(unsigned number) {
  if (number > 1) return -EINVAL;
  if (held_by_other_ || bound_.count(number)) return -EBUSY;
  claimed_.insert(number);
  return 0;
}

int EmulatedUsbfs::submit(usbdevfs_urb* user) {
  if (user->buffer_length < 0) return -EINVAL;
  const auto length = static_cast<std::size_t>(user->buffer_length);
  if (memory_used_ + length > kMemoryLimit) return -ENOMEM;
  auto urb = std::make_shared<Urb>();
  urb->user = user;
  urb->type = user->type;
  urb->flags = user->flags;
  urb->buffer = user->buffer;
  urb->data.resize(length);
  if (user->type == USBDEVFS_URB_TYPE_CONTROL) {
    if (length < kSetupBytes) return -EINVAL;
    std::memcpy(urb->data.data(), user->buffer, length);
    memory_used_ += length;
    return submitControl(urb);
  }
  if (user->type != USBDEVFS_URB_TYPE_BULK || user->endpoint != EmulatedLeap::kEndpoint)
    return -EINVAL;
  const bool continuation = user->flags & USBDEVFS_URB_BULK_CONTINUATION;
  if (!continuation)
    refuse_continuations_ = false;
  else if (refuse_continuations_)
    return -EREMOTEIO;
  memory_used_ += length;
  bulk_.push_back(urb);
  changed_.notify_all();
  return 0;
}

int EmulatedUsbfs::submitControl(const UrbPtr& urb) {
  const EmulatedLeap::Setup setup = EmulatedLeap::Setup::fromBytes(urb->data.data());
  const int result = leap_.control(setup, urb->data.data() + kSetupBytes);
  changed_.notify_all();
  if (result == EmulatedLeap::kNoReply) {
    silent_.push_back(urb);
    return 0;
  }
  urb->filled = result > 0 ? static_cast<std::size_t>(result) : 0;
  urb->visible = Clock::now();
  urb->status = result < 0 ? result : 0;
  visible_.push_back(urb);
  readable_(true);
  return 0;
}

int EmulatedUsbfs::reap(std::unique_lock<std::mutex>& lock, bool wait, void* argument) {
  while (wait && visible_.empty() && !gone_) changed_.wait(lock);
  if (visible_.empty()) return gone_ ? -ENODEV : -EAGAIN;
  const UrbPtr urb = visible_.front();
  visible_.pop_front();
  if (visible_.empty() && !gone_) readable_(false);
  memory_used_ -= urb->data.size();
  // Data goes to the program's memory now and not before, as in the kernel.
  if (urb->type == USBDEVFS_URB_TYPE_CONTROL)
    std::memcpy(static_cast<std::uint8_t*>(urb->buffer) + kSetupBytes,
                urb->data.data() + kSetupBytes, urb->filled);
  else
    std::memcpy(urb->buffer, urb->data.data(), urb->filled);
  urb->user->status = urb->status;
  urb->user->actual_length = static_cast<int>(urb->filled);
  *static_cast<void**>(argument) = urb->user;
  return 0;
}

int EmulatedUsbfs::discard(void* user) {
  for (auto* queue : {&bulk_, &silent_})
    for (auto urb = queue->begin(); urb != queue->end(); ++urb)
      if ((*urb)->user == user) {
        const UrbPtr found = *urb;
        queue->erase(urb);
        found->status = -ENOENT;
        visible_.push_back(found);
        readable_(true);
        changed_.notify_all();
        return 0;
      }
  return -EINVAL;
}

void EmulatedUsbfs::finish(const UrbPtr& urb, int status) {
  urb->status = status;
  urb->visible = Clock::now() + (delay_ ? delay_() : Clock::duration::zero());
  if (!finished_.empty()) urb->visible = std::max(urb->visible, finished_.back()->visible);
  finished_.push_back(urb);
}

/// Makes visible what has waited long enough.
void EmulatedUsbfs::show() {
  const auto now = Clock::now();
  bool any = false;
  while (!finished_.empty() && finished_.front()->visible <= now) {
    visible_.push_back(finished_.front());
    finished_.pop_front();
    any = true;
  }
  if (any) {
    readable_(true);
    changed_.notify_all();
  }
}

void EmulatedUsbfs::serve() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stop_ && !gone_) {
    auto wake = leap_.produce(Clock::now(), !bulk_.empty());
    while (!bulk_.empty()) {
      const UrbPtr urb = bulk_.front();
      int status = 0;
      if (failing_transfers_ > 0) {
        --failing_transfers_;
        status = failure_;
      } else if (leap_.halted()) {
        status = -EPIPE;
      } else if (!fill(*urb)) {
        break;
      } else if (urb->status < 0) {
        status = urb->status;
      }
      bulk_.pop_front();
      const bool is_short = urb->filled < urb->data.size();
      if (status == 0 && is_short && (urb->flags & USBDEVFS_URB_SHORT_NOT_OK)) status = -EREMOTEIO;
      finish(urb, status);
      const bool ends_chain =
          status < 0 && (urb->flags & (USBDEVFS_URB_BULK_CONTINUATION | USBDEVFS_URB_SHORT_NOT_OK));
      if (ends_chain) {
        while (!bulk_.empty() && (bulk_.front()->flags & USBDEVFS_URB_BULK_CONTINUATION)) {
          finish(bulk_.front(), -ECONNRESET);
          bulk_.pop_front();
        }
        refuse_continuations_ = bulk_.empty();
      }
    }
    show();
    if (!finished_.empty()) wake = std::min(wake, finished_.front()->visible);
    changed_.wait_until(lock, wake);
  }
}

/// @return whether the request is done
bool EmulatedUsbfs::fill(Urb& urb) {
  for (;;) {
    if (current_taken_ == current_.size()) {
      auto payload = leap_.takePayload();
      if (!payload) {
        leap_.produce(Clock::now(), true);
        payload = leap_.takePayload();
      }
      if (!payload) return false;
      current_ = std::move(*payload);
      current_taken_ = 0;
      if (current_.empty()) return true;
    }
    const std::size_t count =
        std::min(urb.data.size() - urb.filled, current_.size() - current_taken_);
    std::memcpy(urb.data.data() + urb.filled, current_.data() + current_taken_, count);
    urb.filled += count;
    current_taken_ += count;
    if (current_taken_ < current_.size()) {
      if (urb.data.size() % kPacket != 0) urb.status = -EOVERFLOW;
      return true;
    }
    if (current_.size() % kPacket != 0 || urb.filled == urb.data.size()) return true;
  }
}

void EmulatedUsbfs::closed() {
  const std::lock_guard<std::mutex> lock(mutex_);
  leftovers_.requests +=
      static_cast<int>(bulk_.size() + silent_.size() + finished_.size() + visible_.size());
  leftovers_.claims += static_cast<int>(claimed_.size());
  ++leftovers_.closes;
  bulk_.clear();
  silent_.clear();
  finished_.clear();
  visible_.clear();
  claimed_.clear();
  memory_used_ = 0;
  if (!gone_) readable_(false);
}

bool EmulatedUsbfs::gone() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return gone_;
}

void EmulatedUsbfs::unplug() {
  const std::lock_guard<std::mutex> lock(mutex_);
  gone_ = true;
  for (const UrbPtr& urb : finished_) visible_.push_back(urb);
  finished_.clear();
  for (auto* queue : {&bulk_, &silent_}) {
    for (const UrbPtr& urb : *queue) {
      urb->status = -ESHUTDOWN;
      visible_.push_back(urb);
    }
    queue->clear();
  }
  readable_(true);
  changed_.notify_all();
}

void EmulatedUsbfs::setHeldByOther(bool held) {
  const std::lock_guard<std::mutex> lock(mutex_);
  held_by_other_ = held;
}

bool EmulatedUsbfs::kernelDriverBound() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return bound_.size() == 2;
}

void EmulatedUsbfs::setDelay(std::function<Clock::duration()> delay) {
  const std::lock_guard<std::mutex> lock(mutex_);
  delay_ = std::move(delay);
}

void EmulatedUsbfs::failTransfers(int error, int count) {
  const std::lock_guard<std::mutex> lock(mutex_);
  failure_ = error;
  failing_transfers_ = count;
  changed_.notify_all();
}

void EmulatedUsbfs::setFastLink(bool fast) {
  const std::lock_guard<std::mutex> lock(mutex_);
  fast_ = fast;
}

EmulatedUsbfs::Leftovers EmulatedUsbfs::leftovers() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return leftovers_;
}

int EmulatedUsbfs::pendingTransfers() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return static_cast<int>(bulk_.size());
}

EmulatedFiles::Meter::Meter() {
  if (instance().metered_) start_ = cpuNanoseconds();
}
EmulatedFiles::Meter::~Meter() {
  if (start_ != 0) instance().metered_nanoseconds_ += cpuNanoseconds() - start_;
}

EmulatedFiles& EmulatedFiles::instance() {
  static EmulatedFiles files;
  return files;
}

void EmulatedFiles::add(int fd, const std::shared_ptr<EmulatedUsbfs>& device) {
  struct stat status;
  fstat(fd, &status);
  const std::lock_guard<std::mutex> lock(mutex_);
  devices_[{status.st_dev, status.st_ino}] = device;
}

std::shared_ptr<EmulatedUsbfs> EmulatedFiles::find(int fd) {
  struct stat status;
  const int error = errno;
  const bool is_fifo = fd >= 0 && fstat(fd, &status) == 0 && S_ISFIFO(status.st_mode);
  errno = error;
  if (!is_fifo) return nullptr;
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto found = devices_.find({status.st_dev, status.st_ino});
  return found == devices_.end() ? nullptr : found->second.lock();
}

void EmulatedFiles::deny(const std::string& path_end) {
  const std::lock_guard<std::mutex> lock(mutex_);
  denied_.insert(path_end);
}

void EmulatedFiles::allowAll() {
  const std::lock_guard<std::mutex> lock(mutex_);
  denied_.clear();
}

bool EmulatedFiles::isDenied(const char* path) {
  const std::string text(path);
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::any_of(denied_.begin(), denied_.end(), [&](const std::string& end) {
    return text.size() >= end.size() &&
           text.compare(text.size() - end.size(), end.size(), end) == 0;
  });
}

}  // namespace leap_object_tracker
