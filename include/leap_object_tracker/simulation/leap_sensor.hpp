#pragma once

#include <cstdint>
#include <opencv2/core.hpp>

#include "leap_object_tracker/simulation/scene.hpp"

namespace leap_object_tracker {

/// Turns light into the bytes of one eye: lens blur, stray light, exposure, noise, gain, gamma.
class LeapSensor {
 public:
  /// @param unit names this eye's fixed noise
  LeapSensor(const SensorParams& params, const SensorMode& mode, std::uint64_t unit);

  /// @param radiance CV_32FC1 [counts/us at gain 1]
  /// @param name of the noise of this image
  cv::Mat expose(const cv::Mat& radiance, const SensorControls& controls, bool lit,
                 std::uint64_t name) const;

 private:
  SensorParams params_;
  SensorMode mode_;
  cv::Mat glow_;         ///< CV_32FC1 [counts/us]
  cv::Mat fixed_noise_;  ///< CV_32FC1 [counts]
};

/// Writes what the device hides in the last six pixels of both eyes: tag, label, exposure modulo
/// 512 us and gain modulo 32.
/// @param lit the label: 1 for a frame with light, else 0
void embedMetadata(cv::Mat& left, cv::Mat& right, const SensorControls& controls, bool lit);

/// Mean of the brightest 0.2 % of all pixels of both eyes [counts], the metadata left out.
double brightestOf(const cv::Mat& left, const cv::Mat& right);

/// Controls that gather `factor` times as much light: by exposure first, then by gain.
SensorControls brighter(const SensorControls& controls, double factor, double longest_exposure_us);

/// A host's exposure control: exposure first, then gain, so that the brightest things stay just
/// below saturation. Acts every third frame, and the device obeys two frames later.
class AutoExposure {
 public:
  explicit AutoExposure(double longest_exposure_us) : longest_exposure_us_(longest_exposure_us) {}

  /// Takes a frame that was made with `controls`. @return what to set for the next one.
  SensorControls after(const cv::Mat& left, const cv::Mat& right, const SensorControls& controls);

 private:
  double longest_exposure_us_;
  int frames_ = 0;
  SensorControls wanted_;
  int frames_until_obeyed_ = -1;
};

}  // namespace leap_object_tracker
