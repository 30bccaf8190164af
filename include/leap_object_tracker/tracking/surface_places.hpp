#pragma once

#include <Eigen/Dense>
#include <opencv2/core.hpp>
#include <vector>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"

namespace leap_object_tracker {

/// Places where both eyes see a surface, whatever its brightness and what touches it in the image.
class SurfacePlaces {
 public:
  /// @param nearest, farthest [m] depths between which to look
  /// @param size [m] of the body looked for: radius of a disc as large as its mean shadow
  SurfacePlaces(const RectifiedStereoCamera& camera, double nearest, double farthest, double size);

  /// Where the middle of the body may be if a surface is its near side: depths by matching blocks
  /// along the rows (OpenCV's StereoBM at half the size), gathered within the body's size; first
  /// those that stand out the most from the surfaces around them. Nothing if an image is empty.
  /// @return [m] camera frame of the left eye, at least half the body's size apart
  std::vector<Eigen::Vector3d> find(const RectifiedStereoFrame& frame) const;

  double size() const { return size_; }

 private:
  RectifiedStereoCamera camera_;
  double nearest_, farthest_, size_;
};

}  // namespace leap_object_tracker
