#include "simulation/rounded_body.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kRadius = 0.002;

double volumeOf(const Mesh& mesh) {
  double sum = 0;
  for (const auto& t : mesh.triangles)
    sum += mesh.vertices[t[0]].dot(mesh.vertices[t[1]].cross(mesh.vertices[t[2]])) / 6;
  return sum;
}

double reach(const Mesh& mesh, const Eigen::Vector3d& direction) {
  double most = -1;
  for (const auto& vertex : mesh.vertices) most = std::max(most, vertex.dot(direction));
  return most;
}

/// Steiner's formula, for the box without its rounding.
double volumeOfRoundedBox(const Eigen::Vector3d& size) {
  const Eigen::Vector3d s = size.array() - 2 * kRadius;
  return s.prod() + 2 * kRadius * (s.x() * s.y() + s.y() * s.z() + s.z() * s.x()) +
         M_PI * kRadius * kRadius * s.sum() + 4.0 / 3 * M_PI * std::pow(kRadius, 3);
}

TEST(RoundedBody, ofABoxHasTheVolumeOfSteinersFormula) {
  const Eigen::Vector3d size(0.03, 0.02, 0.05);
  const auto rounded = roundEdges(makeBox(size), kRadius);
  ASSERT_TRUE(rounded);
  const double sharp = size.prod(), exact = volumeOfRoundedBox(size);
  EXPECT_NEAR(sharp - volumeOf(rounded->mesh), sharp - exact, 0.03 * (sharp - exact));
}

TEST(RoundedBody, keepsItsFacesAndLosesItsCorners) {
  const auto rounded = roundEdges(makeBox({0.03, 0.03, 0.03}), kRadius);
  ASSERT_TRUE(rounded);
  EXPECT_NEAR(reach(rounded->mesh, Eigen::Vector3d::UnitX()), 0.015, 1e-9);
  const Eigen::Vector3d across = Eigen::Vector3d(1, 1, 0).normalized();
  EXPECT_NEAR(reach(rounded->mesh, across), (0.015 - kRadius) * std::sqrt(2.0) + kRadius, 1e-5);
}

TEST(RoundedBody, ofAPrismEndsAtTheRoundedApex) {
  constexpr double kSide = 0.04;
  const auto rounded = roundEdges(makePrism(kSide, 0.04), kRadius);
  ASSERT_TRUE(rounded);
  // A ball between walls 60 deg apart: its centre lies two radii from where they meet.
  EXPECT_NEAR(reach(rounded->mesh, Eigen::Vector3d::UnitY()), kSide / std::sqrt(3.0) - kRadius,
              1e-5);
}

TEST(RoundedBody, ofACylinderIsRoundAllAround) {
  const auto rounded = roundEdges(makeCylinder(0.015, 0.065), kRadius);
  ASSERT_TRUE(rounded);
  EXPECT_NEAR(reach(rounded->mesh, Eigen::Vector3d::UnitZ()), 0.0325, 1e-9);
  for (std::size_t i = 0; i < rounded->mesh.vertices.size(); ++i) {
    const Eigen::Vector3d& vertex = rounded->mesh.vertices[i];
    const Eigen::Vector3d radial = Eigen::Vector3d(vertex.x(), vertex.y(), 0).normalized();
    EXPECT_GT(rounded->normals[i].dot(radial), -1e-6);
    EXPECT_GT(rounded->normals[i].z() * vertex.z(), -1e-6);
  }
}

TEST(RoundedBody, isClosedAndLooksOutwards) {
  for (const Mesh& mesh : {makeBox({0.03, 0.02, 0.05}), makePrism(0.04, 0.03)}) {
    const auto rounded = roundEdges(mesh, kRadius);
    ASSERT_TRUE(rounded);
    for (const auto& t : rounded->mesh.triangles) {
      const auto& v = rounded->mesh.vertices;
      const Eigen::Vector3d turned = (v[t[1]] - v[t[0]]).cross(v[t[2]] - v[t[0]]);
      for (const auto corner : t) EXPECT_GE(turned.dot(rounded->normals[corner]), -1e-15);
    }
  }
}

TEST(RoundedBody, isLeftAloneIfItIsHollowOrTooSmall) {
  Mesh dented = makeBox({0.03, 0.03, 0.03});
  dented.vertices[4] *= 0.3;
  EXPECT_FALSE(roundEdges(dented, kRadius));
  EXPECT_FALSE(roundEdges(makeBox({0.03, 0.03, 0.003}), kRadius));
}

}  // namespace
}  // namespace leap_object_tracker
