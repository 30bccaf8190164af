#pragma once

namespace leap_object_tracker {

/// [m] between the three lamps along the baseline, the middle one halfway between the eyes.
constexpr double kLampSpacing = 0.035;

/// [px] standard deviations of the point spread of a rectified image, across and down.
constexpr double kBlurU = 0.78, kBlurV = 1.08;

}  // namespace leap_object_tracker
