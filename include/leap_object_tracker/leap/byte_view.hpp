#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace leap_object_tracker {

/// Bytes that belong to somebody else.
struct ByteView {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;

  ByteView() = default;
  ByteView(const std::uint8_t* bytes, std::size_t count) : data(bytes), size(count) {}
  ByteView(const std::vector<std::uint8_t>& bytes) : data(bytes.data()), size(bytes.size()) {}

  std::uint8_t operator[](std::size_t i) const { return data[i]; }
  const std::uint8_t* begin() const { return data; }
  const std::uint8_t* end() const { return data + size; }
  bool empty() const { return size == 0; }
};

}  // namespace leap_object_tracker
