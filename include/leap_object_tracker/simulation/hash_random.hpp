#pragma once

#include <cmath>
#include <cstdint>

namespace leap_object_tracker {

/// Random numbers from what they are for (seed, frame, pixel ...) instead of from their order, so
/// that threads cannot change them. Mixing function: splitmix64 (Steele et al. 2014).
inline std::uint64_t mixed(std::uint64_t x) {
  x += 0x9e3779b97f4a7c15ULL;
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
  return x ^ (x >> 31);
}
inline std::uint64_t mixed(std::uint64_t a, std::uint64_t b) { return mixed(mixed(a) ^ b); }

/// A short stream of numbers with a name.
class HashRandom {
 public:
  explicit HashRandom(std::uint64_t name) : state_(mixed(name)) {}
  HashRandom(std::uint64_t seed, std::uint64_t name) : state_(mixed(seed, name)) {}

  std::uint64_t bits() { return mixed(state_++); }
  /// In [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }
  double uniform(double low, double high) { return low + (high - low) * uniform(); }
  /// Mean 0, standard deviation 1 (Box and Muller 1958).
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform()));
    return radius * std::cos(2 * M_PI * uniform());
  }
  /// The same to 3.4 standard deviations, as a sum of four uniform numbers: for pixels.
  double fastNormal() {
    const std::uint64_t parts = bits();
    const auto sum = static_cast<double>((parts & 0xffff) + (parts >> 16 & 0xffff) +
                                         (parts >> 32 & 0xffff) + (parts >> 48));
    return (sum * 0x1p-16 - 2 + 2 * 0x1p-16) * 1.7320508075688772;
  }

 private:
  std::uint64_t state_;
};

}  // namespace leap_object_tracker
