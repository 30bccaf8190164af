#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/contour_kernel.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.h.
#include <hwy/highway.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "leap_object_tracker/tracking/contour_kernel.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Sum of projected length times gain of one view in one eye, in grey steps times cells.
/// @param r camera_from_object, row by row, @param t its translation in the frame of this eye
float scoreView(const float* HWY_RESTRICT arrays, std::size_t points, std::size_t scored,
                const float* HWY_RESTRICT r, const float* HWY_RESTRICT t, const EyeView& eye) {
  const hn::ScalableTag<float> df;
  const hn::RebindToSigned<decltype(df)> di;
  const std::size_t lanes = hn::Lanes(df);

  const GainMap& map = *eye.map;
  const auto focal = hn::Set(df, eye.focal_length * map.cells_per_pixel);
  const auto shift_u = hn::Set(df, (eye.center_u - map.origin_u) * map.cells_per_pixel + 0.5F);
  const auto shift_v = hn::Set(df, (eye.center_v - map.origin_v) * map.cells_per_pixel + 0.5F);
  const auto last_u = hn::Set(df, static_cast<float>(map.width) - 0.5F);
  const auto last_v = hn::Set(df, static_cast<float>(map.height) - 0.5F);
  const auto row_stride = hn::Set(di, map.row_stride);
  const auto plane_stride = hn::Set(di, map.plane_stride);
  const auto nearest = hn::Set(df, 0.01F);
  const auto zero = hn::Zero(df), one = hn::Set(df, 1.0F);
  // Limits between the directions: tan of 11.25, 33.75, 56.25, 78.75 deg.
  const auto limit_1 = hn::Set(df, 0.19891237F), limit_2 = hn::Set(df, 0.66817864F);
  const auto limit_3 = hn::Set(df, 1.49660576F), limit_4 = hn::Set(df, 5.02733949F);
  const auto minus_one = hn::Set(di, -1), eight = hn::Set(di, 8), seven = hn::Set(di, 7);
  const auto byte = hn::Set(di, 255);
  const auto* base = reinterpret_cast<const std::int32_t*>(map.first());

  const auto r0 = hn::Set(df, r[0]), r1 = hn::Set(df, r[1]), r2 = hn::Set(df, r[2]);
  const auto r3 = hn::Set(df, r[3]), r4 = hn::Set(df, r[4]), r5 = hn::Set(df, r[5]);
  const auto r6 = hn::Set(df, r[6]), r7 = hn::Set(df, r[7]), r8 = hn::Set(df, r[8]);
  const auto t0 = hn::Set(df, t[0]), t1 = hn::Set(df, t[1]), t2 = hn::Set(df, t[2]);

  auto sum = hn::Zero(df);
  for (std::size_t i = 0; i < scored; i += lanes) {
    const auto x = hn::LoadU(df, arrays + i);
    const auto y = hn::LoadU(df, arrays + points + i);
    const auto z = hn::LoadU(df, arrays + 2 * points + i);
    const auto a = hn::LoadU(df, arrays + 3 * points + i);
    const auto b = hn::LoadU(df, arrays + 4 * points + i);
    const auto c = hn::LoadU(df, arrays + 5 * points + i);
    const auto depth = hn::MulAdd(r6, x, hn::MulAdd(r7, y, hn::MulAdd(r8, z, t2)));
    const auto in_front = hn::Gt(depth, nearest);
    const auto inverse = hn::Div(one, hn::Max(depth, nearest));
    const auto slope_x =
        hn::Mul(hn::MulAdd(r0, x, hn::MulAdd(r1, y, hn::MulAdd(r2, z, t0))), inverse);
    const auto slope_y =
        hn::Mul(hn::MulAdd(r3, x, hn::MulAdd(r4, y, hn::MulAdd(r5, z, t1))), inverse);

    // Tangent times length, projected: d(X/Z) = (dX - X/Z dZ) / Z.
    const auto along_x = hn::MulAdd(r0, a, hn::MulAdd(r1, b, hn::Mul(r2, c)));
    const auto along_y = hn::MulAdd(r3, a, hn::MulAdd(r4, b, hn::Mul(r5, c)));
    const auto along_z = hn::MulAdd(r6, a, hn::MulAdd(r7, b, hn::Mul(r8, c)));
    const auto scale = hn::Mul(focal, inverse);
    const auto du = hn::Mul(hn::NegMulAdd(slope_x, along_z, along_x), scale);
    const auto dv = hn::Mul(hn::NegMulAdd(slope_y, along_z, along_y), scale);
    const auto size_u = hn::Abs(du), size_v = hn::Abs(dv);
    const auto length = hn::Sqrt(hn::MulAdd(du, du, hn::Mul(dv, dv)));

    // Direction of the tangent in steps of 22.5 deg, 0 to 7.
    auto steps =
        hn::IfThenElseZero(hn::RebindMask(di, hn::Gt(size_v, hn::Mul(limit_1, size_u))), minus_one);
    steps = hn::Add(
        steps, hn::VecFromMask(di, hn::RebindMask(di, hn::Gt(size_v, hn::Mul(limit_2, size_u)))));
    steps = hn::Add(
        steps, hn::VecFromMask(di, hn::RebindMask(di, hn::Gt(size_v, hn::Mul(limit_3, size_u)))));
    steps = hn::Add(
        steps, hn::VecFromMask(di, hn::RebindMask(di, hn::Gt(size_v, hn::Mul(limit_4, size_u)))));
    const auto falling = hn::RebindMask(di, hn::Lt(hn::Mul(du, dv), zero));
    const auto plane = hn::And(
        hn::IfThenElse(falling, hn::Add(eight, steps), hn::Sub(hn::Zero(di), steps)), seven);

    const auto column =
        hn::ConvertTo(di, hn::Min(hn::Max(hn::MulAdd(focal, slope_x, shift_u), zero), last_u));
    const auto row =
        hn::ConvertTo(di, hn::Min(hn::Max(hn::MulAdd(focal, slope_y, shift_v), zero), last_v));
    const auto offset =
        hn::Add(hn::Add(hn::Mul(plane, plane_stride), hn::Mul(row, row_stride)), column);
    const auto gain = hn::And(hn::GatherOffset(di, base, offset), byte);
    const auto centred =
        hn::Sub(hn::ConvertTo(df, gain), hn::Set(df, static_cast<float>(GainMap::kZero)));
    sum = hn::MulAdd(hn::IfThenElseZero(in_front, length), centred, sum);
  }
  return hn::GetLane(hn::SumOfLanes(df, sum));
}

void scorePoses(const ContourModel& model, std::size_t points, const EyeView* eyes,
                std::size_t eye_count, float independent_share, const ParticlePose* poses,
                std::size_t count, float* log_likelihood) {
  for (std::size_t i = 0; i < count; ++i) {
    const float* r = poses[i].rotation.data();
    float total = 0;
    for (std::size_t e = 0; e < eye_count; ++e) {
      const EyeView& eye = eyes[e];
      if (eye.map == nullptr) continue;
      const float t[3] = {poses[i].translation[0] - eye.eye_x, poses[i].translation[1],
                          poses[i].translation[2]};
      const Eigen::Vector3f place(-(r[0] * t[0] + r[3] * t[1] + r[6] * t[2]),
                                  -(r[1] * t[0] + r[4] * t[1] + r[7] * t[2]),
                                  -(r[2] * t[0] + r[5] * t[1] + r[8] * t[2]));
      const ViewChoice choice = model.choose(place);
      if (choice.view == nullptr || choice.view->arrays.empty()) continue;
      float turned[9];
      for (int k = 0; k < 9; k += 3) {
        turned[k] = choice.cosine * r[k] + choice.sine * r[k + 1];
        turned[k + 1] = choice.cosine * r[k + 1] - choice.sine * r[k];
        turned[k + 2] = r[k + 2];
      }
      const float sum = scoreView(choice.view->arrays.data(),
                                  static_cast<std::size_t>(model.points()), points, turned, t, eye);
      total += sum * eye.map->nats_per_step / eye.map->cells_per_pixel;
    }
    log_likelihood[i] = std::isfinite(total) ? total * independent_share : 0.0F;
  }
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
