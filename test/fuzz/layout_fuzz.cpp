// Input: a configuration descriptor.
#include "leap_object_tracker/leap/leap_protocol.hpp"

using namespace leap_object_tracker;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::vector<std::uint8_t> bytes(data, data + size);
  const LeapLayout layout = parseLayout(bytes);
  for (const LeapModeInfo& mode : leapModes()) layout.frame(mode.mode);
  decodeProbe(bytes);
  return 0;
}
