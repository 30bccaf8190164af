#include "leap_object_tracker/evaluation/report_text.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <sstream>

namespace leap_object_tracker {
namespace {

using testing::HasSubstr;

/// Four frames, 25 ms apart, 2 mm off in z; the third has no pose.
TrajectoryReport smallReport() {
  Trajectory truth, estimate;
  for (int i = 0; i < 4; ++i) {
    StampedPose pose;
    pose.stamp = stampFromSeconds(100 + 0.025 * i);
    pose.camera_from_object.translation().z() = 0.1;
    truth.push_back(pose);
    pose.camera_from_object.translation().z() += 0.002;
    if (i != 2) estimate.push_back(pose);
  }
  return compare(estimate, truth,
                 makePrimitive("cube", Shape::kBox, Eigen::Vector3d(0.03, 0.03, 0.03)));
}

std::string valueOf(const TrajectoryReport& report, const std::string& name) {
  for (const auto& figure : figuresOf(report))
    if (figure.name == name) return figure.value;
  return "no figure '" + name + "'";
}

TEST(FiguresOf, areInTheUnitsOfTheirNames) {
  const TrajectoryReport report = smallReport();
  EXPECT_EQ(valueOf(report, "frames"), "4");
  EXPECT_EQ(valueOf(report, "frames without a pose"), "1");
  EXPECT_EQ(valueOf(report, "position RMS [mm]"), "2.000");
  EXPECT_EQ(valueOf(report, "within 5 mm and 5 deg [%]"), "75.00");
  EXPECT_EQ(valueOf(report, "gap to good pose longest [s]"), "0.025");
}

TEST(FiguresOf, sayADashForWhatIsUnknown) {
  EXPECT_EQ(valueOf(smallReport(), "lag [ms]"), "-");
  EXPECT_EQ(valueOf(smallReport(), "NEES mean"), "-");
}

TEST(WriteText, showsTheDistanceBand) {
  std::ostringstream out;
  writeText(out, smallReport());
  EXPECT_THAT(out.str(), HasSubstr("10-15"));
  EXPECT_THAT(out.str(), HasSubstr("no good pose from 0.050 s on, for 0.025 s"));
}

TEST(WriteSummaryCsv, hasAsManyCellsInEachLine) {
  std::ostringstream out;
  writeSummaryCsv(out, {"first", "second"}, {smallReport(), smallReport()});
  std::istringstream in(out.str());
  std::string heading, first, second, nothing;
  std::getline(in, heading);
  std::getline(in, first);
  std::getline(in, second);
  EXPECT_FALSE(std::getline(in, nothing));
  EXPECT_THAT(second, testing::StartsWith("second,4,1,"));
  EXPECT_EQ(std::count(heading.begin(), heading.end(), ','),
            std::count(first.begin(), first.end(), ','));
}

TEST(WriteFrameCsv, leavesCellsEmptyWithoutAPose) {
  std::ostringstream out;
  writeFrameCsv(out, smallReport());
  EXPECT_THAT(out.str(), HasSubstr("100.050000000,0.050000,100.000000,,,,,,,,,\n"));
  EXPECT_THAT(out.str(),
              HasSubstr("100.025000000,0.025000,100.000000,0.000000,0.000000,2.000000,"));
}

}  // namespace
}  // namespace leap_object_tracker
