#include "leap_object_tracker/evaluation/report_text.hpp"

#include <algorithm>
#include <cmath>
#include <iomanip>
#include <sstream>

namespace leap_object_tracker {
namespace {

constexpr double kMillimetres = 1e3;
constexpr double kMilliseconds = 1e3;
constexpr double kDegrees = 180.0 / M_PI;
constexpr double kPercent = 100.0;

std::string fixed(double value, int decimals) {
  if (!std::isfinite(value)) return "-";
  std::ostringstream out;
  out << std::fixed << std::setprecision(decimals) << value;
  return out.str();
}

std::string fixed(const std::optional<double>& value, double unit, int decimals) {
  return value ? fixed(*value * unit, decimals) : "-";
}

void addStatistics(std::vector<Figure>& figures, const std::string& name, const std::string& unit,
                   const ErrorStatistics& statistics, double factor) {
  figures.push_back({name + " RMS [" + unit + "]", fixed(statistics.rms * factor, 3)});
  figures.push_back({name + " median [" + unit + "]", fixed(statistics.median * factor, 3)});
  figures.push_back({name + " 95 % [" + unit + "]", fixed(statistics.p95 * factor, 3)});
  figures.push_back({name + " largest [" + unit + "]", fixed(statistics.largest * factor, 3)});
}

std::vector<double> relockTimes(const TrajectoryReport& report) {
  std::vector<double> times;
  for (const auto& gap : report.gaps)
    if (gap.closed) times.push_back(gap.length);
  return times;
}

}  // namespace

std::vector<Figure> figuresOf(const TrajectoryReport& report) {
  std::vector<Figure> figures;
  figures.push_back({"frames", std::to_string(report.frames.size())});
  figures.push_back({"frames without a pose", std::to_string(report.without_pose)});
  figures.push_back({"poses without a truth", std::to_string(report.without_truth)});
  figures.push_back({"duration [s]", fixed(report.duration, 2)});
  addStatistics(figures, "position", "mm", report.position, kMillimetres);
  addStatistics(figures, "orientation", "deg", report.orientation, kDegrees);
  for (std::size_t axis = 0; axis < 3; ++axis)
    figures.push_back({std::string("position RMS along ") + "xyz"[axis] + " [mm]",
                       fixed(report.axis_rms[axis] * kMillimetres, 3)});
  figures.push_back({"within 1 mm and 1 deg [%]", fixed(report.within_1mm_1deg * kPercent, 2)});
  figures.push_back({"within 2 mm and 2 deg [%]", fixed(report.within_2mm_2deg * kPercent, 2)});
  figures.push_back({"within 5 mm and 5 deg [%]", fixed(report.within_5mm_5deg * kPercent, 2)});
  figures.push_back({"wrong poses [%]", fixed(report.wrong * kPercent, 2)});
  figures.push_back({"ADD mean [mm]", fixed(report.add.mean * kMillimetres, 3)});
  figures.push_back({"ADD AUC [%]", fixed(report.add_auc * kPercent, 2)});
  figures.push_back({"ADD-S mean [mm]", fixed(report.add_s.mean * kMillimetres, 3)});
  figures.push_back({"ADD-S AUC [%]", fixed(report.add_s_auc * kPercent, 2)});
  figures.push_back({"MSSD mean [mm]", fixed(report.mssd.mean * kMillimetres, 3)});
  figures.push_back({"MSSD 95 % [mm]", fixed(report.mssd.p95 * kMillimetres, 3)});
  figures.push_back({"jitter of position [mm]", fixed(report.jitter_position * kMillimetres, 3)});
  figures.push_back(
      {"jitter of orientation [deg]", fixed(report.jitter_orientation * kDegrees, 3)});
  figures.push_back({"lag [ms]", fixed(report.lag, kMilliseconds, 1)});
  figures.push_back({"time to first pose [s]", fixed(report.time_to_first_pose, 1, 3)});
  figures.push_back({"time to good pose [s]", fixed(report.time_to_good_pose, 1, 3)});
  const auto relocks = relockTimes(report);
  const auto relock = statisticsOf(relocks);
  figures.push_back({"gaps", std::to_string(report.gaps.size())});
  figures.push_back({"gaps closed", std::to_string(relocks.size())});
  figures.push_back({"gap to good pose median [s]", fixed(relock.median, 3)});
  figures.push_back({"gap to good pose longest [s]", fixed(relock.largest, 3)});
  const auto& nees = report.nees;
  figures.push_back({"NEES frames", nees ? std::to_string(nees->frames) : "-"});
  figures.push_back({"NEES expected", nees ? std::to_string(nees->degrees_of_freedom) : "-"});
  figures.push_back({"NEES mean", nees ? fixed(nees->mean, 2) : "-"});
  figures.push_back({"NEES band low", nees ? fixed(nees->band_low, 2) : "-"});
  figures.push_back({"NEES band high", nees ? fixed(nees->band_high, 2) : "-"});
  figures.push_back(
      {"NEES frames in their band [%]", nees ? fixed(nees->share_inside * kPercent, 1) : "-"});
  return figures;
}

void writeText(std::ostream& out, const TrajectoryReport& report) {
  const auto figures = figuresOf(report);
  std::size_t width = 0;
  for (const auto& figure : figures) width = std::max(width, figure.name.size());
  for (const auto& figure : figures)
    out << std::left << std::setw(static_cast<int>(width)) << figure.name << std::right
        << std::setw(12) << figure.value << '\n';

  out << "\n depth [cm]  frames  no pose  position RMS [mm]  orientation RMS [deg]  2mm2deg [%]  "
         "5mm5deg [%]\n";
  for (const auto& band : report.bands)
    out << std::setw(5) << fixed(band.nearest * 100, 0) << "-" << std::left << std::setw(5)
        << fixed(band.farthest * 100, 0) << std::right << std::setw(8) << band.frames
        << std::setw(9) << band.frames - band.with_pose << std::setw(19)
        << fixed(band.position.rms * kMillimetres, 3) << std::setw(23)
        << fixed(band.orientation.rms * kDegrees, 3) << std::setw(13)
        << fixed(band.within_2mm_2deg * kPercent, 1) << std::setw(13)
        << fixed(band.within_5mm_5deg * kPercent, 1) << '\n';
  for (const auto& gap : report.gaps)
    out << "no good pose from " << fixed(gap.begin, 3) << " s on, for " << fixed(gap.length, 3)
        << " s" << (gap.closed ? "" : ", to the end") << '\n';
}

void writeSummaryCsv(std::ostream& out, const std::vector<std::string>& names,
                     const std::vector<TrajectoryReport>& reports) {
  for (std::size_t i = 0; i < reports.size(); ++i) {
    const auto figures = figuresOf(reports[i]);
    if (i == 0) {
      out << "run";
      for (const auto& figure : figures) out << ',' << figure.name;
      out << '\n';
    }
    out << names[i];
    for (const auto& figure : figures) out << ',' << (figure.value == "-" ? "" : figure.value);
    out << '\n';
  }
}

void writeFrameCsv(std::ostream& out, const TrajectoryReport& report) {
  out << "stamp,time_s,depth_mm,x_mm,y_mm,z_mm,position_mm,orientation_deg,add_mm,add_s_mm,mssd_mm,"
         "nees\n";
  for (const auto& frame : report.frames) {
    out << std::fixed << std::setprecision(9) << seconds(frame.stamp) << std::setprecision(6) << ','
        << seconds(frame.stamp - report.frames.front().stamp) << ','
        << frame.distance * kMillimetres;
    if (!frame.estimate) {
      out << ",,,,,,,,,\n";
      continue;
    }
    for (int axis = 0; axis < 3; ++axis) out << ',' << frame.offset[axis] * kMillimetres;
    out << ',' << frame.position * kMillimetres << ',' << frame.orientation * kDegrees << ','
        << frame.add * kMillimetres << ',' << frame.add_s * kMillimetres << ','
        << frame.mssd * kMillimetres << ',';
    if (frame.nees) out << *frame.nees;
    out << '\n';
  }
}

}  // namespace leap_object_tracker
