#pragma once

#include <array>
#include <opencv2/core.hpp>

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"

namespace leap_object_tracker {

/// The part of each eye that shows a body at a pose, and `margin` [px] around it; empty where it is
/// out of sight.
std::array<cv::Rect, 2> objectRegions(const Mesh& mesh, const Pose& camera_from_object,
                                      const RectifiedStereoCamera& camera, int margin);

}  // namespace leap_object_tracker
