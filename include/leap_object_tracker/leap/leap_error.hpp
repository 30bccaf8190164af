#pragma once

#include <stdexcept>
#include <string>

namespace leap_object_tracker {

/// Why a Leap cannot be used.
enum class LeapFault {
  kAbsent,          ///< none on the bus, or none with the wanted serial number
  kNoPermission,    ///< the device file may not be opened
  kBusy,            ///< another program holds the interfaces
  kSlowLink,        ///< not at high speed: too slow for any mode
  kLockedFirmware,  ///< accepts everything and sends no picture
  kBadReply,        ///< short or senseless replies, as an under-powered device gives them
  kUnplugged,       ///< gone while in use
  kStalled,         ///< pictures stopped
  kUsb,             ///< anything else that libusb reports
};

/// The Leap cannot go on; what() says what happened, where, and what to do.
class LeapError : public std::runtime_error {
 public:
  LeapError(LeapFault fault, const std::string& what) : std::runtime_error(what), fault_(fault) {}
  LeapFault fault() const { return fault_; }

 private:
  LeapFault fault_;
};

}  // namespace leap_object_tracker
