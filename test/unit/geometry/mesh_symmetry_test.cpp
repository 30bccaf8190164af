#include "leap_object_tracker/geometry/mesh_symmetry.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "leap_object_tracker/geometry/object_model.hpp"

namespace leap_object_tracker {
namespace {

Mesh turned(Mesh mesh, const Eigen::Vector3d& by) {
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex = rotationFromVector(by) * vertex;
  return mesh;
}

Mesh joined(Mesh mesh, const Mesh& other, const Eigen::Vector3d& place) {
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const auto& vertex : other.vertices) mesh.vertices.push_back(vertex + place);
  for (const auto& t : other.triangles)
    mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return mesh;
}

const Eigen::Vector3d kOblique(0.3, -0.5, 0.7);

TEST(SymmetryOfAMesh, isThatOfThePrimitive) {
  EXPECT_EQ(symmetryOf(makeBox({0.03, 0.04, 0.05})).rotations.size(), 4u);
  EXPECT_EQ(symmetryOf(makeBox({0.03, 0.03, 0.05})).rotations.size(), 8u);
  EXPECT_EQ(symmetryOf(makeBox({0.03, 0.03, 0.03})).rotations.size(), 24u);
  EXPECT_EQ(symmetryOf(makePrism(0.03, 0.06)).rotations.size(), 6u);
}

TEST(SymmetryOfAMesh, ofACylinderIsAFreeAxisAndAHalfTurn) {
  const Symmetry symmetry = symmetryOf(makeCylinder(0.015, 0.05));
  ASSERT_TRUE(symmetry.hasFreeAxis());
  EXPECT_NEAR(std::abs(symmetry.free_axis.z()), 1, 1e-9);
  EXPECT_EQ(symmetry.rotations.size(), 2u);
}

TEST(SymmetryOfAMesh, isFoundInAnyOrientation) {
  const Symmetry column = symmetryOf(turned(makeBox({0.03, 0.03, 0.05}), kOblique));
  EXPECT_EQ(column.rotations.size(), 8u);
  const Eigen::Vector3d axis = rotationFromVector(kOblique) * Eigen::Vector3d::UnitZ();
  const Eigen::Matrix3d quarter = Eigen::AngleAxisd(M_PI / 2, axis).toRotationMatrix();
  EXPECT_LT(angleBetween(Eigen::Matrix3d::Identity(), quarter, column), 0.01);

  const Symmetry cylinder = symmetryOf(turned(makeCylinder(0.015, 0.05), kOblique));
  ASSERT_TRUE(cylinder.hasFreeAxis());
  EXPECT_GT(std::abs(cylinder.free_axis.dot(axis)), std::cos(0.005));
}

TEST(SymmetryOfAMesh, endsWithWhatSticksOut) {
  const Mesh cylinder = makeCylinder(0.015, 0.05);
  const Mesh cap = makeCylinder(0.008, 0.01), handle = makeBox({0.004, 0.004, 0.02});
  const Symmetry bottle = symmetryOf(joined(cylinder, cap, {0, 0, 0.03}));
  EXPECT_TRUE(bottle.hasFreeAxis());
  EXPECT_EQ(bottle.rotations.size(), 1u) << "the cap is at one end";
  const Symmetry cup = symmetryOf(joined(cylinder, handle, {0.016, 0, 0}));
  EXPECT_FALSE(cup.hasFreeAxis());
  EXPECT_EQ(cup.rotations.size(), 2u) << "half a turn about the handle";
  EXPECT_TRUE(symmetryOf(joined(cylinder, handle, {0.016, 0, 0.01})).trivial());
}

TEST(SymmetryOfAMesh, isAboutTheOrigin) {
  Mesh mesh = makeBox({0.03, 0.04, 0.05});
  for (Eigen::Vector3d& vertex : mesh.vertices) vertex.z() += 0.025;
  EXPECT_EQ(symmetryOf(mesh).rotations.size(), 2u) << "about z alone";
}

}  // namespace
}  // namespace leap_object_tracker
