#pragma once

#include <optional>
#include <ostream>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/symmetry.hpp"

namespace leap_object_tracker {

/// One frame of a start.
struct StartFrame {
  bool tracked = false;    ///< a pose was given
  double position = 0;     ///< [m] error of the origin
  double orientation = 0;  ///< [rad] to the nearest equivalent orientation
  double search_ms = 0;
  double total_ms = 0;  ///< rectification and all of the tracker
};

StartFrame judgeStart(const std::optional<Pose>& estimate, const Pose& truth,
                      const Symmetry& symmetry);

/// A tracker that was to find an object from nothing.
struct StartTrial {
  int index = 0;
  std::string object;
  std::string surroundings;
  double depth = 0;     ///< [m] of the object's origin
  double off_axis = 0;  ///< [rad] of the object's origin, seen from between the eyes
  double visible = 0;   ///< share of the object's side that the eye that sees less of it sees
  std::vector<StartFrame> frames;
};

enum class StartVerdict {
  kRight,    ///< within 2 mm and 2 deg up to 15 cm of depth, within 5 mm and 5 deg beyond
  kInexact,  ///< neither right nor wrong
  kWrong,    ///< off by more than 10 mm or 10 deg
  kNone,     ///< no pose
};
std::string wordFrom(StartVerdict verdict);

/// The verdict about the frame `number`, counted from 1.
StartVerdict verdictOf(const StartTrial& trial, std::size_t number);

/// A Markdown table: a line for each object, surroundings, depth, angle and all, then times.
void writeStartTable(std::ostream& out, const std::vector<StartTrial>& trials);

/// The headings of writeStartCsv.
void writeStartCsvHeading(std::ostream& out);

/// One line for each frame of a trial, errors in [mm] and [deg].
void writeStartCsv(std::ostream& out, const StartTrial& trial);

}  // namespace leap_object_tracker
