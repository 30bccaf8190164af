#include "leap_object_tracker/simulation/motion_script.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

TEST(MotionScript, sweepsFromTheRestPoseBetweenItsEnds) {
  MotionScript motion;
  motion.rest.translation() = Eigen::Vector3d(0, 0, 0.05);
  motion.sweeps.push_back({2, -0.01, 0.05, 4});
  EXPECT_NEAR(motion.at(0).translation().z(), 0.05, 1e-12);
  EXPECT_GT(motion.at(0.1).translation().z(), 0.05);
  double least = 1, most = 0;
  for (int i = 0; i < 4000; ++i) {
    const double z = motion.at(i * 1e-3).translation().z();
    least = std::min(least, z);
    most = std::max(most, z);
  }
  EXPECT_NEAR(least, 0.04, 1e-6);
  EXPECT_NEAR(most, 0.10, 1e-6);
}

TEST(MotionScript, wobblesWithinItsAmplitude) {
  MotionScript motion;
  MotionScript::Wobble wobble;
  wobble.amplitude = {0.03, 0, 0.01};
  wobble.angular_amplitude = {0, 0, 0.7};
  motion.wobbles.push_back(wobble);
  double widest = 0, largest_turn = 0;
  for (int i = 0; i < 20000; ++i) {
    const Pose pose = motion.at(i * 0.01);
    widest = std::max(widest, std::abs(pose.translation().x()));
    largest_turn = std::max(largest_turn, angleBetween(pose.linear(), Eigen::Matrix3d::Identity()));
    EXPECT_EQ(pose.translation().y(), 0);
  }
  EXPECT_LE(widest, 0.03);
  EXPECT_GT(widest, 0.025);
  EXPECT_LE(largest_turn, 0.7);
  EXPECT_GT(largest_turn, 0.6);
}

TEST(MotionScript, restsAtKeyframesAndBeyondThem) {
  MotionScript motion;
  motion.keyframes.push_back({1, {0, 0, 0}, Eigen::Quaterniond::Identity()});
  motion.keyframes.push_back(
      {2, {0.1, 0, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(1, Eigen::Vector3d::UnitZ()))});
  EXPECT_EQ(motion.at(0).translation().x(), 0);
  EXPECT_NEAR(motion.at(1.5).translation().x(), 0.05, 1e-12);
  EXPECT_NEAR(angleBetween(motion.at(1.5).linear(), Eigen::Matrix3d::Identity()), 0.5, 1e-12);
  EXPECT_NEAR(motion.at(7).translation().x(), 0.1, 1e-12);
  const double speed = (motion.at(2).translation().x() - motion.at(1.99).translation().x()) / 0.01;
  EXPECT_LT(speed, 1e-3);
}

TEST(MotionScript, spinsAboutTheParentsAxes) {
  MotionScript motion;
  motion.spin = {0, 0, M_PI};
  EXPECT_NEAR((motion.at(0.5) * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 0,
              1e-12);
}

}  // namespace
}  // namespace leap_object_tracker
