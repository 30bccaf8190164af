#pragma once

#include <ostream>
#include <string>
#include <vector>

#include "leap_object_tracker/evaluation/trajectory_error.hpp"

namespace leap_object_tracker {

/// One figure of a report, ready to be printed.
struct Figure {
  std::string name;  ///< with its unit: "position RMS [mm]"
  std::string value;
};

/// The figures that a person reads, in their order; "-" where there is none.
std::vector<Figure> figuresOf(const TrajectoryReport& report);

/// The figures in two columns, then the distance bands as a table.
void writeText(std::ostream& out, const TrajectoryReport& report);

/// One line for each run under a line of headings; `names` has a name for each report.
void writeSummaryCsv(std::ostream& out, const std::vector<std::string>& names,
                     const std::vector<TrajectoryReport>& reports);

/// One line for each frame: stamp, depth, errors ([mm], [deg]); empty cells where there is no pose.
void writeFrameCsv(std::ostream& out, const TrajectoryReport& report);

}  // namespace leap_object_tracker
