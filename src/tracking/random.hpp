#pragma once

#include <array>
#include <cmath>
#include <cstdint>

namespace leap_object_tracker {

/// Random numbers that depend on a seed and a counter only, never on the order of calls: any thread
/// may draw those of any particle (SplitMix64, Steele et al. 2014, as a hash).
class CounterRandom {
 public:
  CounterRandom(std::uint64_t seed, std::uint64_t stream, std::uint64_t index)
      : state_(mix(mix(mix(seed) + stream) + index)) {}

  std::uint64_t bits() { return mix(state_ += 0x9E3779B97F4A7C15ULL); }

  /// Uniform in [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1p-53; }

  /// Two independent standard normal numbers (Box and Muller 1958).
  std::array<float, 2> normals() {
    const std::uint64_t word = bits();
    const float a = (static_cast<float>(word >> 40) + 0.5F) * 0x1p-24F;
    const float b = static_cast<float>(word & 0xFFFFFF) * 0x1p-24F;
    const float radius = std::sqrt(-2 * std::log(a)), angle = 6.2831853F * b;
    return {radius * std::cos(angle), radius * std::sin(angle)};
  }

  std::array<float, 6> sixNormals() {
    const auto a = normals(), b = normals(), c = normals();
    return {a[0], a[1], b[0], b[1], c[0], c[1]};
  }

 private:
  static std::uint64_t mix(std::uint64_t x) {
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9ULL;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBULL;
    return x ^ (x >> 31);
  }
  std::uint64_t state_;
};

}  // namespace leap_object_tracker
