#pragma once

#include <array>
#include <cstddef>

namespace leap_object_tracker {

/// Where the limb of a matt round body shows that three lamps in a row light from beside the eye:
/// its brightness falls off towards the limb, and what the blurred image shows as the edge, the
/// steepest place, lies elsewhere.
class LimbShift {
 public:
  /// Made once, which takes some 10 ms.
  static const LimbShift& instance();

  /// How far inside of the limb the edge shows, in deviations of the blur.
  /// @param radius of curvature in such deviations
  /// @param lit cosine between the normal at the limb and the direction of the middle lamp
  /// @param spread by which that of the other two is more and less
  double at(double radius, double lit, double spread) const;

 private:
  LimbShift();

  static constexpr int kRadii = 9, kLits = 13, kSpreads = 5;
  static std::size_t index(int radius, int lit, int spread);

  std::array<double, static_cast<std::size_t>(kRadii) * kLits * kSpreads> shifts_{};
};

}  // namespace leap_object_tracker
