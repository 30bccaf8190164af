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

constexpr std::size_t kBlock = 16;
using BlockTag = hn::CappedTag<float, kBlock>;
using Float = hn::Vec<BlockTag>;

/// One coordinate of vectors that start at `values`, turned.
HWY_INLINE Float turned(BlockTag df, const float* values, std::size_t stride,
                        const Eigen::Matrix3f& rotation, Eigen::Index row) {
  return hn::MulAdd(
      hn::Set(df, rotation(row, 0)), hn::LoadU(df, values),
      hn::MulAdd(hn::Set(df, rotation(row, 1)), hn::LoadU(df, values + stride),
                 hn::Mul(hn::Set(df, rotation(row, 2)), hn::LoadU(df, values + 2 * stride))));
}

struct Projected {
  Float u, v, inverse_depth;
};

/// Image places of points that start at `values`.
HWY_INLINE Projected project(BlockTag df, const float* values, std::size_t stride,
                             const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation,
                             float nearest) {
  const Float z = hn::Max(hn::Add(turned(df, values, stride, rotation, 2), hn::Set(df, origin.z())),
                          hn::Set(df, nearest));
  const Float inverse = hn::Div(hn::Set(df, 1.0F), z);
  return {
      hn::Mul(hn::Add(turned(df, values, stride, rotation, 0), hn::Set(df, origin.x())), inverse),
      hn::Mul(hn::Add(turned(df, values, stride, rotation, 1), hn::Set(df, origin.y())), inverse),
      inverse};
}

void reachOf(const float* arrays, std::size_t count, const Eigen::Vector3f& origin,
             const Eigen::Matrix3f& rotation, float nearest, PointReach& reach) {
  const BlockTag df;
  const hn::RebindToSigned<BlockTag> di;
  alignas(64) std::array<float, kBlock> x, y;
  const float *cosines = BrightRegion::cosines().data(), *sines = BrightRegion::sines().data();
  reach.extents.setConstant(-1e9F);
  reach.farthest.setZero();
  for (std::size_t block = 0; block < count; block += kBlock) {
    for (std::size_t k = 0; k < kBlock; k += hn::Lanes(df)) {
      const Projected at = project(df, arrays + block + k, count, origin, rotation, nearest);
      hn::Store(at.u, df, x.data() + k);
      hn::Store(at.v, df, y.data() + k);
    }
    for (std::size_t i = 0; i < BrightRegion::kDirections; i += hn::Lanes(df)) {
      const Float c = hn::LoadU(df, cosines + i);
      const Float s = hn::LoadU(df, sines + i);
      Float most = hn::LoadU(df, reach.extents.data() + i);
      auto farthest = hn::LoadU(di, reach.farthest.data() + i);
      for (std::size_t k = 0; k < kBlock; ++k) {
        const Float here = hn::MulAdd(c, hn::Set(df, x[k]), hn::Mul(s, hn::Set(df, y[k])));
        farthest = hn::IfThenElse(hn::RebindMask(di, hn::Gt(here, most)),
                                  hn::Set(di, static_cast<int>(block + k)), farthest);
        most = hn::Max(most, here);
      }
      hn::StoreU(most, df, reach.extents.data() + i);
      hn::StoreU(farthest, di, reach.farthest.data() + i);
    }
  }
}

float lengthInside(const float* arrays, std::size_t stride, std::size_t count,
                   const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation, float nearest,
                   const Eigen::AlignedBox2f& window) {
  const BlockTag df;
  Float length = hn::Zero(df);
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    const Projected at = project(df, arrays + i, stride, origin, rotation, nearest);
    const float* tangents = arrays + 3 * stride + i;
    const Float along = turned(df, tangents, stride, rotation, 2);
    const Float du = hn::NegMulAdd(at.u, along, turned(df, tangents, stride, rotation, 0));
    const Float dv = hn::NegMulAdd(at.v, along, turned(df, tangents, stride, rotation, 1));
    const auto seen = hn::And(hn::And(hn::Ge(at.u, hn::Set(df, window.min().x())),
                                      hn::Le(at.u, hn::Set(df, window.max().x()))),
                              hn::And(hn::Ge(at.v, hn::Set(df, window.min().y())),
                                      hn::Le(at.v, hn::Set(df, window.max().y()))));
    length = hn::MulAdd(hn::Sqrt(hn::MulAdd(du, du, hn::Mul(dv, dv))),
                        hn::IfThenElseZero(seen, at.inverse_depth), length);
  }
  return hn::GetLane(hn::SumOfLanes(df, length));
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(reachOf);
HWY_EXPORT(lengthInside);

PointReach reachOfPoints(const float* arrays, std::size_t count, const Eigen::Vector3f& origin,
                         const Eigen::Matrix3f& rotation, float nearest) {
  PointReach reach;
  HWY_DYNAMIC_DISPATCH(reachOf)(arrays, count, origin, rotation, nearest, reach);
  return reach;
}

float contourLengthInside(const float* arrays, std::size_t stride, std::size_t count,
                          const Eigen::Vector3f& origin, const Eigen::Matrix3f& rotation,
                          float nearest, const Eigen::AlignedBox2f& window) {
  return HWY_DYNAMIC_DISPATCH(lengthInside)(arrays, stride, count, origin, rotation, nearest,
                                            window);
}

}  // namespace leap_object_tracker
#endif
