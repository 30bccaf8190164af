#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"

namespace leap_object_tracker {

/// A body at a pose, in the frame of the left eye.
struct PlacedBody {
  std::vector<Eigen::Vector3f> points;   ///< [m] its vertices
  std::vector<Eigen::Vector3f> normals;  ///< unit vectors, of its triangles
};

void placeBody(const std::vector<Eigen::Vector3f>& vertices,
               const std::vector<std::array<std::uint32_t, 3>>& triangles,
               const Pose& camera_from_object, PlacedBody& body);

/// What of a body is nearest in each pixel of a box, as a rectified camera on the baseline sees it.
struct DepthView {
  DepthView() = default;
  DepthView(const DepthView&) = delete;
  DepthView& operator=(const DepthView&) = delete;

  float scale = 1;  ///< of the image
  cv::Rect box;
  cv::Mat nearness;  ///< CV_32FC1 1/z [1/m], zero where nothing is seen
  cv::Mat triangle;  ///< CV_32SC1
  std::vector<float> nearness_memory;
  std::vector<int> triangle_memory;
};

/// Draws the triangles that look at a place on the baseline, counter-clockwise from outside.
/// Triangles with a corner closer than 1 cm are left out.
/// @param points [m] the vertices in the frame of the left eye
/// @param eye_x [m] the place
/// @param limits of the box [px]
/// @param scale of the image
void drawDepths(const std::vector<Eigen::Vector3f>& points,
                const std::vector<std::array<std::uint32_t, 3>>& triangles,
                const RectifiedStereoCamera& camera, float eye_x, const cv::Rect& limits,
                float scale, DepthView& seen);

/// What a pixel of a view shows, of scale 1 and not empty there: its place [m] in the frame of the
/// left eye.
Eigen::Vector3f placeSeen(const DepthView& seen, const RectifiedStereoCamera& camera, float eye_x,
                          int u, int v);

}  // namespace leap_object_tracker
