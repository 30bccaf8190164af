// The system calls that libusb makes on the device file of an emulated Leap. A symbol of the
// program is found before those of any library, so libusb's calls come here; what does not concern
// an emulated device goes on to the next library that has the function. One program links this
// once.
#include <dlfcn.h>
#include <poll.h>
#include <sys/ioctl.h>

#include <cerrno>
#include <cstdarg>

#include "emulated_leap_usbfs.hpp"

using leap_object_tracker::EmulatedFiles;

namespace {

template <class Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

}  // namespace

#define EXPORTED extern "C" __attribute__((visibility("default")))

EXPORTED int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* argument = va_arg(arguments, void*);
  va_end(arguments);
  if (_IOC_TYPE(request) == 'U') {
    const EmulatedFiles::Meter meter;
    if (const auto device = EmulatedFiles::instance().find(fd)) {
      const int result = device->ioctl(request, argument);
      if (result >= 0) return result;
      errno = -result;
      return -1;
    }
  }
  static const auto real = next<int (*)(int, unsigned long, ...)>("ioctl");
  return real(fd, request, argument);
}

/// A FIFO whose other end stays open never reports an error, as the file of a lost device does.
EXPORTED int poll(pollfd* fds, nfds_t count, int timeout) {
  static const auto real = next<int (*)(pollfd*, nfds_t, int)>("poll");
  const int result = real(fds, count, timeout);
  const EmulatedFiles::Meter meter;
  for (nfds_t i = 0; result > 0 && i < count; ++i)
    if (fds[i].revents & POLLOUT) {
      const auto device = EmulatedFiles::instance().find(fds[i].fd);
      if (device && device->gone()) fds[i].revents |= POLLERR | POLLHUP;
    }
  return result;
}

EXPORTED int close(int fd) {
  static const auto real = next<int (*)(int)>("close");
  const auto device = EmulatedFiles::instance().find(fd);
  const int result = real(fd);
  if (device) device->closed();
  return result;
}

/// What open() becomes in a library built with checks (_FORTIFY_SOURCE).
EXPORTED int __open_2(const char* path, int flags) {
  if (EmulatedFiles::instance().isDenied(path)) {
    errno = EACCES;
    return -1;
  }
  static const auto real = next<int (*)(const char*, int)>("__open_2");
  return real(path, flags);
}
