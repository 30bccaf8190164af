#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <opencv2/core.hpp>
#include <vector>

#include "leap_object_tracker/simulation/scene.hpp"

namespace leap_object_tracker {

/// Where a body is while the shutter is open.
struct BodyPath {
  Pose camera_from_body_at_open;  ///< left rectified optical frame from body
  Pose camera_from_body_at_close;
};

/// Light that reached the sensor, CV_32FC1 [counts/us at gain 1], vignetting included.
struct StereoRadiance {
  cv::Mat left;
  cv::Mat right;
};

/// Casts rays through the raw lens of both eyes. Not to be called from two threads at once; its own
/// threads do not change the result.
class StereoRenderer {
 public:
  /// @param scene only its unit, mode, light, sensor, samples and bodies matter.
  explicit StereoRenderer(const Scene& scene);
  ~StereoRenderer();

  /// @param paths one for each body of the scene
  /// @param leds which of left, centre and right are lit
  /// @param contrast [counts/us] neighbours that differ more get several rays each
  /// @param name of the random numbers: the same name, the same image
  StereoRadiance render(const std::vector<BodyPath>& paths, const std::array<bool, 3>& leds,
                        double contrast, std::uint64_t name);

  /// Share of the object's surface that faces the eye and is neither hidden by another body nor
  /// outside the image, 0 to 1; for the bodies in the middle of the last exposure.
  double visibleShare(int eye) const;

  const LeapLens& lens(int eye) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace leap_object_tracker
