#include "leap_object_tracker/rectification/remap_table.hpp"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "rectification/remap_table.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// One pixel; the reference of what the lanes do.
inline std::uint8_t interpolated(const std::uint8_t* upper, const std::uint8_t* lower,
                                 std::uint16_t fractions) {
  const int right = fractions & 255, down = fractions >> 8;
  const int top = (upper[0] << 8) + right * (upper[1] - upper[0]);
  const int bottom = (lower[0] << 8) + right * (lower[1] - lower[0]);
  return static_cast<std::uint8_t>(((top << 8) + down * (bottom - top) + (1 << 15)) >> 16);
}

/// Reads four bytes at every offset of two neighbouring rows.
void remapWide(const std::uint8_t* source, std::size_t stride, const std::int32_t* offsets,
               const std::uint16_t* fractions, std::size_t pixels, std::uint8_t* target) {
  const hn::ScalableTag<std::int32_t> ints;
  const hn::Rebind<std::uint16_t, decltype(ints)> shorts;
  const hn::Rebind<std::uint8_t, decltype(ints)> bytes;
  const std::size_t lanes = hn::Lanes(ints);
  const auto* upper = reinterpret_cast<const std::int32_t*>(source);
  const auto* lower = reinterpret_cast<const std::int32_t*>(source + stride);
  const auto low_byte = hn::Set(ints, 255);
  const auto half = hn::Set(ints, 1 << 15);
  const auto along = [&](auto four, auto right) {
    const auto first = hn::And(four, low_byte);
    const auto second = hn::And(hn::ShiftRight<8>(four), low_byte);
    return hn::Add(hn::ShiftLeft<8>(first), hn::Mul(right, hn::Sub(second, first)));
  };
  std::size_t i = 0;
  for (; i + lanes <= pixels; i += lanes) {
    const auto offset = hn::LoadU(ints, offsets + i);
    const auto fraction = hn::PromoteTo(ints, hn::LoadU(shorts, fractions + i));
    const auto right = hn::And(fraction, low_byte);
    const auto down = hn::ShiftRight<8>(fraction);
    const auto top = along(hn::GatherOffset(ints, upper, offset), right);
    const auto bottom = along(hn::GatherOffset(ints, lower, offset), right);
    const auto sum =
        hn::Add(hn::Add(hn::ShiftLeft<8>(top), half), hn::Mul(down, hn::Sub(bottom, top)));
    hn::StoreU(hn::DemoteTo(bytes, hn::ShiftRight<16>(sum)), bytes, target + i);
  }
  for (; i < pixels; ++i) {
    const std::uint8_t* at = source + offsets[i];
    target[i] = interpolated(at, at + stride, fractions[i]);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(remapWide);

RemapTable::RemapTable(const cv::Mat& map_u, const cv::Mat& map_v, const cv::Size& source_size)
    : size_(map_u.size()),
      source_size_(source_size),
      offsets_(static_cast<std::size_t>(size_.area())),
      fractions_(offsets_.size()),
      rows_(static_cast<std::size_t>(size_.height)) {
  const int stride = source_size.width;
  // Four bytes are read at an offset, in its row and in the next one.
  const double lowest = 256.0 * (source_size.height - 2) + 255;
  const double rightmost = 256.0 * (source_size.width - 2) + 255;
  const double rightmost_below = 256.0 * (source_size.width - 4) + 255;
  for (int v = 0; v < size_.height; ++v) {
    Row& row = rows_[static_cast<std::size_t>(v)];
    std::vector<int> missing;
    for (int u = 0; u < size_.width; ++u) {
      const double from_u = map_u.at<float>(v, u), from_v = map_v.at<float>(v, u);
      if (!std::isfinite(from_u) || !std::isfinite(from_v)) {
        if (row.end > 0) missing.push_back(u);
        continue;
      }
      const double scaled_v = std::clamp(std::round(256 * from_v), 0.0, lowest);
      const double above = std::floor(scaled_v / 256);
      const double scaled_u =
          std::clamp(std::round(256 * from_u), 0.0,
                     above < source_size.height - 2 ? rightmost : rightmost_below);
      const double left = std::floor(scaled_u / 256);
      if (row.end == 0) row.begin = u;
      row.holes.insert(row.holes.end(), missing.begin(), missing.end());
      missing.clear();
      row.end = u + 1;
      const std::size_t i = static_cast<std::size_t>(v) * static_cast<std::size_t>(size_.width) +
                            static_cast<std::size_t>(u);
      offsets_[i] = static_cast<std::int32_t>(above) * stride + static_cast<std::int32_t>(left);
      fractions_[i] = static_cast<std::uint16_t>(static_cast<int>(scaled_u - 256 * left) |
                                                 static_cast<int>(scaled_v - 256 * above) << 8);
    }
  }
}

void RemapTable::fillRows(const cv::Mat& source, cv::Mat& target, int first, int last) const {
  const auto width = static_cast<std::size_t>(size_.width);
  for (int v = first; v < last; ++v) {
    const Row& row = rows_[static_cast<std::size_t>(v)];
    const auto begin = static_cast<std::size_t>(row.begin), end = static_cast<std::size_t>(row.end);
    const std::size_t at = static_cast<std::size_t>(v) * width + begin;
    std::uint8_t* out = target.ptr<std::uint8_t>(v);
    std::fill(out, out + begin, std::uint8_t{0});
    HWY_DYNAMIC_DISPATCH(remapWide)
    (source.data, static_cast<std::size_t>(source_size_.width), offsets_.data() + at,
     fractions_.data() + at, end - begin, out + begin);
    for (const int hole : row.holes) out[hole] = 0;
    std::fill(out + end, out + width, std::uint8_t{0});
  }
}

}  // namespace leap_object_tracker
#endif
