#include "leap_object_tracker/geometry/pose.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

TEST(RotationVector, survivesTheWayThereAndBack) {
  for (const Eigen::Vector3d& vector :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(1e-9, 0, 0), Eigen::Vector3d(0.3, -0.2, 0.5),
        Eigen::Vector3d(0, 3.1, 0), Eigen::Vector3d(-2, 1, 1)})
    EXPECT_LT((vectorFromRotation(rotationFromVector(vector)) - vector).norm(), 1e-9)
        << vector.transpose();
}

TEST(RotationVector, isNeverLongerThanHalfATurn) {
  const Eigen::Vector3d vector(0, 0, 1.5 * M_PI);
  EXPECT_NEAR(vectorFromRotation(rotationFromVector(vector)).z(), -0.5 * M_PI, 1e-9);
}

TEST(Twist, movesAlongTheAxesOfTheBody) {
  Pose pose = Pose::Identity();
  pose.linear() = rotationFromVector(Eigen::Vector3d(0, 0, M_PI / 2));
  Twist twist = Twist::Zero();
  twist.x() = 0.1;  // the body's x points along y
  EXPECT_LT((moved(pose, twist).translation() - Eigen::Vector3d(0, 0.1, 0)).norm(), 1e-12);
}

TEST(Twist, betweenTwoPosesLeadsFromOneToTheOther) {
  Twist twist;
  twist << 0.01, -0.02, 0.03, 0.4, -0.5, 0.6;
  Pose from = Pose::Identity();
  from.translation() = Eigen::Vector3d(0.1, 0.2, 0.3);
  from.linear() = rotationFromVector(Eigen::Vector3d(1, 2, -0.5));
  EXPECT_LT((twistBetween(from, moved(from, twist)) - twist).norm(), 1e-9);
}

TEST(AngleBetween, isTheLengthOfTheTurn) {
  const Eigen::Matrix3d turn = rotationFromVector(Eigen::Vector3d(0.2, 0, 0));
  EXPECT_NEAR(angleBetween(Eigen::Matrix3d::Identity(), turn), 0.2, 1e-12);
}

TEST(Stamps, keepTheirSeconds) { EXPECT_NEAR(seconds(stampFromSeconds(1000.25)), 1000.25, 1e-9); }

}  // namespace
}  // namespace leap_object_tracker
