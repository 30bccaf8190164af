#include <geometry_msgs/PoseStamped.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <sstream>

#include "command_line.hpp"
#include "conversions.hpp"
#include "leap_object_tracker/evaluation/report_html.hpp"
#include "leap_object_tracker/evaluation/report_text.hpp"

namespace leap_object_tracker {
namespace {

namespace fs = std::filesystem;

constexpr const char* kUsage =
    R"(usage: evaluate ESTIMATE.tum [ESTIMATE.tum ...] TRUTH --object FILE.yaml [options]

Judges poses of an object against the true ones: a bag with a topic of poses, or a TUM file.

  --topic TOPIC            of the true poses in a bag (default: /ground_truth/pose)
  --names A,B,...          of the runs (default: the file names)
  --covariances A.csv,...  one for each estimate, as track_bag writes them
  --timing A.csv,...       one for each estimate, as track_bag writes them: the frames that a pose
                           was due for (default: every stamp of the truth)
  --absolute               turns that only texture shows count too, from the first pose on
  --csv FILE.csv           the figures, a line for each run
  --frames FILE.csv        the errors of each frame of the first run
  --html FILE.html         a report with plots that is one file
  --title TEXT             of the report
  --series A.csv,...       for the report: files with a column `stamp`, plotted over time
  --histogram A.csv,...    for the report: bin centres in the first column, counts in the others
  --pictures A.png,...     for the report: PNG or JPEG files, or folders of them
)";

const std::map<std::string, int> kOptions{
    {"object", 1},    {"topic", 1},    {"names", 1},   {"covariances", 1}, {"timing", 1},
    {"csv", 1},       {"frames", 1},   {"html", 1},    {"title", 1},       {"series", 1},
    {"histogram", 1}, {"pictures", 1}, {"absolute", 0}};

using Strings = std::vector<std::string>;

/// The parts between commas; none of an option that was not given.
Strings listOf(const CommandLine& line, const std::string& option) {
  Strings parts;
  std::istringstream in(line.text(option));
  for (std::string part; std::getline(in, part, ',');) parts.push_back(part);
  return parts;
}

Trajectory readBag(const std::string& path, const std::string& topic) {
  const auto complain = [&](const std::string& what) {
    throw std::runtime_error("bag '" + path + "': " + what);
  };
  rosbag::Bag bag;
  try {
    bag.open(path, rosbag::bagmode::Read);
  } catch (const rosbag::BagException& error) {
    complain(error.what());
  }
  Trajectory truth;
  for (const auto& message : rosbag::View(bag, rosbag::TopicQuery(topic))) {
    const auto pose = message.instantiate<geometry_msgs::PoseStamped>();
    if (!pose)
      complain("topic '" + topic + "' holds " + message.getDataType() +
               ", needs geometry_msgs/PoseStamped");
    truth.push_back({stampFrom(pose->header.stamp), poseFrom(pose->pose), {}});
  }
  if (truth.empty()) complain("no message on topic '" + topic + "'; give another with --topic");
  std::sort(truth.begin(), truth.end(),
            [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; });
  return truth;
}

Trajectory readTruth(const std::string& path, const CommandLine& line) {
  if (fs::path(path).extension() != ".bag") return readTum(path);
  return readBag(path, line.text("topic", "/ground_truth/pose"));
}

std::vector<std::pair<std::string, std::string>> picturesOf(const Strings& paths) {
  Strings files;
  for (const auto& path : paths) {
    if (!fs::is_directory(path)) {
      files.push_back(path);
      continue;
    }
    Strings inside;
    for (const auto& entry : fs::directory_iterator(path))
      if (entry.path().extension() == ".png" || entry.path().extension() == ".jpg")
        inside.push_back(entry.path().string());
    std::sort(inside.begin(), inside.end());
    files.insert(files.end(), inside.begin(), inside.end());
  }
  std::vector<std::pair<std::string, std::string>> pictures;
  for (const auto& file : files) pictures.emplace_back(file, fs::path(file).stem().string());
  return pictures;
}

std::vector<CsvTable> tablesOf(const Strings& paths) {
  std::vector<CsvTable> tables;
  for (const auto& path : paths) tables.push_back(readCsv(path));
  return tables;
}

/// What the command line names: the estimates and what belongs to each.
struct Runs {
  Strings estimates, names, covariances;
  std::vector<CsvTable> timings;
  std::string truth;
};

Runs readRuns(const CommandLine& line) {
  Runs runs;
  const Strings& files = line.positional();
  if (files.size() < 2) throw UsageError("expected at least one ESTIMATE.tum and then the TRUTH");
  if (!line.has("object")) throw UsageError("--object is missing");
  runs.truth = files.back();
  runs.estimates.assign(files.begin(), files.end() - 1);
  runs.names = listOf(line, "names");
  if (!line.has("names"))
    for (const auto& path : runs.estimates) runs.names.push_back(fs::path(path).stem().string());
  runs.covariances = listOf(line, "covariances");
  const Strings timings = listOf(line, "timing");
  for (const auto& [option, count] : {std::make_pair("names", runs.names.size()),
                                      std::make_pair("covariances", runs.covariances.size()),
                                      std::make_pair("timing", timings.size())})
    if (line.has(option) && count != runs.estimates.size())
      throw UsageError("--" + std::string(option) + " lists " + std::to_string(count) + ", but " +
                       std::to_string(runs.estimates.size()) + " estimates are given");
  runs.timings = tablesOf(timings);
  return runs;
}

TrajectoryReport judge(const Runs& runs, std::size_t i, const Trajectory& truth,
                       const ObjectModel& object, bool absolute) {
  Trajectory estimate = readTum(runs.estimates[i]);
  if (!runs.covariances.empty()) readCovariances(runs.covariances[i], estimate);
  EvaluationParams params;
  params.absolute_orientation = absolute;
  if (!runs.timings.empty())
    for (const double stamp : runs.timings[i].column("stamp"))
      params.frames.push_back(stampFromSeconds(stamp));
  return compare(estimate, truth, object, params);
}

void writeHtml(const CommandLine& line, ReportContents contents, const Runs& runs) {
  contents.title = line.text("title", "Poses against " + fs::path(runs.truth).filename().string());
  for (std::size_t i = 0; i < runs.timings.size(); ++i) {
    contents.series.push_back(runs.timings[i]);
    contents.series.back().name = "times of " + runs.names[i];
  }
  for (const auto& table : tablesOf(listOf(line, "series"))) contents.series.push_back(table);
  contents.histograms = tablesOf(listOf(line, "histogram"));
  contents.pictures = picturesOf(listOf(line, "pictures"));
  reportPage(contents).write(line.text("html"));
  std::cout << "\nreport: " << line.text("html") << '\n';
}

void run(const CommandLine& line) {
  const Runs runs = readRuns(line);
  const ObjectModel object = loadObject(line.text("object"));
  const Trajectory truth = readTruth(runs.truth, line);
  ReportContents contents;
  contents.names = runs.names;
  for (std::size_t i = 0; i < runs.estimates.size(); ++i) {
    contents.runs.push_back(judge(runs, i, truth, object, line.has("absolute")));
    std::cout << (i == 0 ? "" : "\n") << runs.names[i] << '\n';
    writeText(std::cout, contents.runs.back());
  }
  if (line.has("csv")) {
    std::ofstream file = createFile(line.text("csv"));
    writeSummaryCsv(file, contents.names, contents.runs);
  }
  if (line.has("frames")) {
    std::ofstream file = createFile(line.text("frames"));
    writeFrameCsv(file, contents.runs.front());
  }
  if (line.has("html")) writeHtml(line, std::move(contents), runs);
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"evaluate", kUsage, kOptions}, argc, argv, run);
}
