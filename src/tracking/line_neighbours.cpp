#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/line_neighbours.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.h.
#include <hwy/highway.h>

#include "tracking/line_neighbours.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// @param i that is asked for
ContourLines::Neighbours neighboursOf(const ContourLines::Arrays& lines, std::size_t i) {
  constexpr float kAlongside = 4;    // [px]
  constexpr float kParallel = 0.8F;  // cosine
  constexpr float kBlend = 2.9F;     // [px] lines farther apart do not blur together
  constexpr float kUnresolved = 2;   // [px] nor are they taken for one
  constexpr float kFar = ContourLines::kFarthest, kSame = ContourLines::kSameLine,
                  kWindow = ContourLines::kWindow;
  const hn::CappedTag<float, 16> df;
  using Float = hn::Vec<decltype(df)>;
  const Float u = hn::Set(df, lines.u[i]), v = hn::Set(df, lines.v[i]);
  const Float nu = hn::Set(df, lines.normal_u[i]), nv = hn::Set(df, lines.normal_v[i]);
  const Float zero = hn::Zero(df), one = hn::Set(df, 1.0F);
  Float before = hn::Set(df, -kFar), after = hn::Set(df, kFar);
  Float same = zero, same_moment = zero, near = zero, near_moment = zero, all = zero;
  for (std::size_t k = 0; k < lines.count; k += hn::Lanes(df)) {
    const Float du = hn::Sub(hn::LoadU(df, lines.u + k), u);
    const Float dv = hn::Sub(hn::LoadU(df, lines.v + k), v);
    const Float mu = hn::LoadU(df, lines.normal_u + k), mv = hn::LoadU(df, lines.normal_v + k);
    const Float across = hn::MulAdd(nu, du, hn::Mul(nv, dv));
    const Float along = hn::NegMulAdd(nv, du, hn::Mul(nu, dv));
    const Float parallel = hn::MulAdd(nu, mu, hn::Mul(nv, mv));
    const auto alike = hn::Gt(hn::Abs(parallel), hn::Set(df, kParallel));
    const auto around = hn::And(hn::Lt(hn::Abs(along), hn::Set(df, kWindow)), alike);
    if (hn::AllFalse(df, around)) continue;
    const auto beside = hn::And(hn::Lt(hn::Abs(along), hn::Set(df, kAlongside)), alike);
    const auto behind = hn::And(beside, hn::Lt(across, hn::Set(df, -kSame)));
    const auto ahead = hn::And(beside, hn::Gt(across, hn::Set(df, kSame)));
    before = hn::IfThenElse(behind, hn::Max(before, across), before);
    after = hn::IfThenElse(ahead, hn::Min(after, across), after);
    const Float size = hn::Abs(across), square = hn::Mul(across, across);
    const Float step = hn::IfThenElseZero(
        beside, hn::Mul(hn::CopySign(one, parallel), hn::LoadU(df, lines.step + k)));
    const Float on_line = hn::IfThenElseZero(hn::Lt(size, hn::Set(df, kSame)), step);
    same = hn::Add(same, on_line);
    same_moment = hn::MulAdd(on_line, across, same_moment);
    const auto fading = [&](float reach) HWY_ATTR {
      const Float share =
          hn::Max(zero, hn::NegMulAdd(square, hn::Set(df, 1 / (reach * reach)), one));
      return hn::Mul(share, share);
    };
    const Float blurred = hn::Mul(step, fading(kBlend));
    near = hn::Add(near, blurred);
    near_moment = hn::MulAdd(blurred, across, near_moment);
    const Float seen = hn::IfThenElseZero(around, hn::LoadU(df, lines.seen + k));
    const Float window = hn::NegMulAdd(hn::Abs(along), hn::Set(df, 1 / kWindow), one);
    all = hn::MulAdd(hn::Mul(seen, window), fading(kUnresolved), all);
  }
  const auto sum = [&](Float x) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(df, x)); };
  return {hn::GetLane(hn::MaxOfLanes(df, before)),
          hn::GetLane(hn::MinOfLanes(df, after)),
          sum(same),
          sum(same_moment),
          sum(near),
          sum(near_moment),
          sum(all)};
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(neighboursOf);

void ContourLines::clear() {
  count_ = 0;
  for (auto* values : {&u_, &v_, &normal_u_, &normal_v_, &step_, &seen_}) values->clear();
}

void ContourLines::add(float u, float v, float normal_u, float normal_v, float step, float seen) {
  u_.push_back(u);
  v_.push_back(v);
  normal_u_.push_back(normal_u);
  normal_v_.push_back(normal_v);
  step_.push_back(step);
  seen_.push_back(seen);
  ++count_;
}

/// Lines without a direction are beside nothing.
void ContourLines::pad() {
  const std::size_t whole = (count_ + 15) / 16 * 16;
  for (auto* values : {&u_, &v_, &normal_u_, &normal_v_, &step_, &seen_})
    values->resize(whole, 0.0F);
}

ContourLines::Neighbours ContourLines::neighbours(std::size_t i) {
  if (u_.size() % 16 != 0) pad();
  return HWY_DYNAMIC_DISPATCH(neighboursOf)(
      {u_.data(), v_.data(), normal_u_.data(), normal_v_.data(), step_.data(), seen_.data(),
       u_.size()},
      i);
}

}  // namespace leap_object_tracker
#endif
