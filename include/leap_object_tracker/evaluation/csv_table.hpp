#pragma once

#include <string>
#include <vector>

namespace leap_object_tracker {

/// Numbers in named columns of equal length; cells that are no number are not a number (NaN).
struct CsvTable {
  std::string name;  ///< of the file, without folder and extension
  std::vector<std::string> headings;
  std::vector<std::vector<double>> columns;

  /// @throw std::runtime_error naming the table and its headings.
  const std::vector<double>& column(const std::string& heading) const;
};

/// Reads a line of headings and lines of as many cells, separated by commas.
/// @throw std::runtime_error naming the file and the line.
CsvTable readCsv(const std::string& path);

}  // namespace leap_object_tracker
