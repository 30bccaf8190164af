#include "leap_object_tracker/leap/split_eyes.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "leap/split_eyes.cpp"
#include <hwy/foreach_target.h>  // must come before highway.h
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

void splitEyesWide(const std::uint8_t* interleaved, std::size_t pixels, std::uint8_t* left,
                   std::uint8_t* right) {
  const hn::ScalableTag<std::uint8_t> bytes;
  const std::size_t lanes = hn::Lanes(bytes);
  std::size_t i = 0;
  for (; i + lanes <= pixels; i += lanes) {
    hn::Vec<decltype(bytes)> left_bytes, right_bytes;
    hn::LoadInterleaved2(bytes, interleaved + 2 * i, left_bytes, right_bytes);
    hn::StoreU(left_bytes, bytes, left + i);
    hn::StoreU(right_bytes, bytes, right + i);
  }
  for (; i < pixels; ++i) {
    left[i] = interleaved[2 * i];
    right[i] = interleaved[2 * i + 1];
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(splitEyesWide);

void splitEyes(const std::uint8_t* interleaved, std::size_t pixels, std::uint8_t* left,
               std::uint8_t* right) {
  HWY_DYNAMIC_DISPATCH(splitEyesWide)(interleaved, pixels, left, right);
}

}  // namespace leap_object_tracker
#endif
