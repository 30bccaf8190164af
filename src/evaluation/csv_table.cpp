#include "leap_object_tracker/evaluation/csv_table.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

std::vector<std::string> cellsOf(std::string line) {
  if (!line.empty() && line.back() == '\r') line.pop_back();
  std::vector<std::string> cells(1);
  for (const char c : line) {
    if (c == ',')
      cells.emplace_back();
    else
      cells.back() += c;
  }
  return cells;
}

double numberOr(const std::string& cell, double otherwise) {
  char* end = nullptr;
  const double number = std::strtod(cell.c_str(), &end);
  return end != cell.c_str() && *end == '\0' ? number : otherwise;
}

}  // namespace

const std::vector<double>& CsvTable::column(const std::string& heading) const {
  const auto found = std::find(headings.begin(), headings.end(), heading);
  if (found != headings.end()) return columns[static_cast<std::size_t>(found - headings.begin())];
  std::string known;
  for (const auto& one : headings) known += (known.empty() ? "" : ", ") + one;
  throw std::runtime_error("table '" + name + "' has no column '" + heading + "' (it has " + known +
                           ")");
}

CsvTable readCsv(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("'" + path + "': cannot be opened to read");
  CsvTable table;
  table.name = std::filesystem::path(path).stem().string();
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (line.empty() || line[0] == '#') continue;
    const auto cells = cellsOf(line);
    if (table.headings.empty()) {
      table.headings = cells;
      table.columns.resize(cells.size());
      continue;
    }
    if (cells.size() != table.headings.size())
      throw std::runtime_error("'" + path + "', line " + std::to_string(number) + ": " +
                               std::to_string(cells.size()) + " cells under " +
                               std::to_string(table.headings.size()) + " headings");
    for (std::size_t i = 0; i < cells.size(); ++i)
      table.columns[i].push_back(numberOr(cells[i], std::numeric_limits<double>::quiet_NaN()));
  }
  if (table.headings.empty())
    throw std::runtime_error("'" + path + "': empty, expected a line of headings");
  return table;
}

}  // namespace leap_object_tracker
