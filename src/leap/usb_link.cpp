#include "leap_object_tracker/leap/usb_link.hpp"

#include <libusb-1.0/libusb.h>

#include <cstdio>

#include "leap_object_tracker/leap/leap_protocol.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kInterfaces[] = {0, 1};
constexpr std::chrono::milliseconds kStandardTimeout{500};

LeapFault faultOf(int code) {
  switch (code) {
    case LIBUSB_ERROR_ACCESS:
      return LeapFault::kNoPermission;
    case LIBUSB_ERROR_BUSY:
      return LeapFault::kBusy;
    case LIBUSB_ERROR_NO_DEVICE:
    case LIBUSB_ERROR_NOT_FOUND:
      return LeapFault::kUnplugged;
    default:
      return LeapFault::kUsb;
  }
}

std::string advice(LeapFault fault) {
  switch (fault) {
    case LeapFault::kNoPermission:
      return "; install the udev rule: sudo cp $(rospack find leap_object_tracker)"
             "/config/udev/60-leap-motion.rules /etc/udev/rules.d/ && sudo udevadm control "
             "--reload, be a member of group plugdev, then plug the Leap again";
    case LeapFault::kBusy:
      return "; another program holds it: one of the maker's services (leapd, "
             "ultraleap-hand-tracking-service), a webcam program or a second driver; or the "
             "kernel's uvcvideo is still looking at it, for up to 6 s";
    default:
      return "";
  }
}

}  // namespace

UsbDevice::UsbDevice(libusb_device* device) : device_(libusb_ref_device(device)) {}
UsbDevice::UsbDevice(const UsbDevice& other) : UsbDevice(other.device_) {}
UsbDevice::~UsbDevice() { libusb_unref_device(device_); }

int UsbDevice::number() const {
  return libusb_get_bus_number(device_) << 8 | libusb_get_device_address(device_);
}

std::string UsbDevice::location() const {
  const int bus = libusb_get_bus_number(device_);
  std::string port = std::to_string(bus);
  std::uint8_t ports[8];
  const int depth = libusb_get_port_numbers(device_, ports, sizeof ports);
  for (int i = 0; i < depth; ++i) port += (i == 0 ? "-" : ".") + std::to_string(ports[i]);
  char file[64];
  std::snprintf(file, sizeof file, "/dev/bus/usb/%03d/%03d", bus,
                libusb_get_device_address(device_));
  return port + " (" + file + ")";
}

bool UsbDevice::isFast() const {
  const int speed = libusb_get_device_speed(device_);
  return speed == LIBUSB_SPEED_UNKNOWN || speed >= LIBUSB_SPEED_HIGH;
}

UsbContext::UsbContext() {
  const int code = libusb_init(&context_);
  if (code != LIBUSB_SUCCESS)
    throw LeapError(LeapFault::kUsb,
                    std::string("libusb does not start: ") + libusb_error_name(code));
}

UsbContext::~UsbContext() { libusb_exit(context_); }

std::vector<UsbDevice> UsbContext::leaps() const {
  libusb_device** list = nullptr;
  const ssize_t count = libusb_get_device_list(context_, &list);
  std::vector<UsbDevice> found;
  for (ssize_t i = 0; i < count; ++i) {
    libusb_device_descriptor descriptor;
    if (libusb_get_device_descriptor(list[i], &descriptor) == LIBUSB_SUCCESS &&
        descriptor.idVendor == kLeapVendor && descriptor.idProduct == kLeapProduct)
      found.emplace_back(list[i]);
  }
  if (count >= 0) libusb_free_device_list(list, 1);
  return found;
}

void UsbContext::forgetAbsent(const std::vector<UsbDevice>& present) {
  std::map<int, std::string> known;
  for (const UsbDevice& device : present) {
    const auto serial = serials.find(device.number());
    if (serial != serials.end()) known.insert(*serial);
  }
  serials.swap(known);
}

UsbLink::UsbLink(const UsbContext& context, const UsbDevice& device)
    : context_(context), location_(device.location()) {
  if (!device.isFast())
    throw LeapError(LeapFault::kSlowLink,
                    "Leap at " + location_ +
                        ": the link is slower than 480 Mbit/s, no picture fits through; use "
                        "another port or cable");
  int code = libusb_open(device.get(), &handle_);
  if (code != LIBUSB_SUCCESS) {
    handle_ = nullptr;
    fail(code, "opening it");
  }
  libusb_set_auto_detach_kernel_driver(handle_, 1);
  for (const int number : kInterfaces) {
    code = libusb_claim_interface(handle_, number);
    if (code != LIBUSB_SUCCESS) {
      if (number > 0) libusb_release_interface(handle_, 0);
      libusb_close(handle_);
      fail(code, "claiming interface " + std::to_string(number));
    }
  }
}

UsbLink::~UsbLink() {
  libusb_release_interface(handle_, 1);
  libusb_release_interface(handle_, 0);
  libusb_close(handle_);
}

int UsbLink::write(std::uint8_t type, std::uint8_t request, std::uint16_t value,
                   std::uint16_t index, ByteView data, std::chrono::milliseconds timeout) {
  return libusb_control_transfer(
      handle_, type, request, value, index, const_cast<std::uint8_t*>(data.data),
      static_cast<std::uint16_t>(data.size), static_cast<unsigned>(timeout.count()));
}

int UsbLink::read(std::uint8_t type, std::uint8_t request, std::uint16_t value, std::uint16_t index,
                  std::vector<std::uint8_t>& data, std::chrono::milliseconds timeout) {
  const int count = libusb_control_transfer(handle_, type, request, value, index, data.data(),
                                            static_cast<std::uint16_t>(data.size()),
                                            static_cast<unsigned>(timeout.count()));
  if (count >= 0) data.resize(static_cast<std::size_t>(count));
  return count;
}

/// As a plain request: libusb_set_interface_alt_setting of libusb 1.0.26 keeps a lock when it finds
/// the device gone, and libusb_close then stops the program.
void UsbLink::selectInterface(int interface_number) {
  const int code = write(LIBUSB_RECIPIENT_INTERFACE, LIBUSB_REQUEST_SET_INTERFACE, 0,
                         static_cast<std::uint16_t>(interface_number), {}, kStandardTimeout);
  if (code < 0) fail(code, "selecting the streaming interface");
}

void UsbLink::clearHalt(std::uint8_t endpoint) { libusb_clear_halt(handle_, endpoint); }

void UsbLink::reset() {
  const int code = libusb_reset_device(handle_);
  if (code != LIBUSB_SUCCESS) fail(code, "resetting it");
}

std::vector<std::uint8_t> UsbLink::configurationDescriptor() {
  std::vector<std::uint8_t> bytes(4096);
  const int count = read(LIBUSB_ENDPOINT_IN, LIBUSB_REQUEST_GET_DESCRIPTOR, LIBUSB_DT_CONFIG << 8,
                         0, bytes, kStandardTimeout);
  if (count < 0) bytes.clear();
  return bytes;
}

void UsbLink::fail(int code, const std::string& doing) const {
  const LeapFault fault = faultOf(code);
  throw LeapError(fault, "Leap at " + location_ + ": " + doing +
                             " failed: " + libusb_strerror(code) + advice(fault));
}

}  // namespace leap_object_tracker
