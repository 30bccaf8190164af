#pragma once

#include <opencv2/core.hpp>
#include <optional>

#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"

namespace leap_object_tracker {

/// Both rectified images side by side, 8-bit BGR, with the contour that the object would have at a
/// pose: green for the estimate. An eye that is missing stays black.
cv::Mat drawOverlay(const RectifiedStereoFrame& frame, const Tracker& tracker,
                    const std::optional<Pose>& camera_from_object);

}  // namespace leap_object_tracker
