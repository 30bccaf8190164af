#pragma once

#include <Eigen/Core>
#include <cmath>

namespace leap_object_tracker {

/// [m] between the three lamps along the baseline, the middle one halfway between the eyes.
constexpr double kLampSpacing = 0.035;
constexpr int kLamps = 3;

/// [m] where a lamp is along the baseline, from the left eye.
inline float lampPlace(int lamp, double baseline) {
  return static_cast<float>(0.5 * baseline + (lamp - 1) * kLampSpacing);
}

/// What a lamp at `lamp_x` gives to a matt surface (Lambert) [1/m^2]; zero from behind.
inline float lampLight(float lamp_x, const Eigen::Vector3f& at, const Eigen::Vector3f& normal) {
  const Eigen::Vector3f to_lamp = Eigen::Vector3f(lamp_x, 0, 0) - at;
  const float cosine = normal.dot(to_lamp);
  if (cosine <= 0) return 0;
  const float square = to_lamp.squaredNorm();
  return cosine / (square * std::sqrt(square));
}

/// What all lamps send to a place, towards them [1/m^2].
/// @param middle the lamp in the middle, in the frame of `at`
inline Eigen::Vector3d lampsFrom(const Eigen::Vector3d& at, const Eigen::Vector3d& middle) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int lamp = 0; lamp < kLamps; ++lamp) {
    const Eigen::Vector3d to_lamp =
        middle + (lamp - 1) * kLampSpacing * Eigen::Vector3d::UnitX() - at;
    sum += to_lamp / (to_lamp.squaredNorm() * to_lamp.norm());
  }
  return sum;
}

/// [px] standard deviations of the point spread of a rectified image, across and down.
constexpr double kBlurU = 0.78, kBlurV = 1.08;

}  // namespace leap_object_tracker
