#pragma once

#include <Eigen/Dense>
#include <vector>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"

namespace leap_object_tracker {

/// Where a body may be by the edges of one eye alone: a grid over its image and the depth, without
/// the places that have too few edges about them for the body's outline, or too little of the
/// image.
/// @param eye_x [m] of the eye along the baseline
/// @param nearest, farthest [m] depths between which to look; less far for a small body, which
/// among all edges of an image would be anywhere
/// @param size [m] radius of a disc as large as the body looks on average
/// @return middles of the body [m] in the left rectified frame
std::vector<Eigen::Vector3d> placesAmongEdges(const EdgeField& field,
                                              const RectifiedStereoCamera& camera, double eye_x,
                                              double nearest, double farthest, double size);

}  // namespace leap_object_tracker
