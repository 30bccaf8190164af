#pragma once

#include <array>
#include <cstdint>

namespace leap_object_tracker {

class TexturedSurface;

/// How bright the object and what lies beside its outline are: histograms of grey values inside and
/// outside, learned while the object is tracked (as the colour statistics of Prisacariu and Reid,
/// IJCV 2012, section 3). Bins are even in the square root of the grey value, on which shot noise
/// is the same everywhere.
class GreyModel {
 public:
  static constexpr int kBins = 48;
  using Histogram = std::array<float, kBins>;

  static int bin(std::uint8_t grey);

  /// Mixes new counts in. Histograms of less than 50 samples change nothing.
  /// @param rate share of the new counts, 0 to 1; the first ones count fully
  void learn(const Histogram& inside, const Histogram& outside, double rate);
  bool known() const { return known_; }

  /// log p(grey | object) / p(grey | surroundings), within +-2 nats; zero while nothing is known.
  float logRatio(float grey) const {
    return log_ratio_[static_cast<std::uint8_t>(grey < 0 ? 0 : grey > 255 ? 255 : grey)];
  }

 private:
  bool known_ = false;
  Histogram inside_{}, outside_{};
  std::array<float, 256> log_ratio_{};
};

/// What the object looked like while it was tracked.
struct Appearance {
  double bright_inside = 0.7;  ///< share of the outline on whose inner side the image is brighter
  GreyModel grey;
  const TexturedSurface* texture = nullptr;  ///< what of it is in sight; null: not known
};

}  // namespace leap_object_tracker
