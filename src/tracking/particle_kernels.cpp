#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/particle_kernels.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own headers after foreach_target.h.
#include <hwy/contrib/math/math-inl.h>
#include <hwy/highway.h>

#include <algorithm>

#include "leap_object_tracker/tracking/particle_kernels.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t kBlock = 64;  // particles at a time, a multiple of all numbers of lanes
using Floats = hn::ScalableTag<float>;
using Float = hn::Vec<Floats>;

/// The numbers of a block, number k of all particles side by side.
template <std::size_t kNumbers>
struct Block {
  HWY_ALIGN float at[kNumbers][kBlock];

  template <class T>
  void load(const T* values, std::size_t count) {
    static_assert(sizeof(T) == kNumbers * sizeof(float), "floats and nothing else");
    const auto* from = reinterpret_cast<const float*>(values);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t k = 0; k < kNumbers; ++k) at[k][i] = from[kNumbers * i + k];
    for (std::size_t i = count; i < kBlock; ++i)
      for (std::size_t k = 0; k < kNumbers; ++k) at[k][i] = 0;
  }
  template <class T>
  void store(T* values, std::size_t count) const {
    auto* to = reinterpret_cast<float*>(values);
    for (std::size_t i = 0; i < count; ++i)
      for (std::size_t k = 0; k < kNumbers; ++k) to[kNumbers * i + k] = at[k][i];
  }
};

/// Rotation row by row, then the translation.
using PoseBlock = Block<12>;
using TwistBlock = Block<6>;

std::uint64_t mixed(std::uint64_t x) {
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
  return x ^ (x >> 31);
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE V hashed(D du, V x, std::uint64_t key) {
  x = hn::Add(x, hn::Set(du, static_cast<std::uint32_t>(key)));
  x = hn::Mul(hn::Xor(x, hn::ShiftRight<17>(x)), hn::Set(du, 0xed5ad4bbU));
  x = hn::Xor(x, hn::Set(du, static_cast<std::uint32_t>(key >> 32)));
  x = hn::Mul(hn::Xor(x, hn::ShiftRight<11>(x)), hn::Set(du, 0xac4c1b51U));
  x = hn::Mul(hn::Xor(x, hn::ShiftRight<15>(x)), hn::Set(du, 0x31848babU));
  return hn::Xor(x, hn::ShiftRight<14>(x));
}

void drawNormals(const NormalStream& stream, std::size_t first, std::size_t count,
                 TwistBlock& normals) {
  const Floats df;
  const hn::RebindToUnsigned<Floats> du;
  const hn::RebindToSigned<Floats> di;
  const std::uint64_t key = mixed(mixed(mixed(stream.seed) + stream.draw) + 1);
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    const auto index = hn::Iota(du, static_cast<std::uint32_t>(first + i));
    const auto counter = hn::Mul(index, hn::Set(du, 6));
    const auto uniform = [&](std::uint32_t k) HWY_ATTR {  // [0, 2^24)
      const auto bits = hashed(du, hn::Add(counter, hn::Set(du, k)), key);
      return hn::ConvertTo(df, hn::BitCast(di, hn::ShiftRight<8>(bits)));
    };
    for (std::uint32_t k = 0; k < 6; k += 2) {
      const auto share = hn::Mul(hn::Add(uniform(k), hn::Set(df, 0.5F)), hn::Set(df, 0x1p-24F));
      const auto radius = hn::Sqrt(hn::Mul(hn::Set(df, -2.0F), hn::Log(df, share)));
      const auto angle = hn::Mul(uniform(k + 1), hn::Set(df, 6.2831853F * 0x1p-24F));
      hn::Store(hn::Mul(radius, hn::Cos(df, angle)), df, normals.at[k] + i);
      hn::Store(hn::Mul(radius, hn::Sin(df, angle)), df, normals.at[k + 1] + i);
    }
  }
}

/// Horner's scheme.
template <std::size_t kCount>
HWY_INLINE Float polynomial(Float x, const float (&coefficients)[kCount]) {
  const Floats df;
  auto sum = hn::Set(df, coefficients[0]);
  for (std::size_t k = 1; k < kCount; ++k) sum = hn::MulAdd(sum, x, hn::Set(df, coefficients[k]));
  return sum;
}

HWY_INLINE Float dot(Float a, Float b, Float c, Float x, Float y, Float z) {
  return hn::MulAdd(a, x, hn::MulAdd(b, y, hn::Mul(c, z)));
}

/// Translates, turns (Rodrigues) and squares up, against the drift of many products.
void movePoses(const TwistBlock& twists, std::size_t count, PoseBlock& poses) {
  // (1 - cos a) / a^2 and sin a / a by a^2: Taylor, good to single precision until a = 4.
  static constexpr float kVersed[] = {8.8967914e-22F,
                                      -4.1103176e-19F,
                                      1.5619207e-16F,
                                      -4.7794773e-14F,
                                      1.1470746e-11F,
                                      -2.0876757e-09F,
                                      2.7557319e-07F,
                                      -2.4801587e-05F,
                                      0.0013888889F,
                                      -0.041666667F,
                                      0.5F};
  static constexpr float kSine[] = {1.9572941e-20F,
                                    -8.2206352e-18F,
                                    2.8114573e-15F,
                                    -7.6471637e-13F,
                                    1.6059044e-10F,
                                    -2.5052108e-08F,
                                    2.7557319e-06F,
                                    -0.0001984127F,
                                    0.0083333333F,
                                    -0.16666667F,
                                    1.0F};
  const Floats df;
  const auto one = hn::Set(df, 1.0F);
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    for (std::size_t k = 0; k < 3; ++k)
      hn::Store(hn::Add(hn::Load(df, poses.at[9 + k] + i), hn::Load(df, twists.at[k] + i)), df,
                poses.at[9 + k] + i);
    const auto x = hn::Load(df, twists.at[3] + i), y = hn::Load(df, twists.at[4] + i);
    const auto z = hn::Load(df, twists.at[5] + i);
    const auto xx = hn::Mul(x, x), yy = hn::Mul(y, y), zz = hn::Mul(z, z);
    const auto angle2 = hn::Add(xx, hn::Add(yy, zz));
    const auto c = polynomial(angle2, kVersed), s = polynomial(angle2, kSine);
    const auto cx = hn::Mul(c, x), cy = hn::Mul(c, y), cxy = hn::Mul(cx, y);
    const auto cxz = hn::Mul(cx, z), cyz = hn::Mul(cy, z);
    const auto sx = hn::Mul(s, x), sy = hn::Mul(s, y), sz = hn::Mul(s, z);
    const auto a0 = hn::NegMulAdd(c, hn::Add(yy, zz), one), a1 = hn::Sub(cxy, sz);
    const auto a2 = hn::Add(cxz, sy), b0 = hn::Add(cxy, sz);
    const auto b1 = hn::NegMulAdd(c, hn::Add(xx, zz), one), b2 = hn::Sub(cyz, sx);

    const auto entry = [&](std::size_t k) HWY_ATTR { return hn::Load(df, poses.at[k] + i); };
    const auto r0 = entry(0), r1 = entry(1), r2 = entry(2), r3 = entry(3), r4 = entry(4);
    const auto r5 = entry(5), r6 = entry(6), r7 = entry(7), r8 = entry(8);
    auto p0 = dot(a0, a1, a2, r0, r3, r6), p1 = dot(a0, a1, a2, r1, r4, r7);
    auto p2 = dot(a0, a1, a2, r2, r5, r8);
    auto q0 = dot(b0, b1, b2, r0, r3, r6), q1 = dot(b0, b1, b2, r1, r4, r7);
    auto q2 = dot(b0, b1, b2, r2, r5, r8);
    // Gram and Schmidt on the first two rows; the third is their product.
    const auto first = hn::Div(one, hn::Sqrt(dot(p0, p1, p2, p0, p1, p2)));
    p0 = hn::Mul(p0, first), p1 = hn::Mul(p1, first), p2 = hn::Mul(p2, first);
    const auto shared = dot(p0, p1, p2, q0, q1, q2);
    q0 = hn::NegMulAdd(shared, p0, q0), q1 = hn::NegMulAdd(shared, p1, q1);
    q2 = hn::NegMulAdd(shared, p2, q2);
    const auto second = hn::Div(one, hn::Sqrt(dot(q0, q1, q2, q0, q1, q2)));
    q0 = hn::Mul(q0, second), q1 = hn::Mul(q1, second), q2 = hn::Mul(q2, second);
    const auto put = [&](Float value, std::size_t k)
                         HWY_ATTR { hn::Store(value, df, poses.at[k] + i); };
    put(p0, 0), put(p1, 1), put(p2, 2), put(q0, 3), put(q1, 4), put(q2, 5);
    put(hn::MulSub(p1, q2, hn::Mul(p2, q1)), 6);
    put(hn::MulSub(p2, q0, hn::Mul(p0, q2)), 7);
    put(hn::MulSub(p0, q1, hn::Mul(p1, q0)), 8);
  }
}

/// Three numbers, side by side, times a matrix from the left.
template <class B>
HWY_INLINE void turnColumn(const std::array<float, 9>& turn, std::size_t i, std::size_t from,
                           std::size_t stride, B& block) {
  const Floats df;
  const auto x = hn::Load(df, block.at[from] + i), y = hn::Load(df, block.at[from + stride] + i);
  const auto z = hn::Load(df, block.at[from + 2 * stride] + i);
  for (std::size_t k = 0; k < 3; ++k)
    hn::Store(dot(hn::Set(df, turn[3 * k]), hn::Set(df, turn[3 * k + 1]),
                  hn::Set(df, turn[3 * k + 2]), x, y, z),
              df, block.at[from + stride * k] + i);
}

void turnWithCamera(const ParticleStep& step, std::size_t count, PoseBlock& poses,
                    TwistBlock& velocities) {
  const Floats df;
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    for (std::size_t column = 0; column < 3; ++column) turnColumn(step.turn, i, column, 3, poses);
    turnColumn(step.turn, i, 9, 1, poses);
    for (std::size_t k = 0; k < 3; ++k)
      hn::Store(hn::Add(hn::Load(df, poses.at[9 + k] + i), hn::Set(df, step.shift[k])), df,
                poses.at[9 + k] + i);
    turnColumn(step.turn, i, 0, 1, velocities);
    turnColumn(step.turn, i, 3, 1, velocities);
  }
}

void predictAll(const ParticleStep& step, const NormalStream& stream, std::size_t first,
                std::size_t count, ParticlePose* poses, ParticleTwist* velocities) {
  const Floats df;
  const auto seconds = hn::Set(df, step.seconds), half = hn::Set(df, 0.5F * step.seconds);
  const auto kept = hn::Set(df, step.kept_velocity);
  PoseBlock pose;
  TwistBlock velocity, normals;
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t size = std::min(kBlock, count - begin);
    pose.load(poses + begin, size);
    velocity.load(velocities + begin, size);
    if (step.camera_moved) turnWithCamera(step, size, pose, velocity);
    drawNormals(stream, first + begin, size, normals);
    for (std::size_t i = 0; i < size; i += hn::Lanes(df))
      for (std::size_t k = 0; k < 6; ++k) {
        const auto acceleration =
            hn::Mul(hn::Load(df, normals.at[k] + i), hn::Set(df, step.acceleration[k]));
        const auto before = hn::Load(df, velocity.at[k] + i);
        // The twist takes the place of the numbers that it came from.
        hn::Store(hn::Mul(hn::MulAdd(acceleration, half, before), seconds), df, normals.at[k] + i);
        hn::Store(hn::MulAdd(kept, before, hn::Mul(acceleration, seconds)), df, velocity.at[k] + i);
      }
    movePoses(normals, size, pose);
    pose.store(poses + begin, size);
    velocity.store(velocities + begin, size);
  }
}

void spreadAll(const ParticleTwist& deviations, const NormalStream& stream, std::size_t first,
               std::size_t count, ParticlePose* poses) {
  const Floats df;
  PoseBlock pose;
  TwistBlock twists;
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t size = std::min(kBlock, count - begin);
    pose.load(poses + begin, size);
    drawNormals(stream, first + begin, size, twists);
    for (std::size_t i = 0; i < size; i += hn::Lanes(df))
      for (std::size_t k = 0; k < 6; ++k)
        hn::Store(hn::Mul(hn::Load(df, twists.at[k] + i), hn::Set(df, deviations[k])), df,
                  twists.at[k] + i);
    movePoses(twists, size, pose);
    pose.store(poses + begin, size);
  }
}

/// mean + root * normals
void correlate(const std::array<float, 36>& root, const ParticleTwist& mean, std::size_t count,
               const TwistBlock& normals, TwistBlock& twists) {
  const Floats df;
  for (std::size_t i = 0; i < count; i += hn::Lanes(df))
    for (std::size_t row = 0; row < 6; ++row) {
      auto sum = hn::Set(df, mean[row]);
      for (std::size_t k = 0; k < 6; ++k)
        sum = hn::MulAdd(hn::Set(df, root[6 * row + k]), hn::Load(df, normals.at[k] + i), sum);
      hn::Store(sum, df, twists.at[row] + i);
    }
}

void drawAll(const ParticleGaussian& gaussian, const NormalStream& of_poses,
             const NormalStream& of_velocities, std::size_t first, std::size_t count,
             ParticlePose* poses, ParticleTwist* velocities) {
  const Floats df;
  PoseBlock pose;
  TwistBlock normals, twists;
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t size = std::min(kBlock, count - begin);
    for (std::size_t k = 0; k < 12; ++k) {
      const auto value =
          hn::Set(df, k < 9 ? gaussian.mean.rotation[k] : gaussian.mean.translation[k - 9]);
      for (std::size_t i = 0; i < kBlock; i += hn::Lanes(df)) hn::Store(value, df, pose.at[k] + i);
    }
    drawNormals(of_poses, first + begin, size, normals);
    correlate(gaussian.root, ParticleTwist{}, size, normals, twists);
    movePoses(twists, size, pose);
    pose.store(poses + begin, size);
    drawNormals(of_velocities, first + begin, size, normals);
    correlate(gaussian.velocity_root, gaussian.velocity, size, normals, twists);
    twists.store(velocities + begin, size);
  }
}

TwistSums sumAll(const ParticlePose& reference, const ParticlePose* poses, std::size_t count) {
  const Floats df;
  const auto& r = reference.rotation;
  PoseBlock pose;
  TwistBlock sums, squares;
  sums.load(static_cast<const ParticleTwist*>(nullptr), 0);
  squares.load(static_cast<const ParticleTwist*>(nullptr), 0);
  const auto add = [&](std::size_t k, Float value, std::size_t i, std::size_t size) HWY_ATTR {
    value = hn::IfThenElseZero(hn::FirstN(df, size - i), value);
    hn::Store(hn::Add(hn::Load(df, sums.at[k]), value), df, sums.at[k]);
    hn::Store(hn::MulAdd(value, value, hn::Load(df, squares.at[k])), df, squares.at[k]);
  };
  for (std::size_t begin = 0; begin < count; begin += kBlock) {
    const std::size_t size = std::min(kBlock, count - begin);
    pose.load(poses + begin, size);
    for (std::size_t i = 0; i < size; i += hn::Lanes(df)) {
      const auto entry = [&](std::size_t k) HWY_ATTR { return hn::Load(df, pose.at[k] + i); };
      for (std::size_t k = 0; k < 3; ++k)
        add(k, hn::Sub(entry(9 + k), hn::Set(df, reference.translation[k])), i, size);
      // Entry (a, b) of rotation * reference^T.
      const auto turned = [&](std::size_t a, std::size_t b) HWY_ATTR {
        return dot(entry(3 * a), entry(3 * a + 1), entry(3 * a + 2), hn::Set(df, r[3 * b]),
                   hn::Set(df, r[3 * b + 1]), hn::Set(df, r[3 * b + 2]));
      };
      const auto half = hn::Set(df, 0.5F);
      add(3, hn::Mul(half, hn::Sub(turned(2, 1), turned(1, 2))), i, size);
      add(4, hn::Mul(half, hn::Sub(turned(0, 2), turned(2, 0))), i, size);
      add(5, hn::Mul(half, hn::Sub(turned(1, 0), turned(0, 1))), i, size);
    }
  }
  TwistSums result;
  for (std::size_t k = 0; k < 6; ++k) {
    result.sums[k] = hn::GetLane(hn::SumOfLanes(df, hn::Load(df, sums.at[k])));
    result.squares[k] = hn::GetLane(hn::SumOfLanes(df, hn::Load(df, squares.at[k])));
  }
  return result;
}

WeightSums exponentialsOf(const float* log_likelihoods, std::size_t count, float best, float power,
                          float* weights) {
  const Floats df;
  const auto top = hn::Set(df, best), factor = hn::Set(df, power);
  auto sum = hn::Zero(df), squares = hn::Zero(df);
  HWY_ALIGN float rest[kBlock];
  for (std::size_t i = 0; i < count; i += hn::Lanes(df)) {
    const bool whole = i + hn::Lanes(df) <= count;
    if (!whole)
      for (std::size_t k = 0; k < hn::Lanes(df); ++k)
        rest[k] = i + k < count ? log_likelihoods[i + k] : 0;
    const auto value = whole ? hn::LoadU(df, log_likelihoods + i) : hn::Load(df, rest);
    auto weight = hn::Exp(df, hn::Mul(factor, hn::Sub(value, top)));
    if (!whole) weight = hn::IfThenElseZero(hn::FirstN(df, count - i), weight);
    sum = hn::Add(sum, weight);
    squares = hn::MulAdd(weight, weight, squares);
    if (weights == nullptr) continue;
    if (whole) {
      hn::StoreU(weight, df, weights + i);
    } else {
      hn::Store(weight, df, rest);
      std::copy(rest, rest + (count - i), weights + i);
    }
  }
  return {hn::GetLane(hn::SumOfLanes(df, sum)), hn::GetLane(hn::SumOfLanes(df, squares))};
}

void normalsAt(const NormalStream& stream, std::uint32_t index, ParticleTwist& result) {
  TwistBlock normals;
  drawNormals(stream, index, 1, normals);
  normals.store(&result, 1);
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace leap_object_tracker {

HWY_EXPORT(normalsAt);
HWY_EXPORT(predictAll);
HWY_EXPORT(spreadAll);
HWY_EXPORT(drawAll);
HWY_EXPORT(sumAll);
HWY_EXPORT(exponentialsOf);

std::array<float, 6> normalsOf(const NormalStream& stream, std::uint32_t index) {
  ParticleTwist normals;
  HWY_DYNAMIC_DISPATCH(normalsAt)(stream, index, normals);
  return normals;
}

void predictParticles(const ParticleStep& step, const NormalStream& stream, std::size_t first,
                      std::size_t count, ParticlePose* poses, ParticleTwist* velocities) {
  HWY_DYNAMIC_DISPATCH(predictAll)(step, stream, first, count, poses, velocities);
}

void spreadParticles(const ParticleTwist& deviations, const NormalStream& stream, std::size_t first,
                     std::size_t count, ParticlePose* poses) {
  HWY_DYNAMIC_DISPATCH(spreadAll)(deviations, stream, first, count, poses);
}

void drawParticles(const ParticleGaussian& gaussian, const NormalStream& of_poses,
                   const NormalStream& of_velocities, std::size_t first, std::size_t count,
                   ParticlePose* poses, ParticleTwist* velocities) {
  HWY_DYNAMIC_DISPATCH(drawAll)
  (gaussian, of_poses, of_velocities, first, count, poses, velocities);
}

TwistSums sumTwists(const ParticlePose& reference, const ParticlePose* poses, std::size_t count) {
  return HWY_DYNAMIC_DISPATCH(sumAll)(reference, poses, count);
}

WeightSums exponentials(const float* log_likelihoods, std::size_t count, float best, float power,
                        float* weights) {
  return HWY_DYNAMIC_DISPATCH(exponentialsOf)(log_likelihoods, count, best, power, weights);
}

}  // namespace leap_object_tracker
#endif
