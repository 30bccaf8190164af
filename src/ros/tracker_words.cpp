#include "tracker_words.hpp"

#include <stdexcept>

namespace leap_object_tracker {

std::string wordFrom(TrackerState state) {
  switch (state) {
    case TrackerState::kIdle:
      return "idle";
    case TrackerState::kSearching:
      return "searching";
    case TrackerState::kTracking:
      return "tracking";
    case TrackerState::kLost:
      return "lost";
  }
  return "unknown";
}

Eyes eyesFromWord(const std::string& word) {
  if (word == "both") return Eyes::kBoth;
  if (word == "left") return Eyes::kLeft;
  if (word == "right") return Eyes::kRight;
  throw std::invalid_argument("eyes '" + word + "': expected both, left or right");
}

Measurement measurementFromWord(const std::string& word) {
  if (word == "auto") return Measurement::kAuto;
  if (word == "contour") return Measurement::kContour;
  if (word == "feature") return Measurement::kFeature;
  if (word == "both") return Measurement::kBoth;
  throw std::invalid_argument("measurement '" + word +
                              "': expected auto, contour, feature or both");
}

}  // namespace leap_object_tracker
