#include "leap_object_tracker/leap/frame_assembler.hpp"

#include <algorithm>
#include <cstring>
#include <stdexcept>
#include <string>

#include "leap_object_tracker/leap/split_eyes.hpp"

namespace leap_object_tracker {
namespace {

// bmHeaderInfo of UVC 1.0, table 2-5.
constexpr std::uint8_t kFrameIdBit = 0x01;
constexpr std::uint8_t kEndOfFrameBit = 0x02;
constexpr std::uint8_t kTimeBit = 0x04;
constexpr std::uint8_t kErrorBit = 0x40;
constexpr std::uint8_t kEndOfHeaderBit = 0x80;

FrameBuffers allocate(cv::Size size) {
  return {cv::Mat(size, CV_8UC1), cv::Mat(size, CV_8UC1), nullptr};
}

/// Puts the pixels of the row above in the place of the metadata.
void hideMetadata(cv::Mat& image) {
  std::uint8_t* last = image.ptr(image.rows - 1) + image.cols - kMetadataSamples;
  const std::uint8_t* above = image.ptr(image.rows - 2) + image.cols - kMetadataSamples;
  std::memcpy(last, above, kMetadataSamples);
}

bool isUniform(ByteView data) {
  return std::all_of(data.begin(), data.end(), [&](std::uint8_t byte) { return byte == data[0]; });
}

}  // namespace

FrameAssembler::FrameAssembler(cv::Size size, FrameBufferSource buffers)
    : size_(size),
      frame_bytes_(2 * static_cast<std::size_t>(size.area())),
      buffers_(buffers ? std::move(buffers) : allocate) {
  if (size.width < kMetadataSamples || size.height < 2)
    throw std::invalid_argument("FrameAssembler: a frame of " + std::to_string(size.width) + "x" +
                                std::to_string(size.height) + " is too small");
}

std::optional<AssembledFrame> FrameAssembler::push(ByteView payload, Arrival arrival) {
  if (payload.empty()) {
    ++counters_.empty_transfers;
    return std::nullopt;
  }
  const std::optional<Header> header = parse(payload);
  if (!header) {
    ++counters_.bad_headers;
    return std::nullopt;
  }
  const ByteView data(payload.data + header->length, payload.size - header->length);

  if (in_frame_ && !belongsToFrame(*header)) {
    if (synchronized_) ++counters_.lost_end;
    giveUp();
    synchronized_ = true;
  }
  if (!in_frame_) {
    const bool of_finished_frame = last_frame_id_known_ && header->frame_id == frame_id_ &&
                                   header->device_ms && header->device_ms == device_ms_;
    if (of_finished_frame) {
      ++counters_.repeated_payloads;
      return std::nullopt;
    }
    begin(*header, arrival);
  }
  if (header->error && !broken_) {
    ++counters_.error_bit;
    broken_ = true;
  }
  if (!data.empty() && !broken_) {
    if (repeatsPrevious(data)) {
      ++counters_.repeated_payloads;
    } else {
      const bool even = received_ == 0 || data.size == regular_length_ ||
                        (header->end_of_frame && data.size < regular_length_);
      if (received_ == 0) regular_length_ = data.size;
      if (!even || received_ + data.size > frame_bytes_)
        broken_ = true;
      else
        append(data);
    }
  }
  if (!header->end_of_frame) return std::nullopt;
  return finish();
}

void FrameAssembler::restart() {
  in_frame_ = false;
  synchronized_ = false;
  last_frame_id_known_ = false;
}

std::optional<FrameAssembler::Header> FrameAssembler::parse(ByteView payload) {
  if (payload.size < 2 || payload[0] < 2 || payload[0] > payload.size ||
      !(payload[1] & kEndOfHeaderBit))
    return std::nullopt;
  Header header;
  header.length = payload[0];
  header.frame_id = payload[1] & kFrameIdBit;
  header.end_of_frame = payload[1] & kEndOfFrameBit;
  header.error = payload[1] & kErrorBit;
  if ((payload[1] & kTimeBit) && header.length >= 6)
    header.device_ms = payload[2] | payload[3] << 8 | payload[4] << 16 |
                       static_cast<std::uint32_t>(payload[5]) << 24;
  return header;
}

/// The toggling bit may stick; the time is the same in all payloads of a frame.
bool FrameAssembler::belongsToFrame(const Header& header) const {
  if (header.frame_id != frame_id_) return false;
  return !header.device_ms || !device_ms_ || *header.device_ms == *device_ms_;
}

void FrameAssembler::begin(const Header& header, Arrival arrival) {
  in_frame_ = true;
  broken_ = !synchronized_;
  frame_id_ = header.frame_id;
  last_frame_id_known_ = true;
  device_ms_ = header.device_ms;
  arrival_ = arrival;
  received_ = 0;
  regular_length_ = 0;
  previous_length_ = 0;
  odd_byte_.reset();
}

void FrameAssembler::append(ByteView data) {
  if (images_.left.empty()) images_ = buffers_(size_);
  write(data);
  previous_length_ = data.size;
}

/// A payload that comes twice would hide the loss of another one. Pixels carry noise, so equal
/// payloads are one and the same, unless they are of one colour.
bool FrameAssembler::repeatsPrevious(ByteView data) const {
  if (previous_length_ == 0 || data.size != previous_length_ || data.size % 2 != 0 ||
      received_ % 2 != 0)
    return false;
  const std::size_t start = (received_ - previous_length_) / 2;
  const std::uint8_t* left = images_.left.data + start;
  const std::uint8_t* right = images_.right.data + start;
  for (std::size_t i = 0; i < data.size / 2; ++i)
    if (data[2 * i] != left[i] || data[2 * i + 1] != right[i]) return false;
  return !isUniform(data);
}

void FrameAssembler::write(ByteView data) {
  const std::size_t total = received_ + data.size;
  if (odd_byte_) {
    images_.left.data[received_ / 2] = *odd_byte_;
    images_.right.data[received_ / 2] = data[0];
    odd_byte_.reset();
    ++received_;
    data = ByteView(data.data + 1, data.size - 1);
  }
  const std::size_t pixels = data.size / 2;
  splitEyes(data.data, pixels, images_.left.data + received_ / 2,
            images_.right.data + received_ / 2);
  if (data.size % 2 != 0) odd_byte_ = data[data.size - 1];
  received_ = total;
}

std::optional<AssembledFrame> FrameAssembler::finish() {
  in_frame_ = false;
  if (!synchronized_) {
    synchronized_ = true;
    return std::nullopt;
  }
  if (broken_ || received_ != frame_bytes_) {
    ++counters_.torn;
    return std::nullopt;
  }
  ++counters_.good;
  AssembledFrame frame;
  frame.metadata = decodeMetadata(images_.left.data + size_.area() - kMetadataSamples);
  hideMetadata(images_.left);
  hideMetadata(images_.right);
  frame.images = std::move(images_);
  images_ = {};
  frame.has_device_ms = device_ms_.has_value();
  frame.device_ms = device_ms_.value_or(0);
  frame.arrival = arrival_;
  return frame;
}

void FrameAssembler::giveUp() {
  in_frame_ = false;
  if (synchronized_) ++counters_.torn;
}

}  // namespace leap_object_tracker
