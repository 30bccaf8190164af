#include "leap_object_tracker/evaluation/start_trials.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <iomanip>
#include <sstream>

#include "leap_object_tracker/evaluation/trajectory_error.hpp"

namespace leap_object_tracker {
namespace {

constexpr double kDegree = M_PI / 180;
constexpr std::size_t kDue = 3;     // frame in which the pose must be there
constexpr double kNearBand = 0.15;  // [m]
constexpr std::array<double, 6> kBandLimits{0.0, 0.06, 0.10, 0.15, 0.22, 0.30};  // [m]

constexpr std::array<double, 5> kAngleLimits{0, 20, 40, 60, 90};  // [deg]

bool within(const StartFrame& frame, double metres, double degrees) {
  return frame.position <= metres && frame.orientation <= degrees * kDegree;
}

double percentile(std::vector<double> values, double share) {
  if (values.empty()) return std::nan("");
  std::sort(values.begin(), values.end());
  return values[static_cast<std::size_t>(share * static_cast<double>(values.size() - 1) + 0.5)];
}

using Chooser = std::function<bool(const StartTrial&)>;

void writeRow(std::ostream& out, const std::string& name, const std::vector<StartTrial>& trials,
              const Chooser& chosen) {
  std::array<int, 4> verdicts{};
  int starts = 0, late = 0, frames = 0, wrong_frames = 0;
  std::vector<double> position, orientation;
  for (const auto& trial : trials) {
    if (!chosen(trial)) continue;
    ++starts;
    const StartVerdict verdict = verdictOf(trial, kDue);
    ++verdicts[static_cast<std::size_t>(verdict)];
    if (verdict != StartVerdict::kRight &&
        verdictOf(trial, trial.frames.size()) == StartVerdict::kRight)
      ++late;
    for (const auto& frame : trial.frames) {
      ++frames;
      wrong_frames += frame.tracked && !within(frame, 0.010, 10);
    }
    if (verdict == StartVerdict::kRight) {
      position.push_back(1e3 * trial.frames[kDue - 1].position);
      orientation.push_back(trial.frames[kDue - 1].orientation / kDegree);
    }
  }
  if (starts == 0) return;
  const auto percent = [&](int count, int of) { return 100.0 * count / std::max(1, of); };
  out << "| " << name << " | " << starts << std::fixed << std::setprecision(1);
  for (const int count : verdicts) out << " | " << percent(count, starts);
  out << " | " << percent(late, starts) << std::setprecision(2) << " | "
      << percent(wrong_frames, frames) << " | " << percentile(position, 0.5) << " | "
      << percentile(orientation, 0.5) << " |\n";
}

std::vector<std::string> distinct(const std::vector<StartTrial>& trials,
                                  std::string StartTrial::*member) {
  std::vector<std::string> names;
  for (const auto& trial : trials)
    if (std::find(names.begin(), names.end(), trial.*member) == names.end())
      names.push_back(trial.*member);
  std::sort(names.begin(), names.end());
  return names;
}

void writeTimes(std::ostream& out, const std::vector<StartTrial>& trials) {
  std::vector<double> searches, first_pose, to_pose_frames;
  for (const auto& trial : trials) {
    double sum = 0;
    bool found = false;
    for (const auto& frame : trial.frames) {
      if (frame.search_ms > 0) searches.push_back(frame.search_ms);
      sum += frame.total_ms;
      if (found || !frame.tracked) continue;
      found = true;
      first_pose.push_back(sum);
    }
  }
  const auto row = [&](const char* name, const std::vector<double>& values) {
    out << "| " << name << " | " << values.size() << std::fixed << std::setprecision(1) << " | "
        << percentile(values, 0.5) << " | " << percentile(values, 0.99) << " | "
        << percentile(values, 1) << " |\n";
  };
  out << "\n| time [ms] | of | median | 99 % | longest |\n|---|---:|---:|---:|---:|\n";
  row("one search", searches);
  row("all work until the first pose", first_pose);
}

}  // namespace

StartFrame judgeStart(const std::optional<Pose>& estimate, const Pose& truth,
                      const Symmetry& symmetry) {
  StartFrame frame;
  if (!estimate) return frame;
  frame.tracked = true;
  frame.position = (estimate->translation() - truth.translation()).norm();
  frame.orientation = angleBetween(estimate->linear(), truth.linear(), symmetry);
  return frame;
}

std::string wordFrom(StartVerdict verdict) {
  switch (verdict) {
    case StartVerdict::kRight:
      return "right";
    case StartVerdict::kInexact:
      return "inexact";
    case StartVerdict::kWrong:
      return "wrong";
    case StartVerdict::kNone:
      break;
  }
  return "none";
}

StartVerdict verdictOf(const StartTrial& trial, std::size_t number) {
  if (number == 0 || number > trial.frames.size()) return StartVerdict::kNone;
  const StartFrame& frame = trial.frames[number - 1];
  if (!frame.tracked) return StartVerdict::kNone;
  if (!within(frame, 0.010, 10)) return StartVerdict::kWrong;
  const bool near = trial.depth <= kNearBand;
  return within(frame, near ? 0.002 : 0.005, near ? 2 : 5) ? StartVerdict::kRight
                                                           : StartVerdict::kInexact;
}

void writeStartTable(std::ostream& out, const std::vector<StartTrial>& trials) {
  out << "| starts | number | right [%] | inexact [%] | wrong [%] | none [%] | right later [%] | "
         "wrong frames [%] | position median [mm] | orientation median [deg] |\n|---|"
      << "---:|---:|---:|---:|---:|---:|---:|---:|---:|\n";
  for (const auto& name : distinct(trials, &StartTrial::object))
    writeRow(out, name, trials, [&](const StartTrial& trial) { return trial.object == name; });
  for (const auto& name : distinct(trials, &StartTrial::surroundings))
    writeRow(out, name, trials,
             [&](const StartTrial& trial) { return trial.surroundings == name; });
  for (std::size_t i = 0; i + 1 < kBandLimits.size(); ++i) {
    const double low = kBandLimits[i],
                 high = i + 2 == kBandLimits.size() ? 1e9 : kBandLimits[i + 1];
    std::ostringstream name;
    name << "from " << 100 * low << (high < 1 ? " to " : " cm on");
    if (high < 1) name << 100 * high << " cm";
    writeRow(out, name.str(), trials,
             [&](const StartTrial& trial) { return trial.depth >= low && trial.depth < high; });
  }
  for (std::size_t i = 0; i + 1 < kAngleLimits.size(); ++i) {
    const double low = kAngleLimits[i], high = kAngleLimits[i + 1];
    std::ostringstream name;
    name << low << " to " << high << " deg off axis";
    writeRow(out, name.str(), trials, [&](const StartTrial& trial) {
      return trial.off_axis >= low * kDegree && trial.off_axis < high * kDegree;
    });
  }
  writeRow(out, "all", trials, [](const StartTrial&) { return true; });
  writeTimes(out, trials);
}

void writeStartCsvHeading(std::ostream& out) {
  out << "index,object,surroundings,depth_mm,off_axis_deg,visible,verdict,frame,tracked,position_"
         "mm,"
         "orientation_deg,search_ms,total_ms\n";
}

void writeStartCsv(std::ostream& out, const StartTrial& trial) {
  out << std::fixed;
  for (std::size_t i = 0; i < trial.frames.size(); ++i) {
    const StartFrame& frame = trial.frames[i];
    out << trial.index << ',' << trial.object << ',' << trial.surroundings << ','
        << std::setprecision(1) << 1e3 * trial.depth << ',' << trial.off_axis / kDegree << ','
        << std::setprecision(2) << trial.visible << ',' << wordFrom(verdictOf(trial, i + 1)) << ','
        << i + 1 << ',' << frame.tracked << ',' << std::setprecision(3) << 1e3 * frame.position
        << ',' << frame.orientation / kDegree << ',' << frame.search_ms << ',' << frame.total_ms
        << '\n';
  }
}

}  // namespace leap_object_tracker
