#include "leap_object_tracker/evaluation/start_trials.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "leap_object_tracker/geometry/object_model.hpp"

namespace leap_object_tracker {
namespace {

using ::testing::HasSubstr;

constexpr double kDegree = M_PI / 180;

StartFrame frameOff(double millimetres, double degrees) {
  StartFrame frame;
  frame.tracked = true;
  frame.position = 1e-3 * millimetres;
  frame.orientation = degrees * kDegree;
  frame.total_ms = 5;
  return frame;
}

StartTrial trialAt(double depth, const std::vector<StartFrame>& frames) {
  StartTrial trial;
  trial.object = "cube";
  trial.surroundings = "dark wall";
  trial.depth = depth;
  trial.frames = frames;
  return trial;
}

TEST(VerdictOf, isStricterUpToFifteenCentimetres) {
  EXPECT_EQ(verdictOf(trialAt(0.10, {frameOff(1.9, 1.9)}), 1), StartVerdict::kRight);
  EXPECT_EQ(verdictOf(trialAt(0.10, {frameOff(2.1, 1)}), 1), StartVerdict::kInexact);
  EXPECT_EQ(verdictOf(trialAt(0.10, {frameOff(1, 2.1)}), 1), StartVerdict::kInexact);
  EXPECT_EQ(verdictOf(trialAt(0.20, {frameOff(4.9, 4.9)}), 1), StartVerdict::kRight);
  EXPECT_EQ(verdictOf(trialAt(0.20, {frameOff(5.1, 1)}), 1), StartVerdict::kInexact);
  EXPECT_EQ(verdictOf(trialAt(0.20, {frameOff(11, 1)}), 1), StartVerdict::kWrong);
  EXPECT_EQ(verdictOf(trialAt(0.20, {frameOff(1, 11)}), 1), StartVerdict::kWrong);
}

TEST(VerdictOf, isNoneWithoutAPoseOrFrame) {
  EXPECT_EQ(verdictOf(trialAt(0.1, {StartFrame{}}), 1), StartVerdict::kNone);
  EXPECT_EQ(verdictOf(trialAt(0.1, {frameOff(0, 0)}), 2), StartVerdict::kNone);
}

TEST(JudgeStart, takesTheNearestEquivalentOrientation) {
  const ObjectModel cube = makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03});
  Pose truth = Pose::Identity(), estimate = Pose::Identity();
  truth.translation().z() = 0.1;
  estimate.translation().z() = 0.103;
  estimate.linear() = rotationFromVector({0, 0, 91 * kDegree});
  const StartFrame frame = judgeStart(estimate, truth, cube.symmetry);
  EXPECT_TRUE(frame.tracked);
  EXPECT_NEAR(frame.position, 0.003, 1e-12);
  EXPECT_NEAR(frame.orientation, kDegree, 1e-9);
  EXPECT_FALSE(judgeStart(std::nullopt, truth, cube.symmetry).tracked);
}

TEST(StartTable, countsByObjectAndDepth) {
  const StartFrame none, right = frameOff(1, 1), wrong = frameOff(1, 90);
  std::vector<StartTrial> trials{
      trialAt(0.08, {none, right, right, right}), trialAt(0.08, {none, wrong, wrong, right}),
      trialAt(0.20, {none, none, none, none}), trialAt(0.20, {none, right, right, right})};
  trials[3].object = "prism";
  std::ostringstream out;
  writeStartTable(out, trials);
  EXPECT_THAT(out.str(), HasSubstr("| cube | 3 | 33.3 | 0.0 | 33.3 | 33.3 | 33.3 | 16.67 |"));
  EXPECT_THAT(out.str(), HasSubstr("| prism | 1 | 100.0 | 0.0 | 0.0 | 0.0 |"));
  EXPECT_THAT(out.str(), HasSubstr("| from 6 to 10 cm | 2 | 50.0 |"));
  EXPECT_THAT(out.str(), HasSubstr("| all | 4 | 50.0 | 0.0 | 25.0 | 25.0 | 25.0 | 12.50 |"));
  EXPECT_THAT(out.str(), HasSubstr("| all work until the first pose | 3 | 5.0 |"));
}

TEST(StartCsv, hasALineForEachFrame) {
  std::ostringstream out;
  writeStartCsv(out, trialAt(0.08, {StartFrame{}, frameOff(1.25, 2.5)}));
  EXPECT_THAT(out.str(), HasSubstr("0,cube,dark wall,80.0,0.0,0.00,inexact,2,1,1.250,2.500,"));
}

}  // namespace
}  // namespace leap_object_tracker
