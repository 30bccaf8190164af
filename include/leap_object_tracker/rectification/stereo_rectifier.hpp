#pragma once

#include <opencv2/core.hpp>

#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/rectification/remap_table.hpp"

namespace leap_object_tracker {

/// What the rectified pair shall look like. Zero: chosen from the calibration.
struct RectificationParams {
  int width = 0;                  ///< [px]; default: the raw width
  int height = 0;                 ///< [px]; default: the raw height with square pixels
  double focal_length = 0;        ///< [px]; default: that of the raw image centre
  double horizontal_fov_deg = 0;  ///< [deg]; sets the focal length instead, if above 0
};

/// The ideal pair for a calibration: square pixels, common centre, the raw resolution at the
/// centre.
/// @throw std::invalid_argument for a calibration without size, focal length or baseline, and for
/// params out of range.
RectifiedStereoCamera rectifiedCamera(const StereoCalibration& calibration,
                                      const RectificationParams& params);

/// Turns raw pairs into rectified ones; the tables are built once. On the threads of the TBB arena
/// that calls it.
class StereoRectifier {
 public:
  StereoRectifier(const StereoCalibration& calibration, const RectifiedStereoCamera& target);

  /// Bilinear. Beyond the border of the raw image its nearest pixel goes on, so that the border
  /// makes no edge; 0 where the lens has no ray.
  /// @throw std::invalid_argument if the frame is not 8-bit grey of the calibrated size. An empty
  /// eye stays empty.
  RectifiedStereoFrame rectify(const RawStereoFrame& frame) const;
  /// The same into images that are there already, if they have the size.
  void rectify(const RawStereoFrame& frame, RectifiedStereoFrame& rectified) const;

  const RectifiedStereoCamera& camera() const { return target_; }

 private:
  static RemapTable makeTable(const CameraCalibration& raw, const RectifiedStereoCamera& target);

  RectifiedStereoCamera target_;
  RemapTable left_;
  RemapTable right_;
};

}  // namespace leap_object_tracker
