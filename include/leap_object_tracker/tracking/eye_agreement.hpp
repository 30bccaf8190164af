#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"

namespace leap_object_tracker {

/// Whether the texture that both eyes see lies on the surface of a body at a pose, rather than
/// before or behind it: nothing has to be known of the texture.
class EyeAgreement {
 public:
  EyeAgreement(const Mesh& mesh, const RectifiedStereoCamera& camera);

  struct Agreement {
    double log_likelihood_ratio = 0;  ///< [nats] of the disparities that the pose predicts
    double best_ratio = 0;            ///< [nats] of the best ones close by
    double best_shift = 0;            ///< [px] of those against the predicted ones
  };

  /// Log-likelihood ratio of the disparities d that a pose predicts against others:
  ///   sum over textured pixels of log p(g_l - g_r(d)) - log mean_s p(g_l - g_r(d + s)),
  /// g the slopes of the grey values along the epipolar line, p Student's t-distribution with a
  /// share of outliers. Zero for a plain body. May be called from several threads.
  Agreement compare(const std::array<EdgeField, 2>& fields, const Pose& camera_from_object) const;

 private:
  RectifiedStereoCamera camera_;
  std::vector<Eigen::Vector3f> vertices_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
};

}  // namespace leap_object_tracker
