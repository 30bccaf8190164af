#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "gather_loop.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.h.
#include <hwy/highway.h>

#include "gather_loop.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

std::int64_t gatherLoop(const std::uint8_t* map, const std::int32_t* offsets, std::size_t count,
                        const std::int32_t* moves, std::size_t particles) {
  const hn::ScalableTag<std::int32_t> di;
  const std::size_t lanes = hn::Lanes(di);
  const auto* base = reinterpret_cast<const std::int32_t*>(map);
  auto sum = hn::Zero(di);
  for (std::size_t p = 0; p < particles; ++p) {
    const auto move = hn::Set(di, moves[p]);
    for (std::size_t i = 0; i < count; i += lanes)
      sum = hn::Add(sum, hn::GatherOffset(di, base, hn::Add(hn::LoadU(di, offsets + i), move)));
  }
  return hn::GetLane(hn::SumOfLanes(di, sum));
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(gatherLoop);

std::int64_t gatherOnly(const std::uint8_t* map, const std::int32_t* offsets, std::size_t count,
                        const std::int32_t* moves, std::size_t particles) {
  return HWY_DYNAMIC_DISPATCH(gatherLoop)(map, offsets, count, moves, particles);
}

}  // namespace leap_object_tracker
#endif
