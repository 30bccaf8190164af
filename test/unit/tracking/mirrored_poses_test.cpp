#include "leap_object_tracker/tracking/mirrored_poses.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kDegree = M_PI / 180;

/// Before the left eye, its z axis turned away from the line of sight.
Pose tilted(double angle) {
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(0, 0, 0.2);
  pose.linear() = Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitX()).toRotationMatrix();
  return pose;
}

/// The smallest angle [rad] from an orientation to those of the poses.
double nearest(const std::vector<Pose>& poses, const Pose& wanted) {
  double least = M_PI;
  for (const Pose& pose : poses)
    least = std::min(least, angleBetween(pose.linear(), wanted.linear()));
  return least;
}

TEST(MirroredPoses, tiltAFaceTheOtherWay) {
  // A flat plate: no other face is large.
  const MirroredPoses mirrored(makePrimitive("plate", Shape::kBox, {0.05, 0.05, 0.002}));
  for (const double angle : {-25.0, -8.0, 8.0, 25.0}) {
    const std::vector<Pose> poses = mirrored.of(tilted(angle * kDegree));
    ASSERT_EQ(poses.size(), 1U) << angle;
    EXPECT_LT(nearest(poses, tilted(-angle * kDegree)), 1 * kDegree) << angle;
  }
}

TEST(MirroredPoses, keepTheImageOfTheFace) {
  const MirroredPoses mirrored(makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03}));
  const Pose pose = tilted(15 * kDegree);
  const std::vector<Pose> poses = mirrored.of(pose);
  ASSERT_EQ(poses.size(), 1U);
  // Corners of the face that is seen, as far as perspective allows.
  for (const double x : {-0.015, 0.015})
    for (const double y : {-0.015, 0.015}) {
      const Eigen::Vector3d corner(x, y, -0.015);
      const Eigen::Vector3d before = pose * corner, after = poses.front() * corner;
      EXPECT_LT((before / before.z() - after / after.z()).norm(), 0.006);
    }
}

TEST(MirroredPoses, leaveOutWhatLooksAtTheEyeOrFarAway) {
  const MirroredPoses mirrored(makePrimitive("plate", Shape::kBox, {0.05, 0.05, 0.002}));
  EXPECT_TRUE(mirrored.of(tilted(0)).empty());
  EXPECT_TRUE(mirrored.of(tilted(60 * kDegree)).empty());
}

TEST(MirroredPoses, tiltAFreeAxisToTheOtherSideOfTheImage) {
  const MirroredPoses mirrored(makePrimitive("rod", Shape::kCylinder, {0.005, 0.08, 0}));
  for (const double angle : {-20.0, 20.0}) {
    // 90 deg: the axis lies in the image plane.
    const std::vector<Pose> poses = mirrored.of(tilted((90 + angle) * kDegree));
    EXPECT_LT(nearest(poses, tilted((90 - angle) * kDegree)), 1 * kDegree) << angle;
  }
}

}  // namespace
}  // namespace leap_object_tracker
