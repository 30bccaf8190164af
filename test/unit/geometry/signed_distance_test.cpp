#include "leap_object_tracker/geometry/signed_distance.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

SignedDistance of(Shape shape, const Vector3d& size) {
  return SignedDistance(makePrimitive("body", shape, size));
}

/// The same body, but as if only its mesh were known.
SignedDistance ofMesh(Shape shape, const Vector3d& size) {
  ObjectModel object = makePrimitive("body", shape, size);
  object.shape = Shape::kMesh;
  return SignedDistance(object);
}

TEST(SignedDistanceOfABox, isThatOfFaceEdgeAndCorner) {
  const auto distance = of(Shape::kBox, {0.02, 0.04, 0.06});
  EXPECT_NEAR(distance(Vector3f(0.015F, 0, 0)), 0.005, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0, 0, 0)), -0.01, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0.013F, 0.024F, 0)), 0.005, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0.011F, 0.022F, 0.032F)), 0.003, 1e-7);
}

TEST(SignedDistanceOfACylinder, isThatOfSideEndAndRim) {
  const auto distance = of(Shape::kCylinder, {0.015, 0.065, 0});
  EXPECT_NEAR(distance(Vector3f(0, 0.020F, 0)), 0.005, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0, 0, 0.0355F)), 0.003, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0.018F, 0, 0.0365F)), 0.005, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0, 0, 0)), -0.015, 1e-7);
}

TEST(SignedDistanceOfAPrism, vanishesAtItsCornersAndFaces) {
  const auto distance = of(Shape::kPrism, {0.04, 0.04, 0});
  const auto inner = static_cast<float>(0.04 / (2 * std::sqrt(3.0)));
  EXPECT_NEAR(distance(Vector3f(0, 2 * inner, 0)), 0, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0.02F, -inner, 0.02F)), 0, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0, -inner - 0.003F, 0)), 0.003, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0, 2 * inner + 0.003F, 0)), 0.003, 1e-7);
  EXPECT_NEAR(distance(Vector3f(0, 0, 0)), -inner, 1e-7);
}

class SignedDistanceOfAMesh : public testing::TestWithParam<std::pair<Shape, Vector3d>> {};

TEST_P(SignedDistanceOfAMesh, agreesWithTheClosedForm) {
  const auto [shape, size] = GetParam();
  const auto exact = of(shape, size), grid = ofMesh(shape, size);
  const double cell = 0.065 / SignedDistance::kGridCells;
  for (float x = -0.025F; x < 0.026F; x += 0.0047F)
    for (float y = -0.025F; y < 0.026F; y += 0.0047F)
      for (float z = -0.040F; z < 0.041F; z += 0.0061F) {
        const float wanted = exact(Vector3f(x, y, z));
        if (wanted > 0.004F) continue;  // outside the grid
        ASSERT_NEAR(grid(Vector3f(x, y, z)), wanted, 0.6 * cell) << x << ' ' << y << ' ' << z;
      }
}

INSTANTIATE_TEST_SUITE_P(Bodies, SignedDistanceOfAMesh,
                         testing::Values(std::make_pair(Shape::kBox, Vector3d(0.02, 0.04, 0.06)),
                                         std::make_pair(Shape::kCylinder,
                                                        Vector3d(0.015, 0.065, 0)),
                                         std::make_pair(Shape::kPrism, Vector3d(0.04, 0.04, 0))));

TEST(SignedDistance, growsFarOutsideTheGridOfAMesh) {
  const auto grid = ofMesh(Shape::kBox, {0.02, 0.04, 0.06});
  EXPECT_NEAR(grid(Vector3f(0.5F, 0, 0)), 0.49, 0.01);
}

TEST(SignedDistance, hasAGradientOfUnitLengthAwayFromTheBody) {
  for (const auto& distance :
       {of(Shape::kBox, {0.02, 0.04, 0.06}), ofMesh(Shape::kBox, {0.02, 0.04, 0.06})}) {
    Vector3f gradient;
    EXPECT_NEAR(distance(Vector3f(0.001F, 0.021F, 0.002F), gradient), 0.001, 1e-4);
    EXPECT_LT((gradient - Vector3f::UnitY()).norm(), 0.02);
  }
}

}  // namespace
}  // namespace leap_object_tracker
