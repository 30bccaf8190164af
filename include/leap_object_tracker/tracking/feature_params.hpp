#pragma once

#include <string>

namespace leap_object_tracker {

/// The feature likelihood: corners seen by both eyes, as points in space.
struct FeatureParams {
  int corners = 120;               ///< most corners an eye; the strongest that keep their distance
  double resolution = 4000;        ///< [px/m] the object is resampled to before corners are sought
  double least_contrast = 0.02;    ///< threshold of corners as a share of the region's contrast
  double ratio = 0.90;             ///< nearest to second nearest descriptor of a match, at most
  double epipolar_distance = 1.5;  ///< [px] between the rows of a match, at most
  double disparity_sigma = 0.30;   ///< [px] noise of a match along the row
  double corner_sigma = 0.4;       ///< [px] how well a corner is found at the same place again
  double model_sigma = 0.0003;     ///< [m] how far the body may differ from its model
  double outlier_share = 0.3;      ///< prior share of points that are not of the object
  /// Of the points: errors of neighbours and of one pose are alike.
  double independent_share = 0.3;
  int landmarks = 400;  ///< most landmarks kept of an object
  /// How far all landmarks together may lie off, by the poses that they were learnt at.
  double map_position_sigma = 0.0002;   ///< [m]
  double map_rotation_sigma_deg = 0.4;  ///< [deg] but about the free axis, which they define
  std::string map_file;                 ///< landmarks to begin with, as saved; empty: none
};

}  // namespace leap_object_tracker
