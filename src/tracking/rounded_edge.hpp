#pragma once

#include <Eigen/Core>

namespace leap_object_tracker {

/// From a sharp edge to where its outline lies, on average over the views, when the edge is
/// rounded [m]: with h half the angle between the normals, the outline lies inside of the sharp one
/// by radius * (cos(a) / cos(h) - 1), a within +-h of the bisector; its mean is radius * (tan(h) /
/// h
/// - 1). Zero where the normals are less than 0.1 rad apart.
/// @param normal_a, normal_b unit normals of the faces @param radius [m] of the rounding
Eigen::Vector3d roundedOutlineShift(const Eigen::Vector3d& normal_a,
                                    const Eigen::Vector3d& normal_b, double radius);

/// From there to where the image shows the outline of one view [m], away from the body. The circle
/// ends at its normal m across the line of sight, and gets darker towards it than the face that is
/// seen: the outline shows where a sharp step would leave as much light. With the face at the angle
/// a from m and the light at the angle l, it lies inside of the circle's end by
///   radius * (1 - cos a - (cos l - cos(2 a - l) + 2 a sin l) / (4 cos(a - l))).
/// @param seen, hidden unit normals of the faces @param tangent unit vector along the edge
/// @param to_eye towards the eye @param light sum of what lamps send, towards them; both of any
/// length, in the frame of the normals
Eigen::Vector3f roundedOutlineShown(const Eigen::Vector3f& seen, const Eigen::Vector3f& hidden,
                                    const Eigen::Vector3f& tangent, const Eigen::Vector3f& to_eye,
                                    const Eigen::Vector3f& light, float radius);

/// From the averaged outline to where the image shows the edge when both faces are seen [m], across
/// the edge: the rounding is brighter than either face where it is turned to the light (Lambert),
/// so that the edge shows on the side of the darker face. A circle touches the faces; with their
/// normals at the angles a and b from the light, the steep part of an image whose blur is wider
/// lies where a sharp step would leave as much light, from the circle's centre at
///   x = radius * (b - a - sin b cos b + sin a cos a) / (2 (cos a - cos b)).
/// At most some radii: of faces that are equally bright, only a line is left.
/// @param tangent unit vector along the edge @param to_light of any length, in the same frame
Eigen::Vector3f roundedCreaseShift(const Eigen::Vector3f& normal_a, const Eigen::Vector3f& normal_b,
                                   const Eigen::Vector3f& tangent, const Eigen::Vector3f& to_light,
                                   float radius);

}  // namespace leap_object_tracker
