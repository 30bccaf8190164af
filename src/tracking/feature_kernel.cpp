#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/feature_kernel.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own headers after foreach_target.h.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <cmath>

#include "leap_object_tracker/tracking/feature_kernel.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::ScalableTag<float>;
using Float = hn::Vec<Floats>;

HWY_INLINE Float positive(Float x) { return hn::Max(x, hn::Zero(Floats())); }

/// log(1 + exp(x))
HWY_INLINE Float softplus(Float x) {
  const Floats df;
  return hn::Add(positive(x), hn::Log1p(df, hn::Exp(df, hn::Neg(hn::Abs(x)))));
}

HWY_INLINE Float length(Float x, Float y) { return hn::Sqrt(hn::MulAdd(x, x, hn::Mul(y, y))); }

// As the scalar functions of the same names in signed_distance.cpp.

HWY_INLINE Float boxDistance(Float x, Float y, Float z, const Eigen::Vector3f& half) {
  const Floats df;
  const auto a = hn::Sub(hn::Abs(x), hn::Set(df, half.x()));
  const auto b = hn::Sub(hn::Abs(y), hn::Set(df, half.y()));
  const auto c = hn::Sub(hn::Abs(z), hn::Set(df, half.z()));
  const auto p = positive(a), q = positive(b), r = positive(c);
  const auto outside = hn::Sqrt(hn::MulAdd(p, p, hn::MulAdd(q, q, hn::Mul(r, r))));
  return hn::Add(outside, hn::Min(hn::Max(a, hn::Max(b, c)), hn::Zero(df)));
}

HWY_INLINE Float ofExtrusion(Float planar, Float axial) {
  const auto outside = length(positive(planar), positive(axial));
  return hn::Add(outside, hn::Min(hn::Max(planar, axial), hn::Zero(Floats())));
}

/// Distance of (x, y) from the segment from (x0, y0) to (x1, y1).
HWY_INLINE Float toSegment(Float x, Float y, float x0, float y0, float x1, float y1) {
  const Floats df;
  const float along_x = x1 - x0, along_y = y1 - y0;
  const float square = along_x * along_x + along_y * along_y;
  const auto from_x = hn::Sub(x, hn::Set(df, x0)), from_y = hn::Sub(y, hn::Set(df, y0));
  auto share = hn::MulAdd(from_x, hn::Set(df, along_x / square),
                          hn::Mul(from_y, hn::Set(df, along_y / square)));
  share = hn::Min(positive(share), hn::Set(df, 1.0F));
  return length(hn::NegMulAdd(share, hn::Set(df, along_x), from_x),
                hn::NegMulAdd(share, hn::Set(df, along_y), from_y));
}

HWY_INLINE Float triangleDistance(Float x, Float y, float side) {
  const Floats df;
  const float inner = side / (2 * std::sqrt(3.0F));
  x = hn::Abs(x);
  const auto slope = hn::MulAdd(x, hn::Set(df, std::sqrt(3.0F) / 2),
                                hn::MulSub(y, hn::Set(df, 0.5F), hn::Set(df, inner)));
  const auto inside = hn::Max(slope, hn::Neg(hn::Add(y, hn::Set(df, inner))));
  const auto outside = hn::Min(toSegment(x, y, 0, 2 * inner, side / 2, -inner),
                               toSegment(x, y, 0, -inner, side / 2, -inner));
  return hn::IfThenElse(hn::Le(inside, hn::Zero(df)), inside, outside);
}

HWY_INLINE Float distanceFrom(const SignedDistance& surface, Float x, Float y, Float z) {
  const Floats df;
  const Eigen::Vector3f& half = surface.half();
  const auto axial = [&]() HWY_ATTR { return hn::Sub(hn::Abs(z), hn::Set(df, half.y())); };
  switch (surface.shape()) {
    case Shape::kBox:
      return boxDistance(x, y, z, half);
    case Shape::kCylinder:
      return ofExtrusion(hn::Sub(length(x, y), hn::Set(df, 2 * half.x())), axial());
    case Shape::kPrism:
      return ofExtrusion(triangleDistance(x, y, 2 * half.x()), axial());
    case Shape::kMesh:
      break;
  }
  constexpr std::size_t kMost = hn::MaxLanes(df);
  HWY_ALIGN float at[3][kMost];
  HWY_ALIGN float distances[kMost];
  hn::Store(x, df, at[0]), hn::Store(y, df, at[1]), hn::Store(z, df, at[2]);
  for (std::size_t i = 0; i < hn::Lanes(df); ++i)
    distances[i] = surface({at[0][i], at[1][i], at[2][i]});
  return hn::Load(df, distances);
}

HWY_INLINE Float dot(float a, float b, float c, Float x, Float y, Float z) {
  const Floats df;
  return hn::MulAdd(hn::Set(df, a), x, hn::MulAdd(hn::Set(df, b), y, hn::Mul(hn::Set(df, c), z)));
}

float scoreOne(const FeatureArrays& points, const SignedDistance& surface,
               const ParticlePose& pose) {
  const Floats df;
  const auto& r = pose.rotation;
  const auto shift_x = hn::Set(df, pose.translation[0]), shift_y = hn::Set(df, pose.translation[1]);
  const auto shift_z = hn::Set(df, pose.translation[2]);
  const auto minus_half = hn::Set(df, -0.5F);
  auto sum = hn::Zero(df);
  for (std::size_t i = 0; i < points.surface(0).size(); i += hn::Lanes(df)) {
    const auto number = [&](std::size_t k)
                            HWY_ATTR { return hn::LoadU(df, points.surface(k).data() + i); };
    const auto x = hn::Sub(number(0), shift_x), y = hn::Sub(number(1), shift_y);
    const auto z = hn::Sub(number(2), shift_z);
    const auto distance =
        distanceFrom(surface, dot(r[0], r[3], r[6], x, y, z), dot(r[1], r[4], r[7], x, y, z),
                     dot(r[2], r[5], r[8], x, y, z));
    const auto square = hn::Mul(hn::Mul(distance, distance), number(3));
    sum = hn::Add(sum, softplus(hn::MulAdd(square, minus_half, number(4))));
  }
  for (std::size_t i = 0; i < points.landmark(0).size(); i += hn::Lanes(df)) {
    const auto number = [&](std::size_t k)
                            HWY_ATTR { return hn::LoadU(df, points.landmark(k).data() + i); };
    const auto u = number(3), v = number(4), w = number(5);
    const auto x = hn::Sub(hn::Sub(number(0), shift_x), dot(r[0], r[1], r[2], u, v, w));
    const auto y = hn::Sub(hn::Sub(number(1), shift_y), dot(r[3], r[4], r[5], u, v, w));
    const auto z = hn::Sub(hn::Sub(number(2), shift_z), dot(r[6], r[7], r[8], u, v, w));
    // The products off the diagonal stand for two.
    const auto square =
        hn::MulAdd(x, hn::MulAdd(number(6), x, hn::MulAdd(number(7), y, hn::Mul(number(8), z))),
                   hn::MulAdd(y, hn::MulAdd(number(9), y, hn::Mul(number(10), z)),
                              hn::Mul(hn::Mul(number(11), z), z)));
    sum = hn::Add(sum, softplus(hn::MulAdd(square, minus_half, number(12))));
  }
  return hn::GetLane(hn::SumOfLanes(df, sum));
}

void scoreAll(const FeatureArrays& points, const SignedDistance& surface, float share,
              const ParticlePose* poses, std::size_t count, float* log_likelihood) {
  for (std::size_t i = 0; i < count; ++i)
    log_likelihood[i] = share * scoreOne(points, surface, poses[i]);
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(scoreAll);

void scoreFeatures(const FeatureArrays& points, const SignedDistance& surface, float share,
                   const ParticlePose* poses, std::size_t count, float* log_likelihood) {
  HWY_DYNAMIC_DISPATCH(scoreAll)(points, surface, share, poses, count, log_likelihood);
}

namespace {

template <std::size_t kNumbers>
void append(const std::array<float, kNumbers>& values,
            std::array<std::vector<float>, kNumbers>& arrays) {
  for (std::size_t k = 0; k < kNumbers; ++k) arrays[k].push_back(values[k]);
}

template <std::size_t kNumbers>
void padWith(const std::array<float, kNumbers>& values,
             std::array<std::vector<float>, kNumbers>& arrays) {
  constexpr std::size_t kMultiple = 16;  // as many as the widest registers hold
  while (arrays.front().size() % kMultiple != 0) append(values, arrays);
}

}  // namespace

void FeatureArrays::clear() {
  for (auto& array : surface_) array.clear();
  for (auto& array : landmark_) array.clear();
}

void FeatureArrays::addSurfacePoint(const Eigen::Vector3f& in_camera, float variance, float peak) {
  append<kSurfaceNumbers>({in_camera.x(), in_camera.y(), in_camera.z(), 1 / variance, peak},
                          surface_);
}

void FeatureArrays::addLandmark(const Eigen::Vector3f& in_camera, const Eigen::Vector3f& landmark,
                                const Eigen::Matrix3f& information, float peak) {
  append<kLandmarkNumbers>(
      {in_camera.x(), in_camera.y(), in_camera.z(), landmark.x(), landmark.y(), landmark.z(),
       information(0, 0), 2 * information(0, 1), 2 * information(0, 2), information(1, 1),
       2 * information(1, 2), information(2, 2), peak},
      landmark_);
}

void FeatureArrays::pad() {
  padWith<kSurfaceNumbers>({0, 0, 0, 0, kNothing}, surface_);
  std::array<float, kLandmarkNumbers> nothing{};
  nothing.back() = kNothing;
  padWith(nothing, landmark_);
}

}  // namespace leap_object_tracker
#endif
