#include "leap_object_tracker/geometry/symmetry.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "leap_object_tracker/geometry/object_model.hpp"

namespace leap_object_tracker {
namespace {

Eigen::Matrix3d turn(double x, double y, double z) {
  return rotationFromVector(Eigen::Vector3d(x, y, z));
}

std::size_t elements(Shape shape, const Eigen::Vector3d& size) {
  return makePrimitive("body", shape, size).symmetry.rotations.size();
}

TEST(Symmetry, ofACubeHas24Turns) { EXPECT_EQ(elements(Shape::kBox, {1, 1, 1}), 24u); }

TEST(Symmetry, ofASquareColumnHas8Turns) { EXPECT_EQ(elements(Shape::kBox, {1, 1, 2}), 8u); }

TEST(Symmetry, ofABrickHas4Turns) { EXPECT_EQ(elements(Shape::kBox, {1, 2, 3}), 4u); }

TEST(Symmetry, ofAPrismHas6Turns) { EXPECT_EQ(elements(Shape::kPrism, {1, 2, 0}), 6u); }

TEST(Symmetry, ofACylinderIsAFreeAxisAndAHalfTurn) {
  const Symmetry symmetry = makePrimitive("body", Shape::kCylinder, {1, 2, 0}).symmetry;
  EXPECT_TRUE(symmetry.hasFreeAxis());
  EXPECT_NEAR(angleBetween(turn(0, 0, 0), turn(0, 0, 1.234), symmetry), 0, 1e-9);
  EXPECT_NEAR(angleBetween(turn(0, 0, 0), turn(M_PI, 0, 0), symmetry), 0, 1e-9);
  EXPECT_NEAR(angleBetween(turn(0, 0, 0), turn(0.3, 0, 0), symmetry), 0.3, 1e-9);
}

TEST(Symmetry, isSaidInWords) {
  EXPECT_EQ(describe({}), "none");
  EXPECT_EQ(describe(makePrimitive("cube", Shape::kBox, {1, 1, 1}).symmetry), "24 turns");
  EXPECT_EQ(describe(symmetryFromAxes({{{0, 0, 2}, 0}})), "any turn about (0, 0, 1)");
  EXPECT_EQ(describe(makePrimitive("can", Shape::kCylinder, {1, 2, 0}).symmetry),
            "any turn about (0, 0, 1) and 2 turns");
}

TEST(Symmetry, countsOnlyTheTurnThatShows) {
  const Symmetry symmetry = makePrimitive("cube", Shape::kBox, {1, 1, 1}).symmetry;
  EXPECT_NEAR(angleBetween(turn(0, 0, 0), turn(0, 0, M_PI / 2 + 0.1), symmetry), 0.1, 1e-9);
}

TEST(Symmetry, nearestEquivalentLooksTheSameAndLiesNearTheReference) {
  const Symmetry symmetry = makePrimitive("cube", Shape::kBox, {1, 1, 1}).symmetry;
  Pose pose = Pose::Identity(), reference = Pose::Identity();
  pose.linear() = turn(0, 0, M_PI / 2 + 0.1);
  const Pose nearest = nearestEquivalent(pose, reference, symmetry);
  EXPECT_NEAR(angleBetween(nearest.linear(), reference.linear()), 0.1, 1e-9);
  EXPECT_NEAR(angleBetween(nearest.linear(), pose.linear(), symmetry), 0, 1e-9);
}

TEST(Symmetry, refusesAxesThatMakeNoSense) {
  const Eigen::Vector3d x(1, 0, 0), z(0, 0, 1);
  EXPECT_THROW(symmetryFromAxes({{Eigen::Vector3d::Zero(), 2}}), std::invalid_argument);
  EXPECT_THROW(symmetryFromAxes({{x, -1}}), std::invalid_argument);
  EXPECT_THROW(symmetryFromAxes({{x, 0}, {z, 0}}), std::invalid_argument);
  EXPECT_THROW(symmetryFromAxes({{x, 7}, {z, 5}}), std::invalid_argument);  // an endless group
}

}  // namespace
}  // namespace leap_object_tracker
