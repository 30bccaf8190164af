#pragma once

#include <string>

#include "leap_object_tracker/tracking/tracker.hpp"

namespace leap_object_tracker {

/// idle, searching, tracking or lost.
std::string wordFrom(TrackerState state);
/// @throw std::invalid_argument for other words than both, left, right.
Eyes eyesFromWord(const std::string& word);
/// @throw std::invalid_argument for other words than auto, contour, feature, both.
Measurement measurementFromWord(const std::string& word);

}  // namespace leap_object_tracker
