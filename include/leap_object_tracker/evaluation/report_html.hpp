#pragma once

#include <string>
#include <utility>
#include <vector>

#include "leap_object_tracker/evaluation/csv_table.hpp"
#include "leap_object_tracker/evaluation/html_page.hpp"
#include "leap_object_tracker/evaluation/trajectory_error.hpp"

namespace leap_object_tracker {

/// What goes into a report; all but the runs may be empty.
struct ReportContents {
  std::string title;
  std::vector<std::string> names;      ///< one for each run
  std::vector<TrajectoryReport> runs;  ///< against the same truth
  std::vector<CsvTable> series;        ///< with a column `stamp` [s]: what the tracker noted
  std::vector<CsvTable> histograms;    ///< first column: centre of the bin; others: counts
  std::vector<std::pair<std::string, std::string>> pictures;  ///< path, caption
};

/// Tables of the figures and of the distance bands, and plots: errors over time and their
/// distribution, path, error over depth, NEES, series, histograms, pictures.
/// @throw std::invalid_argument without runs or with another number of names,
/// std::runtime_error for a series without a stamp or a picture that cannot be read.
HtmlPage reportPage(const ReportContents& contents);

/// Plots of a table over its column `stamp`, from `begin` [s] on: columns of the same unit (`_ms`,
/// `_mm`, `_deg`) share a plot, the others have one each.
std::vector<Plot> plotsOver(const CsvTable& table, double begin);

}  // namespace leap_object_tracker
