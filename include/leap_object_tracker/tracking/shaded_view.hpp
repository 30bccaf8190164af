#pragma once

#include <array>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"

namespace leap_object_tracker {

struct DepthView;

/// How well the grey values of an image agree with a matt body of one brightness at a pose, lit by
/// the three lamps of the device and by even light from all around: tells a body from its turned
/// self where their outlines are alike. Of a textured body it says little, of either.
class ShadedView {
 public:
  ShadedView(const Mesh& mesh, const RectifiedStereoCamera& camera);

  /// Profile log-likelihood [nats] over the unknown brightness, light and noise:
  ///   -n/2 log(sum (I - min(255, a L + b))^2 / sum I^2),
  /// L the Lambert shading with the shadows that the body throws on itself, a and b (not negative)
  /// its best scale and what even light adds, n the independent grey values inside the silhouettes
  /// (two pixels off their rims). Differences between poses of one place have a meaning; zero where
  /// no eye sees enough of the body. Saturated pixels only say that they are bright.
  double logLikelihood(const std::array<EdgeField, 2>& fields,
                       const Pose& camera_from_object) const;

 private:
  struct Sums {
    double residual = 0, brightness = 0, pixels = 0;
  };
  Sums compare(const EdgeField& field, const std::vector<Eigen::Vector3f>& normals, float eye_x,
               const DepthView& seen, const std::array<float, 3>& lamps,
               const std::array<DepthView, 3>& lit) const;

  RectifiedStereoCamera camera_;
  double radius_;  ///< [m]
  std::vector<Eigen::Vector3f> vertices_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
};

}  // namespace leap_object_tracker
