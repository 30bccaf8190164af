#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "leap_object_tracker/leap/byte_view.hpp"
#include "leap_object_tracker/leap/leap_error.hpp"

struct libusb_context;
struct libusb_device;
struct libusb_device_handle;

namespace leap_object_tracker {

/// A device on the bus that is not open.
class UsbDevice {
 public:
  explicit UsbDevice(libusb_device* device);
  UsbDevice(const UsbDevice& other);
  UsbDevice& operator=(const UsbDevice& other) = delete;
  ~UsbDevice();

  libusb_device* get() const { return device_; }
  /// Differs for each time that a device is plugged in.
  int number() const;
  /// Such as "1-1.4 (/dev/bus/usb/001/007)".
  std::string location() const;
  /// At least 480 Mbit/s.
  bool isFast() const;

 private:
  libusb_device* device_;
};

/// One libusb session.
class UsbContext {
 public:
  /// @throw LeapError
  UsbContext();
  ~UsbContext();
  UsbContext(const UsbContext&) = delete;
  UsbContext& operator=(const UsbContext&) = delete;

  libusb_context* get() const { return context_; }
  /// All Leaps on the bus at this moment.
  std::vector<UsbDevice> leaps() const;

  /// Serial numbers by UsbDevice::number(), so that a Leap that belongs to somebody else is opened
  /// only once to ask for its name.
  std::map<int, std::string> serials;
  /// Numbers are given again after a while.
  void forgetAbsent(const std::vector<UsbDevice>& present);

 private:
  libusb_context* context_ = nullptr;
};

/// A device with its interfaces 0 and 1 claimed, until destruction; the kernel's driver gets them
/// back then.
class UsbLink {
 public:
  /// @throw LeapError kNoPermission, kBusy, kSlowLink, kUnplugged, kUsb
  UsbLink(const UsbContext& context, const UsbDevice& device);
  ~UsbLink();
  UsbLink(const UsbLink&) = delete;
  UsbLink& operator=(const UsbLink&) = delete;

  /// @return number of bytes, or a negative code of libusb
  int write(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
            ByteView data, std::chrono::milliseconds timeout);
  int read(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
           std::vector<std::uint8_t>& data, std::chrono::milliseconds timeout);

  /// Alternate setting 0 of an interface; clear the halt of its endpoints after, so that both sides
  /// count packets from the start. @throw LeapError
  void selectInterface(int interface_number);
  /// Failure does not matter: a device that is not halted may refuse.
  void clearHalt(std::uint8_t endpoint);
  /// Back to the state after power-on. @throw LeapError when the device comes back as a new one
  void reset();

  std::vector<std::uint8_t> configurationDescriptor();
  const std::string& location() const { return location_; }
  libusb_device_handle* handle() const { return handle_; }
  const UsbContext& context() const { return context_; }

  /// @param doing what was tried, such as "writing the exposure"
  [[noreturn]] void fail(int code, const std::string& doing) const;

 private:
  const UsbContext& context_;
  std::string location_;
  libusb_device_handle* handle_ = nullptr;
};

}  // namespace leap_object_tracker
