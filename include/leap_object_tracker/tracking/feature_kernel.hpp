#pragma once

#include <cstddef>
#include <vector>

#include "leap_object_tracker/geometry/signed_distance.hpp"
#include "leap_object_tracker/tracking/measurement_model.hpp"

namespace leap_object_tracker {

/// The features of a frame as the scoring loop reads them: one array a number, all arrays of equal
/// length, padded to a multiple of 16 with points that count for nothing.
class FeatureArrays {
 public:
  static constexpr float kNothing = -1e3F;  ///< peak of padding

  void clear();
  /// @param peak log density of a perfect match over that of an outlier
  /// @param variance [m^2] of the distance from the surface
  void addSurfacePoint(const Eigen::Vector3f& in_camera, float variance, float peak);
  /// @param information [1/m^2] of the distance from the landmark
  void addLandmark(const Eigen::Vector3f& in_camera, const Eigen::Vector3f& landmark,
                   const Eigen::Matrix3f& information, float peak);
  /// To be called once all points are in.
  void pad();

  static constexpr std::size_t kSurfaceNumbers = 5;    ///< x, y, z [m], 1 / variance, peak
  static constexpr std::size_t kLandmarkNumbers = 13;  ///< x, y, z, landmark, information, peak
  const std::vector<float>& surface(std::size_t number) const { return surface_[number]; }
  const std::vector<float>& landmark(std::size_t number) const { return landmark_[number]; }

 private:
  std::array<std::vector<float>, kSurfaceNumbers> surface_;
  std::array<std::vector<float>, kLandmarkNumbers> landmark_;
};

/// Sums log(1 + exp(peak - squared distance / 2)) over all points, for each pose, times `share`.
/// The instruction set is chosen at run time; all give the same within rounding.
void scoreFeatures(const FeatureArrays& points, const SignedDistance& surface, float share,
                   const ParticlePose* poses, std::size_t count, float* log_likelihood);

}  // namespace leap_object_tracker
