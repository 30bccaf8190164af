#include "leap_object_tracker/evaluation/report_html.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <stdexcept>

#include "leap_object_tracker/evaluation/report_text.hpp"

namespace leap_object_tracker {
namespace {

constexpr double kMillimetres = 1e3;
constexpr double kDegrees = 180.0 / M_PI;
constexpr double kHole = std::numeric_limits<double>::quiet_NaN();
constexpr std::array<const char*, 3> kUnits{"_ms", "_mm", "_deg"};
constexpr int kBins = 40;

Plot plotOf(const std::string& title, const std::string& x_label, const std::string& y_label,
            Plot::Kind kind = Plot::Kind::kLines) {
  Plot plot;
  plot.title = title;
  plot.x_label = x_label;
  plot.y_label = y_label;
  plot.kind = kind;
  return plot;
}

std::vector<double> timesOf(const TrajectoryReport& run) {
  std::vector<double> times;
  for (const auto& frame : run.frames)
    times.push_back(seconds(frame.stamp - run.frames.front().stamp));
  return times;
}

/// A value for each frame, a hole where there is no pose.
template <typename Value>
std::vector<double> valuesOf(const TrajectoryReport& run, Value value) {
  std::vector<double> values;
  for (const auto& frame : run.frames) values.push_back(frame.estimate ? value(frame) : kHole);
  return values;
}

std::vector<double> withoutHoles(std::vector<double> values) {
  values.erase(std::remove_if(values.begin(), values.end(), [](double v) { return std::isnan(v); }),
               values.end());
  return values;
}

double positionOf(const FrameError& frame) { return frame.position * kMillimetres; }
double orientationOf(const FrameError& frame) { return frame.orientation * kDegrees; }

using ErrorOf = double (*)(const FrameError&);

Plot errorOverTime(const ReportContents& contents, const std::string& label, ErrorOf error) {
  Plot plot = plotOf(label + " over time", "time [s]", label);
  for (std::size_t i = 0; i < contents.runs.size(); ++i)
    addCurve(plot, contents.names[i], timesOf(contents.runs[i]), valuesOf(contents.runs[i], error));
  return plot;
}

/// Share of all frames whose error is below a value; frames without a pose never are.
Plot distribution(const ReportContents& contents, const std::string& label, ErrorOf error) {
  Plot plot = plotOf("Distribution of the " + label, label, "frames below [%]");
  for (std::size_t i = 0; i < contents.runs.size(); ++i) {
    auto errors = withoutHoles(valuesOf(contents.runs[i], error));
    std::sort(errors.begin(), errors.end());
    std::vector<double> shares, places;
    for (std::size_t k = 0; k < errors.size(); ++k) {
      const double share =
          100.0 * static_cast<double>(k + 1) / static_cast<double>(contents.runs[i].frames.size());
      if (!places.empty() && places.back() == errors[k]) {
        shares.back() = share;
        continue;
      }
      places.push_back(errors[k]);
      shares.push_back(share);
    }
    addCurve(plot, contents.names[i], places, shares);
  }
  return plot;
}

void bridgeHoles(Plot& plot) {
  for (auto& series : plot.series) {
    double last = 0;
    for (auto& value : series.y) last = value = std::isnan(value) ? last : value;
  }
}

Plot histogramOf(const ReportContents& contents, const std::string& label, ErrorOf error) {
  double high = 0;
  for (const auto& run : contents.runs) {
    const auto statistics = statisticsOf(withoutHoles(valuesOf(run, error)));
    if (std::isfinite(statistics.p95)) high = std::max(high, 1.5 * statistics.p95);
  }
  if (!(high > 0)) high = 1;
  Plot plot;
  for (std::size_t i = 0; i < contents.runs.size(); ++i) {
    Plot one = histogram(withoutHoles(valuesOf(contents.runs[i], error)), 0, high, kBins);
    one.series[0].label = contents.names[i];
    if (i == 0)
      plot = one;
    else
      plot.series.push_back(one.series[0]);
  }
  plot.title = "Histogram of the " + label;
  plot.x_label = label;
  plot.y_label = "frames";
  return plot;
}

Plot pathPlot(const ReportContents& contents, int axis) {
  Plot plot = plotOf(std::string("Path along ") + "xyz"[axis], "time [s]", "position [mm]");
  const auto& first = contents.runs.front();
  std::vector<double> truth;
  for (const auto& frame : first.frames)
    truth.push_back(frame.truth.translation()[axis] * kMillimetres);
  addCurve(plot, "truth", timesOf(first), truth);
  for (std::size_t i = 0; i < contents.runs.size(); ++i)
    addCurve(plot, contents.names[i], timesOf(contents.runs[i]),
             valuesOf(contents.runs[i], [axis](const FrameError& frame) {
               return frame.estimate->translation()[axis] * kMillimetres;
             }));
  return plot;
}

/// Means over slices of equal depth, since several frames may share a depth.
Plot errorOverDepth(const ReportContents& contents) {
  Plot plot = plotOf("Position error over depth (RMS of each centimetre)", "true depth [cm]",
                     "position RMS [mm]", Plot::Kind::kPoints);
  for (std::size_t i = 0; i < contents.runs.size(); ++i) {
    std::map<int, std::vector<double>> slices;
    for (const auto& frame : contents.runs[i].frames)
      if (frame.estimate)
        slices[static_cast<int>(frame.distance * 100)].push_back(positionOf(frame));
    std::vector<double> depths, errors;
    for (const auto& [centimetre, values] : slices) {
      depths.push_back(centimetre + 0.5);
      errors.push_back(statisticsOf(values).rms);
    }
    addCurve(plot, contents.names[i], depths, errors);
  }
  return plot;
}

void addNees(HtmlPage& page, const ReportContents& contents) {
  Plot plot = plotOf("Normalised estimation error squared", "time [s]", "NEES");
  plot.log_y = true;
  std::string text;
  for (std::size_t i = 0; i < contents.runs.size(); ++i) {
    const auto& run = contents.runs[i];
    if (!run.nees) continue;
    addCurve(plot, contents.names[i], timesOf(run), valuesOf(run, [](const FrameError& frame) {
               return frame.nees && *frame.nees > 0 ? *frame.nees : kHole;
             }));
    char line[200];
    std::snprintf(line, sizeof line, "%s: mean %.2f, 95 %% band of the mean %.2f to %.2f. ",
                  contents.names[i].c_str(), run.nees->mean, run.nees->band_low,
                  run.nees->band_high);
    text += line;
  }
  if (plot.series.empty()) return;
  page.addHeading("Does the covariance tell the truth?");
  page.addText(text);
  page.addPlot(plot);
}

std::string format(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  char text[40];
  std::snprintf(text, sizeof text, "%.*f", decimals, value);
  return text;
}

void addTables(HtmlPage& page, const ReportContents& contents) {
  std::vector<std::string> headings{"figure"};
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < contents.runs.size(); ++i) {
    headings.push_back(contents.names[i]);
    const auto figures = figuresOf(contents.runs[i]);
    if (i == 0)
      for (const auto& figure : figures) rows.push_back({figure.name});
    for (std::size_t k = 0; k < figures.size(); ++k) rows[k].push_back(figures[k].value);
  }
  page.addHeading("Figures");
  page.addTable(headings, rows);

  rows.clear();
  for (std::size_t i = 0; i < contents.runs.size(); ++i)
    for (const auto& band : contents.runs[i].bands)
      rows.push_back({contents.names[i],
                      format(band.nearest * 100, 0) + " to " + format(band.farthest * 100, 0),
                      std::to_string(band.frames), std::to_string(band.frames - band.with_pose),
                      format(band.position.rms * kMillimetres, 3),
                      format(band.orientation.rms * kDegrees, 3),
                      format(band.within_1mm_1deg * 100, 1), format(band.within_2mm_2deg * 100, 1),
                      format(band.within_5mm_5deg * 100, 1)});
  page.addHeading("By distance");
  page.addTable({"run", "depth [cm]", "frames", "without a pose", "position RMS [mm]",
                 "orientation RMS [deg]", "1mm1deg [%]", "2mm2deg [%]", "5mm5deg [%]"},
                rows);
}

void addTimes(HtmlPage& page, const CsvTable& table) {
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < table.headings.size(); ++i) {
    const std::string& heading = table.headings[i];
    if (heading.size() < 3 || heading.compare(heading.size() - 3, 3, "_ms") != 0) continue;
    auto values = withoutHoles(table.columns[i]);
    if (values.empty()) continue;
    std::sort(values.begin(), values.end());
    const auto at = [&](double share) {
      return format(
          values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1))], 3);
    };
    rows.push_back({heading.substr(0, heading.size() - 3), at(0.5), at(0.99), at(1.0)});
  }
  if (!rows.empty()) page.addTable({"step", "median [ms]", "99 % [ms]", "longest [ms]"}, rows);
}

void addPlots(HtmlPage& page, const std::vector<Plot>& plots) {
  for (const auto& plot : plots) page.addPlot(plot);
}

}  // namespace

std::vector<Plot> plotsOver(const CsvTable& table, double begin) {
  std::vector<double> times = table.column("stamp");
  for (auto& time : times) time -= begin;
  std::vector<Plot> plots;
  std::map<std::string, std::size_t> plot_of_unit;
  for (std::size_t i = 0; i < table.headings.size(); ++i) {
    const std::string& heading = table.headings[i];
    if (heading == "stamp" || withoutHoles(table.columns[i]).empty()) continue;
    std::string unit;
    for (const std::string candidate : kUnits)
      if (heading.size() > candidate.size() &&
          heading.compare(heading.size() - candidate.size(), candidate.size(), candidate) == 0)
        unit = candidate.substr(1);
    const std::string name =
        unit.empty() ? heading : heading.substr(0, heading.size() - unit.size() - 1);
    const auto known = plot_of_unit.find(unit);
    if (!unit.empty() && known != plot_of_unit.end()) {
      addCurve(plots[known->second], name, times, table.columns[i]);
      continue;
    }
    if (!unit.empty()) plot_of_unit[unit] = plots.size();
    Plot plot = plotOf(table.name + (unit.empty() ? ": " + name : ""), "time [s]",
                       unit.empty() ? name : "[" + unit + "]");
    addCurve(plot, name, times, table.columns[i]);
    plots.push_back(plot);
  }
  return plots;
}

HtmlPage reportPage(const ReportContents& contents) {
  if (contents.runs.empty() || contents.runs.size() != contents.names.size())
    throw std::invalid_argument("report: needs at least one run, and one name for each");
  HtmlPage page(contents.title);
  addTables(page, contents);

  page.addHeading("Errors over time");
  page.addText(
      "A hole in a curve is a frame without a pose. Drag over a plot to look closer, "
      "double-click to go back.");
  page.addPlot(errorOverTime(contents, "position error [mm]", positionOf));
  page.addPlot(errorOverTime(contents, "orientation error [deg]", orientationOf));

  page.addHeading("Distribution of the errors");
  for (const auto& [label, error] : {std::make_pair("position error [mm]", &positionOf),
                                     std::make_pair("orientation error [deg]", &orientationOf)}) {
    Plot shares = distribution(contents, label, error);
    bridgeHoles(shares);
    page.addPlot(shares);
    page.addPlot(histogramOf(contents, label, error));
  }
  page.addPlot(errorOverDepth(contents));

  page.addHeading("Path");
  for (int axis = 0; axis < 3; ++axis) page.addPlot(pathPlot(contents, axis));
  addNees(page, contents);

  const double begin = seconds(contents.runs.front().frames.front().stamp);
  for (const auto& table : contents.series) {
    page.addHeading("Noted by the tracker: " + table.name);
    addTimes(page, table);
    addPlots(page, plotsOver(table, begin));
  }
  for (const auto& table : contents.histograms) {
    page.addHeading("Histogram: " + table.name);
    for (std::size_t i = 1; i < table.columns.size(); ++i) {
      Plot plot = plotOf(table.headings[i], table.headings[0], "count", Plot::Kind::kBars);
      plot.x = table.columns[0];
      plot.series.push_back({table.headings[i], table.columns[i]});
      page.addPlot(plot);
    }
  }
  if (!contents.pictures.empty()) page.addHeading("Pictures");
  for (const auto& [path, caption] : contents.pictures) page.addPicture(path, caption);
  return page;
}

}  // namespace leap_object_tracker
