#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/contour_reach.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.h.
#include <hwy/highway.h>

#include <array>

#include "leap_object_tracker/tracking/contour_reach.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void reachOf(const float* arrays, std::size_t stride, std::size_t count,
             const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation, float nearest,
             const Eigen::AlignedBox2f& window, const std::array<float, 32>& directions,
             ContourReach& reach) {
  constexpr std::size_t kBlock = 16;
  const hn::CappedTag<float, kBlock> df;
  using Float = hn::Vec<decltype(df)>;
  alignas(64) std::array<float, kBlock> x, y;
  alignas(64) std::array<float, ContourReach::kDirections> largest;
  for (std::size_t i = 0; i < largest.size(); i += hn::Lanes(df))
    hn::Store(hn::Set(df, -1e9F), df, largest.data() + i);
  Float length = hn::Zero(df);
  for (std::size_t block = 0; block < count; block += kBlock) {
    for (std::size_t k = 0; k < kBlock; k += hn::Lanes(df)) {
      const auto turned = [&](std::size_t column, Eigen::Index row) HWY_ATTR {
        const float* values = arrays + column * stride + block + k;
        return hn::MulAdd(
            hn::Set(df, rotation(row, 0)), hn::LoadU(df, values),
            hn::MulAdd(hn::Set(df, rotation(row, 1)), hn::LoadU(df, values + stride),
                       hn::Mul(hn::Set(df, rotation(row, 2)), hn::LoadU(df, values + 2 * stride))));
      };
      const Float z = hn::Max(hn::Add(turned(0, 2), hn::Set(df, origin.z())), hn::Set(df, nearest));
      const Float inverse = hn::Div(hn::Set(df, 1.0F), z);
      const Float u = hn::Mul(hn::Add(turned(0, 0), hn::Set(df, origin.x())), inverse);
      const Float v = hn::Mul(hn::Add(turned(0, 1), hn::Set(df, origin.y())), inverse);
      hn::Store(u, df, x.data() + k);
      hn::Store(v, df, y.data() + k);
      const Float along = turned(3, 2);
      const Float du = hn::NegMulAdd(u, along, turned(3, 0));
      const Float dv = hn::NegMulAdd(v, along, turned(3, 1));
      const auto seen = hn::And(hn::And(hn::Ge(u, hn::Set(df, window.min().x())),
                                        hn::Le(u, hn::Set(df, window.max().x()))),
                                hn::And(hn::Ge(v, hn::Set(df, window.min().y())),
                                        hn::Le(v, hn::Set(df, window.max().y()))));
      length = hn::MulAdd(hn::Sqrt(hn::MulAdd(du, du, hn::Mul(dv, dv))),
                          hn::IfThenElseZero(seen, inverse), length);
    }
    for (std::size_t i = 0; i < largest.size(); i += hn::Lanes(df)) {
      const Float c = hn::LoadU(df, directions.data() + i);
      const Float s = hn::LoadU(df, directions.data() + largest.size() + i);
      Float most = hn::Load(df, largest.data() + i);
      for (std::size_t k = 0; k < kBlock; ++k)
        most = hn::Max(most, hn::MulAdd(c, hn::Set(df, x[k]), hn::Mul(s, hn::Set(df, y[k]))));
      hn::Store(most, df, largest.data() + i);
    }
  }
  reach.extents =
      Eigen::Map<const Eigen::Array<float, ContourReach::kDirections, 1>>(largest.data());
  reach.length = hn::GetLane(hn::SumOfLanes(df, length));
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <cmath>

namespace leap_object_tracker {

HWY_EXPORT(reachOf);

ContourReach reachOfContour(const float* arrays, std::size_t stride, std::size_t count,
                            const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation,
                            float nearest, const Eigen::AlignedBox2f& window) {
  static const std::array<float, 32> directions = [] {
    std::array<float, 32> values{};
    for (std::size_t i = 0; i < 16; ++i) {
      const double angle = 2 * M_PI * static_cast<double>(i) / 16;
      values[i] = static_cast<float>(std::cos(angle));
      values[16 + i] = static_cast<float>(std::sin(angle));
    }
    return values;
  }();
  ContourReach reach;
  HWY_DYNAMIC_DISPATCH(reachOf)
  (arrays, stride, count, origin, rotation, nearest, window, directions, reach);
  return reach;
}

}  // namespace leap_object_tracker
#endif
