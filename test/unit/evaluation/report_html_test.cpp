#include "leap_object_tracker/evaluation/report_html.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <iterator>

namespace leap_object_tracker {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

TrajectoryReport shortRun(double offset) {
  Trajectory truth, estimate;
  for (int i = 0; i < 3; ++i) {
    StampedPose pose;
    pose.stamp = stampFromSeconds(50 + 0.1 * i);
    pose.camera_from_object.translation() = Eigen::Vector3d(0.01 * i, 0, 0.1);
    truth.push_back(pose);
    pose.camera_from_object.translation().y() += offset;
    estimate.push_back(pose);
  }
  return compare(estimate, truth,
                 makePrimitive("cube", Shape::kBox, Eigen::Vector3d(0.03, 0.03, 0.03)));
}

std::string written(const HtmlPage& page) {
  const std::string path = testing::TempDir() + "report.html";
  page.write(path);
  std::ifstream file(path);
  const std::string text{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  std::remove(path.c_str());
  return text;
}

TEST(PlotsOver, putColumnsOfOneUnitIntoOnePlot) {
  const CsvTable table{"times",
                       {"stamp", "edges_ms", "particles", "filter_ms", "state"},
                       {{10, 11}, {1, 2}, {500, 600}, {3, 4}, {NAN, NAN}}};
  const auto plots = plotsOver(table, 10);
  ASSERT_EQ(plots.size(), 2u);
  EXPECT_THAT(plots[0].x, ElementsAre(0, 1));
  ASSERT_EQ(plots[0].series.size(), 2u);
  EXPECT_EQ(plots[0].series[1].label, "filter");
  EXPECT_THAT(plots[0].series[1].y, ElementsAre(3, 4));
  EXPECT_EQ(plots[1].series[0].label, "particles");
}

TEST(ReportPage, showsEveryRunWithItsFiguresAndCurves) {
  ReportContents contents;
  contents.title = "Two runs";
  contents.names = {"first run", "second run"};
  contents.runs = {shortRun(0.001), shortRun(0.0025)};
  const std::string text = written(reportPage(contents));
  EXPECT_THAT(text, HasSubstr("<td>position RMS [mm]</td><td>1.000</td><td>2.500</td>"));
  EXPECT_THAT(text, HasSubstr("series:[\"first run\",\"second run\"],data:[[0,0.1,0.2],[1,1,1],"
                              "[2.5,2.5,2.5]]"));
}

TEST(ReportPage, needsANameForEachRun) {
  ReportContents contents;
  contents.runs = {shortRun(0)};
  EXPECT_THROW(reportPage(contents), std::invalid_argument);
}

TEST(ReportPage, needsAStampInEachSeries) {
  ReportContents contents;
  contents.names = {"run"};
  contents.runs = {shortRun(0)};
  contents.series = {{"wrong", {"time"}, {{1}}}};
  EXPECT_THROW(reportPage(contents), std::runtime_error);
}

}  // namespace
}  // namespace leap_object_tracker
