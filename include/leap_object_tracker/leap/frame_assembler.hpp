#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>

#include "leap_object_tracker/leap/byte_view.hpp"
#include "leap_object_tracker/leap/frame_metadata.hpp"

namespace leap_object_tracker {

/// Time at which bytes reached the host; does not jump when the wall clock is set.
using Arrival = std::chrono::steady_clock::time_point;

/// Room for one frame, so that a consumer can have its own memory filled without a copy.
struct FrameBuffers {
  cv::Mat left;                 ///< CV_8UC1, continuous
  cv::Mat right;                ///< CV_8UC1, continuous
  std::shared_ptr<void> owner;  ///< keeps the memory behind the two alive, if they do not
};
using FrameBufferSource = std::function<FrameBuffers(cv::Size)>;

/// One whole frame as it came over the bus.
struct AssembledFrame {
  FrameBuffers images;  ///< metadata samples are replaced by the pixels above them
  FrameMetadata metadata;
  std::uint32_t device_ms = 0;  ///< the device's clock at this frame [ms], wraps
  bool has_device_ms = false;
  Arrival arrival;  ///< of the first payload
};

struct AssemblerCounters {
  std::uint64_t good = 0;       ///< frames delivered
  std::uint64_t torn = 0;       ///< frames given up: too short, too long, uneven
  std::uint64_t lost_end = 0;   ///< of these: the end-of-frame payload never came
  std::uint64_t error_bit = 0;  ///< of these: the device said itself that it is broken
  std::uint64_t empty_transfers = 0;
  std::uint64_t bad_headers = 0;        ///< payloads that are no payloads
  std::uint64_t repeated_payloads = 0;  ///< payloads that came twice and were left out
};

/// Puts UVC payloads together to frames (UVC 1.0, section 2.4.3.2). Delivers a frame only if all
/// its bytes came, in payloads as even as the device makes them.
class FrameAssembler {
 public:
  /// @param buffers where frames go; allocates them if empty
  explicit FrameAssembler(cv::Size size, FrameBufferSource buffers = {});

  /// @param payload one transfer: header and data
  std::optional<AssembledFrame> push(ByteView payload, Arrival arrival);

  /// Forgets the frame in progress, as after a halt of the endpoint.
  void restart();

  const AssemblerCounters& counters() const { return counters_; }

 private:
  struct Header {
    std::size_t length = 0;
    bool frame_id = false;
    bool end_of_frame = false;
    bool error = false;
    std::optional<std::uint32_t> device_ms;
  };
  static std::optional<Header> parse(ByteView payload);

  bool belongsToFrame(const Header& header) const;
  void begin(const Header& header, Arrival arrival);
  void append(ByteView data);
  bool repeatsPrevious(ByteView data) const;
  void write(ByteView data);
  std::optional<AssembledFrame> finish();
  void giveUp();

  cv::Size size_;
  std::size_t frame_bytes_;
  FrameBufferSource buffers_;
  AssemblerCounters counters_;

  bool synchronized_ = false;  ///< a frame boundary was seen
  bool in_frame_ = false;
  bool broken_ = false;  ///< the frame in progress cannot be delivered any more
  bool frame_id_ = false;
  bool last_frame_id_known_ = false;
  std::optional<std::uint32_t> device_ms_;
  Arrival arrival_;
  std::size_t received_ = 0;              ///< [bytes] of the frame in progress
  std::size_t regular_length_ = 0;        ///< [bytes] of its first payload's data
  std::size_t previous_length_ = 0;       ///< [bytes] of its latest payload's data
  std::optional<std::uint8_t> odd_byte_;  ///< left byte whose right one is still to come
  FrameBuffers images_;
};

}  // namespace leap_object_tracker
