#include "leap_object_tracker/simulation/paint.hpp"

#include <cmath>

#include "leap_object_tracker/simulation/hash_random.hpp"

namespace leap_object_tracker {
namespace {

using Cell = Eigen::Vector3i;

std::uint64_t cellName(std::uint64_t seed, const Cell& cell) {
  const auto part = [](int value) { return static_cast<std::uint64_t>(value + (1 << 20)); };
  return mixed(seed, part(cell.x()) | part(cell.y()) << 21 | part(cell.z()) << 42);
}

float uniformOf(std::uint64_t name) { return static_cast<float>(name >> 40) * 0x1.0p-24F; }

Cell cellOf(const Eigen::Vector3f& p) { return p.array().floor().matrix().cast<int>(); }

/// Random values at the corners of unit cells, blended smoothly (value noise).
float valueNoise(std::uint64_t seed, const Eigen::Vector3f& p) {
  const Cell low = cellOf(p);
  const Eigen::Array3f t = p.array() - low.cast<float>().array();
  const Eigen::Array3f s = t * t * (3 - 2 * t);
  float sum = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Cell step(corner & 1, corner >> 1 & 1, corner >> 2);
    const float weight = (step.x() ? s.x() : 1 - s.x()) * (step.y() ? s.y() : 1 - s.y()) *
                         (step.z() ? s.z() : 1 - s.z());
    sum += weight * uniformOf(cellName(seed, low + step));
  }
  return sum;
}

/// Name of the nearest of the points that are scattered one a unit cell (Worley 1996).
std::uint64_t nearestCell(std::uint64_t seed, const Eigen::Vector3f& p) {
  const Cell home = cellOf(p);
  float nearest = 1e9F;
  std::uint64_t name = 0;
  for (int dx = -1; dx <= 1; ++dx)
    for (int dy = -1; dy <= 1; ++dy)
      for (int dz = -1; dz <= 1; ++dz) {
        const Cell cell = home + Cell(dx, dy, dz);
        const std::uint64_t here = cellName(seed, cell);
        const Eigen::Vector3f at =
            cell.cast<float>() +
            Eigen::Vector3f(uniformOf(here), uniformOf(mixed(here, 1)), uniformOf(mixed(here, 2)));
        const float distance = (at - p).squaredNorm();
        if (distance < nearest) nearest = distance, name = here;
      }
  return name;
}

/// 0 to 1: how far from albedo_low to albedo_high.
float pattern(const Paint& paint, const Eigen::Vector3f& p) {
  switch (paint.kind) {
    case PaintKind::kPlain:
      return 1;
    case PaintKind::kChecker:
      // A quarter of a cell off the origin, so that no face lies on a border.
      return (cellOf(p + Eigen::Vector3f::Constant(0.25F)).sum() & 1) != 0 ? 1 : 0;
    case PaintKind::kStripes:
      return (static_cast<int>(std::floor(p.z() + 0.25F)) & 1) != 0 ? 1 : 0;
    case PaintKind::kNoise:
      return 0.6F * valueNoise(paint.seed, p) + 0.3F * valueNoise(paint.seed + 1, 2.1F * p) +
             0.1F * valueNoise(paint.seed + 2, 4.3F * p);
    case PaintKind::kBlobs: {
      const float level = uniformOf(mixed(nearestCell(paint.seed, p), 3));
      return level < 0.55F ? 1 : level < 0.75F ? 0 : 0.55F;
    }
  }
  return 1;
}

}  // namespace

float albedoAt(const Paint& paint, const Eigen::Vector3f& point_in_body) {
  const Eigen::Vector3f p = point_in_body / static_cast<float>(paint.scale);
  float albedo = static_cast<float>(paint.albedo_low +
                                    (paint.albedo_high - paint.albedo_low) * pattern(paint, p));
  if (paint.grain > 0) {
    constexpr float kGrainSize = 3e-4F;  // [m]
    const float random = valueNoise(mixed(paint.seed, 99), point_in_body / kGrainSize);
    albedo *= 1 + static_cast<float>(paint.grain) * (2 * random - 1);
  }
  return albedo;
}

}  // namespace leap_object_tracker
