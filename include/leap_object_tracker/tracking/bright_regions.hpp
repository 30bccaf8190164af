#pragma once

#include <Eigen/Dense>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

namespace leap_object_tracker {

/// A part of an image that is brighter than all around it.
struct BrightRegion {
  static constexpr int kDirections = 16, kRight = 0, kBelow = 4;
  using Extents = Eigen::Array<float, kDirections, 1>;

  double area = 0;               ///< [px^2] with its holes
  double low_u = 0, high_u = 0;  ///< box around it [px]
  double low_v = 0, high_v = 0;
  Extents extents;                     ///< [px] how far it reaches: largest u c + v s, by direction
  Extents known;                       ///< 1; 0 where the border of the image cuts it off
  double faintest = 0, brightest = 0;  ///< thresholds [grey levels] between which it hardly changes
  int closing = 0;                     ///< dark gaps closed: 0 none, 1 narrow, 2 wide ones

  double middleU() const { return 0.5 * (low_u + high_u); }
  double middleV() const { return 0.5 * (low_v + high_v); }
  bool isCut() const { return known.minCoeff() < 0.5F; }
  /// [px] mean distance of both sides to those of another region, along a direction and its
  /// opposite; of one side where a border cuts the other, nothing where it cuts both.
  std::optional<double> apart(const BrightRegion& other, int direction) const;
  /// Cosine and sine of direction i: 2 pi i / kDirections, from +u towards +v.
  static const Extents& cosines();
  static const Extents& sines();
};

/// Connected regions above a threshold that keep their area over a range of thresholds (maximally
/// stable extremal regions, Matas et al., BMVC 2002), also of the image with its dark gaps closed:
/// a body with dark texture is one region there. An object lit by the camera's own LEDs is brighter
/// than what lies behind it, however dim. An empty image has none.
/// @param image CV_8UC1
std::vector<BrightRegion> findBrightRegions(const cv::Mat& image);

/// The same of the negative: what is darker than all around it, as in a lit room before a bright
/// wall.
std::vector<BrightRegion> findDarkRegions(const cv::Mat& image);

}  // namespace leap_object_tracker
