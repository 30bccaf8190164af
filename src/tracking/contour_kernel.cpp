#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/contour_kernel.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.h.
#include <hwy/highway.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "leap_object_tracker/tracking/contour_kernel.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kBlock = 256;  // points at a time: what is kept of them fits the L1 cache
constexpr float kRounder = 0x1p23F;  // a float this large has no fraction: adding it rounds

/// What stays the same for all poses of a batch.
struct Eye {
  const std::uint8_t* cells;    ///< cell (0, 0) of plane 0
  float focal_length;           ///< [cells]
  float center_u, center_v;     ///< [cells]
  std::int32_t last_u, last_v;  ///< the last cell, as the bits of kRounder + cell
  std::int32_t row, plane;      ///< [bytes]
  std::int32_t origin;          ///< [bytes] what those bits add to an offset, negative
  float x;                      ///< [m]
  float scale;                  ///< nats of one grey step along a cell
};

Eye prepared(const EyeView& view, float independent_share) {
  const GainMap& map = *view.map;
  const auto bits = [](int cell) {
    const float value = kRounder + static_cast<float>(cell);
    std::int32_t result;
    std::memcpy(&result, &value, sizeof result);
    return result;
  };
  const auto zero = static_cast<std::uint32_t>(bits(0));
  return {map.first(),
          view.focal_length * map.cells_per_pixel,
          (view.center_u - map.origin_u) * map.cells_per_pixel,
          (view.center_v - map.origin_v) * map.cells_per_pixel,
          bits(map.width - 1),
          bits(map.height - 1),
          map.row_stride,
          map.plane_stride,
          static_cast<std::int32_t>(-zero * (1 + static_cast<std::uint32_t>(map.row_stride))),
          view.eye_x,
          map.nats_per_step / map.cells_per_pixel * independent_share};
}

/// What contour points look up in one eye, and what it counts.
struct Lookups {
  HWY_ALIGN std::uint32_t offsets[kBlock];  ///< [bytes] from cell (0, 0) of plane 0
  HWY_ALIGN float weights[kBlock];          ///< [cells] projected length
  HWY_ALIGN std::uint8_t gains[kBlock];
};

/// @param u, v place of points [cells], kRounder added
/// @param du, dv their tangents times their lengths [cells], times the depth
/// @param limits |dv| over the tangents of 11.25, 33.75, 56.25, 78.75 deg: where |du| is less, the
///        direction is beyond that angle
/// @param weight 1 / depth, zero for points that do not count
template <class D, class V>
HWY_INLINE void addLookups(D df, const Eye& eye, V u, V v, V du, V dv, V limit_1, V limit_2,
                           V limit_3, V limit_4, V weight, Lookups& lookups, std::size_t at) {
  const hn::RebindToSigned<D> di;
  hn::Store(hn::Mul(hn::Sqrt(hn::MulAdd(du, du, hn::Mul(dv, dv))), weight), df,
            lookups.weights + at);

  // Direction of the tangent in steps of 22.5 deg, 0 to 7.
  const auto size_u = hn::Abs(du);
  const auto one = hn::Set(di, 1);
  auto steps = hn::IfThenElseZero(hn::RebindMask(di, hn::Lt(size_u, limit_1)), one);
  steps = hn::IfThenElse(hn::RebindMask(di, hn::Lt(size_u, limit_2)), hn::Add(steps, one), steps);
  steps = hn::IfThenElse(hn::RebindMask(di, hn::Lt(size_u, limit_3)), hn::Add(steps, one), steps);
  steps = hn::IfThenElse(hn::RebindMask(di, hn::Lt(size_u, limit_4)), hn::Add(steps, one), steps);
  const auto falls = hn::ShiftRight<31>(hn::BitCast(di, hn::Xor(du, dv)));  // all bits or none
  steps = hn::Sub(hn::Xor(steps, falls), falls);
  const auto plane = hn::And(steps, hn::Set(di, 7));

  // Compared as integers, floats that are no numbers are bounded as well.
  const auto zero = hn::BitCast(di, hn::Set(df, kRounder));
  const auto column = hn::Min(hn::Max(hn::BitCast(di, u), zero), hn::Set(di, eye.last_u));
  const auto row = hn::Min(hn::Max(hn::BitCast(di, v), zero), hn::Set(di, eye.last_v));
  const auto in_plane =
      hn::Add(hn::Mul(row, hn::Set(di, eye.row)), hn::Add(column, hn::Set(di, eye.origin)));
  const hn::RebindToUnsigned<D> du32;
  hn::Store(hn::BitCast(du32, hn::Add(hn::Mul(plane, hn::Set(di, eye.plane)), in_plane)), du32,
            lookups.offsets + at);
}

/// One by one, the loads overtake the gather instructions of most processors.
HWY_INLINE void lookUp(const Eye& eye, std::size_t count, Lookups& lookups) {
#pragma GCC unroll 16
  for (std::size_t i = 0; i < count; ++i) lookups.gains[i] = eye.cells[lookups.offsets[i]];
}

/// Adds length times gain [cells, grey steps].
template <class D, class V = hn::Vec<D>>
HWY_INLINE V sumUp(D df, const Lookups& lookups, std::size_t begin, std::size_t count) {
  const hn::RebindToSigned<D> di;
  const hn::Rebind<std::uint8_t, D> bytes;
  const auto none = hn::Set(df, static_cast<float>(GainMap::kZero));
  auto sum = hn::Zero(df);
  for (std::size_t i = begin; i < begin + count; i += hn::Lanes(df)) {
    const auto gain = hn::ConvertTo(df, hn::PromoteTo(di, hn::Load(bytes, lookups.gains + i)));
    sum = hn::MulAdd(hn::Load(df, lookups.weights + i), hn::Sub(gain, none), sum);
  }
  return sum;
}

/// Lays down what one view looks up in one eye or, if both see the same view by the same focal
/// length in cells, in two: depths and rows of the contour are then the same, and its columns
/// differ by the baseline over the depth.
/// @param count a multiple of 16
/// @param r, t rotation, row by row, and translation of camera_from_object
/// @param place of the first point in the lookups
template <bool kStereo>
void layDown(const float* HWY_RESTRICT arrays, std::size_t points, std::size_t count,
             const std::array<float, 9>& r, const std::array<float, 3>& t, const Eye& first,
             const Eye& second, std::size_t place, Lookups& first_lookups,
             Lookups& second_lookups) {
  const hn::ScalableTag<float> df;
  // Rows of the projection to cells: u = (row_u * point) / (row_z * point).
  const auto row = [&](std::size_t k, std::size_t from, float focal, float center)
                       HWY_ATTR { return hn::Set(df, focal * r[from + k] + center * r[6 + k]); };
  const float focal = first.focal_length, center_u = first.center_u, center_v = first.center_v;
  const auto u0 = row(0, 0, focal, center_u), u1 = row(1, 0, focal, center_u);
  const auto u2 = row(2, 0, focal, center_u),
             u3 = hn::Set(df, focal * (t[0] - first.x) + center_u * t[2]);
  const auto v0 = row(0, 3, focal, center_v), v1 = row(1, 3, focal, center_v);
  const auto v2 = row(2, 3, focal, center_v), v3 = hn::Set(df, focal * t[1] + center_v * t[2]);
  const auto z0 = hn::Set(df, r[6]), z1 = hn::Set(df, r[7]), z2 = hn::Set(df, r[8]);
  const auto z3 = hn::Set(df, t[2]);
  const auto disparity = hn::Set(df, focal * (first.x - second.x));  // times the depth
  const auto shift_u = hn::Set(df, second.center_u - center_u);
  const auto shift_v = hn::Set(df, second.center_v - center_v);
  const auto nearest = hn::Set(df, 0.01F), two = hn::Set(df, 2.0F), rounder = hn::Set(df, kRounder);

  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    const float* at = arrays + i;
    const auto x = hn::LoadU(df, at), y = hn::LoadU(df, at + points);
    const auto z = hn::LoadU(df, at + 2 * points);
    const auto depth = hn::MulAdd(z0, x, hn::MulAdd(z1, y, hn::MulAdd(z2, z, z3)));
    const auto bounded = hn::Max(depth, nearest);
    const auto guess = hn::ApproximateReciprocal(bounded);
    const auto inverse = hn::Mul(guess, hn::NegMulAdd(bounded, guess, two));  // Newton's step
    const auto weight = hn::IfThenElseZero(hn::Gt(depth, nearest), inverse);
    const auto u = hn::Mul(hn::MulAdd(u0, x, hn::MulAdd(u1, y, hn::MulAdd(u2, z, u3))), inverse);
    const auto v = hn::Mul(hn::MulAdd(v0, x, hn::MulAdd(v1, y, hn::MulAdd(v2, z, v3))), inverse);

    // Tangent times length, projected: d(U/Z) = (dU - U/Z dZ) / Z.
    const auto a = hn::LoadU(df, at + 3 * points), b = hn::LoadU(df, at + 4 * points);
    const auto c = hn::LoadU(df, at + 5 * points);
    const auto along_u = hn::MulAdd(u0, a, hn::MulAdd(u1, b, hn::Mul(u2, c)));
    const auto along_v = hn::MulAdd(v0, a, hn::MulAdd(v1, b, hn::Mul(v2, c)));
    const auto along_z = hn::MulAdd(z0, a, hn::MulAdd(z1, b, hn::Mul(z2, c)));
    const auto dv = hn::NegMulAdd(v, along_z, along_v), size_v = hn::Abs(dv);
    const auto limit_1 = hn::Mul(size_v, hn::Set(df, 1 / 0.19891237F));
    const auto limit_2 = hn::Mul(size_v, hn::Set(df, 1 / 0.66817864F));
    const auto limit_3 = hn::Mul(size_v, hn::Set(df, 1 / 1.49660576F));
    const auto limit_4 = hn::Mul(size_v, hn::Set(df, 1 / 5.02733949F));

    addLookups(df, first, hn::Add(u, rounder), hn::Add(v, rounder),
               hn::NegMulAdd(u, along_z, along_u), dv, limit_1, limit_2, limit_3, limit_4, weight,
               first_lookups, place + i);
    if (!kStereo) continue;
    const auto moved = hn::MulAdd(disparity, inverse, u);
    addLookups(df, second, hn::Add(hn::Add(moved, shift_u), rounder),
               hn::Add(hn::Add(v, shift_v), rounder), hn::NegMulAdd(moved, along_z, along_u), dv,
               limit_1, limit_2, limit_3, limit_4, weight, second_lookups, place + i);
  }
}

/// Several poses at a time, in one eye or two: all points are laid down before the first is looked
/// up, and all looked up before the first sum, since numbers just written are slow to be read in
/// another width.
template <bool kStereo>
class Batch {
 public:
  Batch(const Eye& first, const Eye& second, float* log_likelihood)
      : first_(first), second_(second), log_likelihood_(log_likelihood) {}

  void add(std::size_t pose, const float* arrays, std::size_t points, std::size_t scored,
           const std::array<float, 9>& r, const std::array<float, 3>& t) {
    for (std::size_t begin = 0; begin < scored; begin += kBlock) {
      const std::size_t count = std::min(kBlock, scored - begin);
      if (used_ + count > kBlock) finish();
      layDown<kStereo>(arrays + begin, points, count, r, t, first_, second_, used_, first_lookups_,
                       second_lookups_);
      parts_[part_count_++] = {pose, used_, count};
      used_ += count;
    }
  }

  void finish() {
    const hn::ScalableTag<float> df;
    lookUp(first_, used_, first_lookups_);
    if (kStereo) lookUp(second_, used_, second_lookups_);
    for (std::size_t i = 0; i < part_count_; ++i) {
      const Part& part = parts_[i];
      auto sum =
          hn::Mul(hn::Set(df, first_.scale), sumUp(df, first_lookups_, part.begin, part.count));
      if (kStereo)
        sum = hn::MulAdd(hn::Set(df, second_.scale),
                         sumUp(df, second_lookups_, part.begin, part.count), sum);
      log_likelihood_[part.pose] += hn::GetLane(hn::SumOfLanes(df, sum));
    }
    used_ = part_count_ = 0;
  }

 private:
  struct Part {
    std::size_t pose, begin, count;
  };

  const Eye first_, second_;
  float* const log_likelihood_;
  std::size_t used_ = 0, part_count_ = 0;
  std::array<Part, kBlock / 16> parts_;
  Lookups first_lookups_, second_lookups_;
};

/// The pose turned about the object's z axis, as the choice wants it.
std::array<float, 9> turned(const std::array<float, 9>& r, const ViewChoice& choice) {
  std::array<float, 9> result;
  for (std::size_t k = 0; k < 9; k += 3) {
    result[k] = choice.cosine * r[k] + choice.sine * r[k + 1];
    result[k + 1] = choice.cosine * r[k + 1] - choice.sine * r[k];
    result[k + 2] = r[k + 2];
  }
  return result;
}

void scorePoses(const ContourModel& model, std::size_t points, const EyeView* views,
                std::size_t view_count, float independent_share, const ParticlePose* poses,
                std::size_t count, float* log_likelihood) {
  std::array<Eye, 2> eyes{};
  std::size_t eye_count = 0;
  for (std::size_t i = 0; i < std::min<std::size_t>(view_count, eyes.size()); ++i)
    if (views[i].map != nullptr) eyes[eye_count++] = prepared(views[i], independent_share);
  const auto entries = static_cast<std::size_t>(model.points());
  Batch<true> both(eyes[0], eyes[1], log_likelihood);
  std::array<Batch<false>, 2> single{Batch<false>(eyes[0], eyes[0], log_likelihood),
                                     Batch<false>(eyes[1], eyes[1], log_likelihood)};
  const auto same = [](const ViewChoice& a, const ViewChoice& b) {
    return a.view == b.view && a.cosine == b.cosine && a.sine == b.sine;
  };

  std::fill(log_likelihood, log_likelihood + count, 0.0F);
  for (std::size_t i = 0; i < count; ++i) {
    const std::array<float, 9>& r = poses[i].rotation;
    const std::array<float, 3>& t = poses[i].translation;
    const float y = t[1], z = t[2];
    std::array<ViewChoice, 2> choices;
    for (std::size_t e = 0; e < eye_count; ++e) {
      const float x = t[0] - eyes[e].x;
      choices[e] =
          model.choose({-(r[0] * x + r[3] * y + r[6] * z), -(r[1] * x + r[4] * y + r[7] * z),
                        -(r[2] * x + r[5] * y + r[8] * z)});
      if (choices[e].view != nullptr && choices[e].view->arrays.empty()) choices[e].view = nullptr;
    }
    if (choices[0].view != nullptr && same(choices[0], choices[1]) &&
        eyes[0].focal_length == eyes[1].focal_length) {
      both.add(i, choices[0].view->arrays.data(), entries, points, turned(r, choices[0]), t);
      continue;
    }
    for (std::size_t e = 0; e < eye_count; ++e)
      if (choices[e].view != nullptr)
        single[e].add(i, choices[e].view->arrays.data(), entries, points, turned(r, choices[e]), t);
  }
  both.finish();
  for (auto& batch : single) batch.finish();
  for (std::size_t i = 0; i < count; ++i)
    if (!std::isfinite(log_likelihood[i])) log_likelihood[i] = 0;
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <atomic>
#include <stdexcept>

namespace leap_object_tracker {

HWY_EXPORT(scorePoses);

void scoreContours(const ContourModel& model, int points, const EyeView* eyes,
                   std::size_t eye_count, float independent_share, const ParticlePose* poses,
                   std::size_t count, float* log_likelihood) {
  const auto scored = static_cast<std::size_t>(std::clamp(points, 16, model.points()) / 16 * 16);
  HWY_DYNAMIC_DISPATCH(scorePoses)
  (model, scored, eyes, eye_count, independent_share, poses, count, log_likelihood);
}

std::vector<std::string> contourKernelTargets() {
  std::vector<std::string> names;
  for (const auto target : hwy::SupportedAndGeneratedTargets())
    names.emplace_back(hwy::TargetName(target));
  return names;
}

void useContourKernelTarget(const std::string& name) {
  hwy::SetSupportedTargetsForTest(0);
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  if (name.empty()) return;
  for (const auto target : hwy::SupportedAndGeneratedTargets())
    if (name == hwy::TargetName(target)) {
      hwy::SetSupportedTargetsForTest(target);
      hwy::GetChosenTarget().Update(hwy::SupportedTargets());
      return;
    }
  throw std::invalid_argument("this machine has no instruction set '" + name + "'");
}

ParticlePose toParticlePose(const Pose& camera_from_object) {
  ParticlePose pose;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      pose.rotation[static_cast<std::size_t>(3 * row + column)] =
          static_cast<float>(camera_from_object.linear()(row, column));
    pose.translation[static_cast<std::size_t>(row)] =
        static_cast<float>(camera_from_object.translation()[row]);
  }
  return pose;
}

Pose toPose(const ParticlePose& particle) {
  Pose pose = Pose::Identity();
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      pose.linear()(row, column) = particle.rotation[static_cast<std::size_t>(3 * row + column)];
    pose.translation()[row] = particle.translation[static_cast<std::size_t>(row)];
  }
  return normalized(pose);
}

}  // namespace leap_object_tracker
#endif
