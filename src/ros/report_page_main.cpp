#include <yaml-cpp/yaml.h>

#include <filesystem>
#include <iostream>

#include "command_line.hpp"
#include "leap_object_tracker/evaluation/csv_table.hpp"
#include "leap_object_tracker/evaluation/html_page.hpp"

namespace leap_object_tracker {
namespace {

constexpr const char* kUsage = R"(usage: report_page PAGE.yaml OUT.html

Makes one self-contained page of tables, plots and pictures. PAGE.yaml:
  title: text
  parts:                        # in their order, each one of
    - heading: text
    - text: text
    - table: {headings: [a, b], rows: [[1, 2], [3, 4]]}
    - plot: {file: data.csv, x: column, y: [columns], kind: lines | points | bars,
             title: text, x_label: text, y_label: text, from_zero: true}
    - picture: {file: image.png, caption: text}
Files are relative to PAGE.yaml. from_zero: x begins with zero.
)";

namespace fs = std::filesystem;

std::string wordOr(const YAML::Node& node, const char* key, const std::string& otherwise) {
  return node[key] ? node[key].as<std::string>() : otherwise;
}

Plot plotFrom(const YAML::Node& node, const fs::path& folder) {
  const CsvTable table = readCsv((folder / node["file"].as<std::string>()).string());
  const std::string x = node["x"].as<std::string>();
  Plot plot;
  plot.title = wordOr(node, "title", table.name);
  plot.x_label = wordOr(node, "x_label", x);
  plot.y_label = wordOr(node, "y_label", "");
  const std::string kind = wordOr(node, "kind", "lines");
  if (kind == "bars") {
    plot.kind = Plot::Kind::kBars;
  } else if (kind == "points") {
    plot.kind = Plot::Kind::kPoints;
  } else if (kind != "lines") {
    throw std::runtime_error("plot '" + plot.title + "': kind '" + kind +
                             "' is none of lines, points, bars");
  }
  std::vector<double> places = table.column(x);
  if (node["from_zero"] && node["from_zero"].as<bool>() && !places.empty()) {
    const double first = places.front();
    for (double& place : places) place -= first;
  }
  for (const auto& y : node["y"]) {
    const auto name = y.as<std::string>();
    addCurve(plot, name, places, table.column(name));
  }
  return plot;
}

void addTable(HtmlPage& page, const YAML::Node& node) {
  page.addTable(node["headings"].as<std::vector<std::string>>(),
                node["rows"].as<std::vector<std::vector<std::string>>>());
}

void addPart(HtmlPage& page, const YAML::Node& part, const fs::path& folder) {
  if (!part.IsMap() || part.size() != 1)
    throw std::runtime_error("each part is one of heading, text, table, plot, picture");
  const auto kind = part.begin()->first.as<std::string>();
  const YAML::Node what = part.begin()->second;
  if (kind == "heading")
    page.addHeading(what.as<std::string>());
  else if (kind == "text")
    page.addText(what.as<std::string>());
  else if (kind == "table")
    addTable(page, what);
  else if (kind == "plot")
    page.addPlot(plotFrom(what, folder));
  else if (kind == "picture")
    page.addPicture((folder / what["file"].as<std::string>()).string(),
                    wordOr(what, "caption", ""));
  else
    throw std::runtime_error("part '" + kind + "' is none of heading, text, table, plot, picture");
}

void run(const CommandLine& line) {
  if (line.positional().size() != 2) throw UsageError("expected PAGE.yaml and OUT.html");
  const std::string source = line.positional()[0];
  try {
    const YAML::Node root = YAML::LoadFile(source);
    HtmlPage page(wordOr(root, "title", "Report"));
    for (const auto& part : root["parts"]) addPart(page, part, fs::path(source).parent_path());
    page.write(line.positional()[1]);
  } catch (const YAML::Exception& error) {
    throw std::runtime_error("'" + source + "': " + error.what());
  }
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"report_page", kUsage, {}}, argc, argv, run);
}
