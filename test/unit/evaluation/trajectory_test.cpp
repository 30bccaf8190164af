#include "leap_object_tracker/evaluation/trajectory.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>
#include <string>

namespace leap_object_tracker {
namespace {

using testing::HasSubstr;
using namespace std::chrono_literals;

class TrajectoryFile : public testing::Test {
 protected:
  ~TrajectoryFile() override { std::remove(path_.c_str()); }

  void write(const std::string& text) { std::ofstream(path_) << text; }
  std::string errorOfReading() {
    try {
      readTum(path_);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "no error";
  }

  const std::string path_ =
      testing::TempDir() + testing::UnitTest::GetInstance()->current_test_info()->name();
};

StampedPose poseAtX(double time, double x) {
  StampedPose pose;
  pose.stamp = stampFromSeconds(time);
  pose.camera_from_object.translation().x() = x;
  return pose;
}

TEST_F(TrajectoryFile, comesBackAsItWasWrittenToTheNanosecond) {
  StampedPose pose;
  pose.stamp = Stamp(1'700'000'000'123'456'789ns);
  pose.camera_from_object.translation() = Eigen::Vector3d(0.01, -0.02, 0.1);
  pose.camera_from_object.linear() = rotationFromVector({0.3, -0.2, 2.0});
  writeTum(path_, {pose});
  const Trajectory read = readTum(path_);
  ASSERT_EQ(read.size(), 1u);
  EXPECT_EQ(read[0].stamp, pose.stamp);
  EXPECT_LT(twistBetween(read[0].camera_from_object, pose.camera_from_object).norm(), 1e-8);
}

TEST_F(TrajectoryFile, takesStampsWithFewDigitsAndWithoutAPoint) {
  write("# a comment\n1.5 0 0 0 0 0 0 1\n\n2 0 0 0 0 0 0 1\r\n");
  const Trajectory read = readTum(path_);
  ASSERT_EQ(read.size(), 2u);
  EXPECT_EQ(read[0].stamp, Stamp(1500ms));
  EXPECT_EQ(read[1].stamp, Stamp(2s));
}

TEST_F(TrajectoryFile, namesTheLineWithTooFewNumbers) {
  write("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 1\n");
  EXPECT_THAT(errorOfReading(), HasSubstr("line 2: expected eight finite numbers"));
}

TEST_F(TrajectoryFile, refusesNotANumber) {
  write("1 nan 0 0 0 0 0 1\n");
  EXPECT_THAT(errorOfReading(), HasSubstr("line 1: expected eight finite numbers"));
}

TEST_F(TrajectoryFile, refusesAQuaternionThatIsNoRotation) {
  write("1 0 0 0 0 0 0 0\n");
  EXPECT_THAT(errorOfReading(), HasSubstr("not of unit length"));
}

TEST_F(TrajectoryFile, refusesStampsThatDoNotIncrease) {
  write("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n");
  EXPECT_THAT(errorOfReading(), HasSubstr("line 2: the stamp is not later"));
}

TEST_F(TrajectoryFile, namesAFileThatIsNotThere) {
  EXPECT_THAT(errorOfReading(), HasSubstr(path_));
}

TEST_F(TrajectoryFile, keepsCovariancesBesideThePoses) {
  Trajectory written{poseAtX(1, 0), poseAtX(2, 0), poseAtX(3, 0)};
  Matrix6d covariance = Matrix6d::Identity() * 1e-6;
  covariance(0, 5) = covariance(5, 0) = 3e-7;
  written[1].covariance = covariance;
  writeCovariances(path_, written);
  Trajectory read{poseAtX(1, 0), poseAtX(2, 0), poseAtX(3, 0)};
  readCovariances(path_, read);
  EXPECT_FALSE(read[0].covariance);
  ASSERT_TRUE(read[1].covariance);
  EXPECT_TRUE(read[1].covariance->isApprox(covariance, 1e-10));
}

TEST_F(TrajectoryFile, refusesCovariancesOfAnotherRun) {
  Trajectory written{poseAtX(1, 0)};
  written[0].covariance = Matrix6d::Identity();
  writeCovariances(path_, written);
  Trajectory other{poseAtX(7, 0)};
  EXPECT_THROW(readCovariances(path_, other), std::runtime_error);
}

TEST(PoseAt, liesBetweenItsNeighbours) {
  const auto pose = poseAt({poseAtX(1, 0), poseAtX(2, 4)}, Stamp(1250ms), 1ms, 2s);
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->translation().x(), 1.0, 1e-12);
}

TEST(PoseAt, doesNotBridgeAGap) {
  EXPECT_FALSE(poseAt({poseAtX(1, 0), poseAtX(2, 4)}, Stamp(1250ms), 1ms, 500ms));
}

TEST(PoseAt, takesTheEndWithinTheTolerance) {
  const Trajectory trajectory{poseAtX(1, 3)};
  ASSERT_TRUE(poseAt(trajectory, Stamp(1001ms), 2ms, 1s));
  EXPECT_FALSE(poseAt(trajectory, Stamp(1003ms), 2ms, 1s));
}

}  // namespace
}  // namespace leap_object_tracker
