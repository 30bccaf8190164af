#include "emulated_leap_vhci.hpp"

#include <arpa/inet.h>
#include <fcntl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

constexpr char kAttach[] = "/sys/devices/platform/vhci_hcd.0/attach";
constexpr unsigned kDevice = 0x10002;  // bus 1, address 2 on the far side
constexpr int kHighSpeed = 3;          // enum usb_device_speed
constexpr int kAttempts = 100;
constexpr std::size_t kHeaderBytes = 48;
constexpr std::size_t kPacket = 512;
constexpr std::uint32_t kSubmit = 1, kUnlink = 2, kSubmitReply = 3, kUnlinkReply = 4;
constexpr std::uint32_t kShortNotOk = 1;

std::uint32_t word(const Bytes& header, std::size_t index) {
  std::uint32_t value;
  std::memcpy(&value, &header[4 * index], 4);
  return ntohl(value);
}

/// A header with its first words set and the rest zero.
Bytes header(std::initializer_list<std::uint32_t> words) {
  Bytes bytes(kHeaderBytes, 0);
  std::size_t at = 0;
  for (const std::uint32_t value : words) {
    const std::uint32_t big_endian = htonl(value);
    std::memcpy(&bytes[at], &big_endian, 4);
    at += 4;
  }
  return bytes;
}

}  // namespace

EmulatedVhci::~EmulatedVhci() { unplug(); }

void EmulatedVhci::plug(EmulatedLeap& leap) {
  leap.powerOn();
  leap_ = &leap;
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    throw std::runtime_error("socketpair");
  char line[64];
  const int length =
      std::snprintf(line, sizeof line, "%d %d %u %d", 0, ends[1], kDevice, kHighSpeed);
  // The kernel needs a while to let go of the device that was in this port before.
  bool taken = false;
  for (int attempt = 0; attempt < kAttempts && !taken; ++attempt) {
    if (attempt > 0) std::this_thread::sleep_for(std::chrono::milliseconds(100));
    const int file = open(kAttach, O_WRONLY);
    taken = file >= 0 && write(file, line, static_cast<std::size_t>(length)) == length;
    const int error = errno;
    if (file >= 0) close(file);
    errno = error;
    if (!taken && error != EBUSY) break;
  }
  const int error = errno;
  close(ends[1]);
  if (!taken) {
    close(ends[0]);
    throw std::runtime_error(std::string(kAttach) + ": " + std::strerror(error));
  }
  socket_ = ends[0];
  stop_ = false;
  reader_ = std::thread([this] { readRequests(); });
  server_ = std::thread([this] { serveBulk(); });
}

void EmulatedVhci::unplug() {
  if (socket_ < 0) return;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stop_ = true;
  }
  shutdown(socket_, SHUT_RDWR);
  changed_.notify_all();
  reader_.join();
  server_.join();
  close(socket_);
  socket_ = -1;
  waiting_.clear();
  unanswered_.clear();
  current_.clear();
  current_taken_ = 0;
}

bool EmulatedVhci::receive(void* bytes, std::size_t count) {
  return count == 0 || recv(socket_, bytes, count, MSG_WAITALL) == static_cast<ssize_t>(count);
}

void EmulatedVhci::send(const Bytes& message) {
  const std::lock_guard<std::mutex> lock(send_mutex_);
  for (std::size_t at = 0; at < message.size();) {
    const ssize_t count = ::send(socket_, &message[at], message.size() - at, MSG_NOSIGNAL);
    if (count <= 0) return;
    at += static_cast<std::size_t>(count);
  }
}

void EmulatedVhci::reply(const Request& request, int status) {
  Bytes message = header({kSubmitReply, request.number, 0, 0, 0, static_cast<std::uint32_t>(status),
                          static_cast<std::uint32_t>(request.filled)});
  if (request.in)
    message.insert(message.end(), request.data.begin(),
                   request.data.begin() + static_cast<std::ptrdiff_t>(request.filled));
  send(message);
}

void EmulatedVhci::readRequests() {
  Bytes bytes(kHeaderBytes);
  while (receive(bytes.data(), bytes.size())) {
    if (word(bytes, 0) == kUnlink) {
      unlink(word(bytes, 1), word(bytes, 5));
      continue;
    }
    if (word(bytes, 0) != kSubmit) break;
    Request request;
    request.number = word(bytes, 1);
    request.in = word(bytes, 3) == 1;
    request.flags = word(bytes, 5);
    request.length = word(bytes, 6);
    request.data.resize(request.length);
    if (!request.in && !receive(request.data.data(), request.length)) break;
    if (word(bytes, 4) == 0) {
      answerControl(request, &bytes[40]);
    } else {
      const std::lock_guard<std::mutex> lock(mutex_);
      waiting_.push_back(std::move(request));
    }
    changed_.notify_all();
  }
}

void EmulatedVhci::answerControl(Request& request, const std::uint8_t* bytes) {
  const auto setup = EmulatedLeap::Setup::fromBytes(bytes);
  request.data.resize(std::max<std::size_t>(request.data.size(), setup.length));
  const int result = leap_->control(setup, request.data.data());
  if (result == EmulatedLeap::kNoReply) {
    const std::lock_guard<std::mutex> lock(mutex_);
    unanswered_.push_back(request.number);
    return;
  }
  request.filled = result > 0 ? static_cast<std::size_t>(result) : 0;
  reply(request, std::min(result, 0));
}

void EmulatedVhci::unlink(std::uint32_t number, std::uint32_t victim) {
  bool found = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto in_bulk = std::find_if(waiting_.begin(), waiting_.end(),
                                      [&](const Request& r) { return r.number == victim; });
    const auto in_silent = std::find(unanswered_.begin(), unanswered_.end(), victim);
    found = in_bulk != waiting_.end() || in_silent != unanswered_.end();
    if (in_bulk != waiting_.end()) waiting_.erase(in_bulk);
    if (in_silent != unanswered_.end()) unanswered_.erase(in_silent);
  }
  // A request that has been answered already cannot be taken back; that is no error.
  send(
      header({kUnlinkReply, number, 0, 0, 0, static_cast<std::uint32_t>(found ? -ECONNRESET : 0)}));
}

void EmulatedVhci::serveBulk() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (!stop_) {
    const auto wake = leap_->produce(EmulatedLeap::Clock::now(), !waiting_.empty());
    const bool halted = leap_->halted();
    if (waiting_.empty() || (!halted && !fill(waiting_.front()))) {
      changed_.wait_until(lock, wake);
      continue;
    }
    const Request done = std::move(waiting_.front());
    waiting_.pop_front();
    const bool too_short = done.filled < done.length && (done.flags & kShortNotOk);
    // Still locked: the kernel gives a device up that answers after the request was taken back.
    reply(done, halted ? -EPIPE : too_short ? -EREMOTEIO : 0);
  }
}

/// @return whether the request is done
bool EmulatedVhci::fill(Request& request) {
  for (;;) {
    if (current_taken_ == current_.size()) {
      auto payload = leap_->takePayload();
      if (!payload) {
        leap_->produce(EmulatedLeap::Clock::now(), true);
        payload = leap_->takePayload();
      }
      if (!payload) return false;
      current_ = std::move(*payload);
      current_taken_ = 0;
      if (current_.empty()) return true;
    }
    const std::size_t count =
        std::min<std::size_t>(request.length - request.filled, current_.size() - current_taken_);
    std::copy_n(current_.begin() + static_cast<std::ptrdiff_t>(current_taken_), count,
                request.data.begin() + static_cast<std::ptrdiff_t>(request.filled));
    request.filled += count;
    current_taken_ += count;
    if (request.filled == request.length) return true;
    if (current_taken_ == current_.size() && current_.size() % kPacket != 0) return true;
  }
}

}  // namespace leap_object_tracker
