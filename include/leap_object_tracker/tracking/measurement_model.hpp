#pragma once

#include <array>
#include <cstddef>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"

namespace leap_object_tracker {

/// camera_from_object in single precision, as the particles carry it.
struct ParticlePose {
  std::array<float, 9> rotation;     ///< row by row
  std::array<float, 3> translation;  ///< [m]
};

ParticlePose toParticlePose(const Pose& camera_from_object);
Pose toPose(const ParticlePose& pose);

}  // namespace leap_object_tracker
