// Input: payloads, each after its length (two bytes, little-endian).
#include <cstdlib>

#include "leap_object_tracker/leap/frame_assembler.hpp"

using namespace leap_object_tracker;

namespace {

void require(bool holds) {
  if (!holds) std::abort();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const cv::Size frame_size(16, 4);
  FrameAssembler assembler(frame_size);
  std::uint64_t delivered = 0;
  for (std::size_t at = 0; at + 2 <= size;) {
    const std::size_t wanted = data[at] | data[at + 1] << 8;
    at += 2;
    const std::size_t length = std::min(wanted, size - at);
    // A copy of its own, so that reads beyond its end are seen.
    const std::vector<std::uint8_t> payload(data + at, data + at + length);
    at += length;
    if (length == 1) assembler.restart();
    if (const auto frame = assembler.push(payload, {})) {
      ++delivered;
      require(frame->images.left.size() == frame_size && frame->images.right.size() == frame_size);
      require(frame->images.left.type() == CV_8UC1 && frame->images.left.isContinuous());
    }
  }
  const AssemblerCounters& counters = assembler.counters();
  require(counters.good == delivered);
  require(counters.lost_end <= counters.torn);
  return 0;
}
