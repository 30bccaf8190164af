#pragma once

#include <Eigen/Dense>
#include <cstdint>

namespace leap_object_tracker {

enum class PaintKind {
  kPlain,    ///< albedo_high everywhere
  kChecker,  ///< cubes of `scale`
  kStripes,  ///< across z, `scale` wide
  kNoise,    ///< soft clouds of about `scale`
  kBlobs,    ///< cells of about `scale`, each of one albedo
};

/// What a surface looks like at 850 nm: a solid texture, cut by the body's surface.
struct Paint {
  PaintKind kind = PaintKind::kPlain;
  double albedo_low = 0.1;   ///< diffuse, 0 to 1
  double albedo_high = 0.6;  ///< diffuse, 0 to 1
  double scale = 0.01;       ///< [m]
  double grain = 0.03;       ///< share of the albedo that varies from 0.3 mm to 0.3 mm
  double gloss = 0.05;       ///< mirror-like share, 0 to 1
  double shininess = 30;     ///< exponent of the highlight (Blinn 1977); more is smaller
  std::uint64_t seed = 0;
};

/// Diffuse albedo at a point [m] of the body.
float albedoAt(const Paint& paint, const Eigen::Vector3f& point_in_body);

}  // namespace leap_object_tracker
