#include "leap_object_tracker/geometry/mesh.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/temporary_folder.hpp"

namespace leap_object_tracker {
namespace {

/// Signed: positive where the triangles are counter-clockwise from outside.
double volumeOf(const Mesh& mesh) {
  double volume = 0;
  for (const auto& t : mesh.triangles)
    volume += mesh.vertices[t[0]].dot(mesh.vertices[t[1]].cross(mesh.vertices[t[2]])) / 6;
  return volume;
}

Eigen::Vector3d centroidOf(const Mesh& mesh) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const auto& vertex : mesh.vertices) sum += vertex;
  return sum / static_cast<double>(mesh.vertices.size());
}

TEST(Mesh, ofABoxIsClosedCentredAndFacesOutwards) {
  const Mesh box = makeBox({0.02, 0.03, 0.04});
  EXPECT_NEAR(volumeOf(box), 0.02 * 0.03 * 0.04, 1e-12);
  EXPECT_LT(centroidOf(box).norm(), 1e-12);
  EXPECT_NEAR(diameterOf(box), std::sqrt(0.0004 + 0.0009 + 0.0016), 1e-4);
}

TEST(Mesh, ofACylinderHasItsVolume) {
  EXPECT_NEAR(volumeOf(makeCylinder(0.015, 0.065)) / (M_PI * 0.015 * 0.015 * 0.065), 1, 1e-3);
}

TEST(Mesh, ofAPrismHasItsApexTowardsYAndItsCentroidInTheOrigin) {
  const Mesh prism = makePrism(0.04, 0.05);
  EXPECT_NEAR(volumeOf(prism), std::sqrt(3.0) / 4 * 0.04 * 0.04 * 0.05, 1e-12);
  EXPECT_LT(centroidOf(prism).norm(), 1e-12);
  double highest = 0;
  for (const auto& vertex : prism.vertices) highest = std::max(highest, vertex.y());
  EXPECT_NEAR(highest, 0.04 / std::sqrt(3.0), 1e-12);
}

TEST(Mesh, throwsAShadow) {
  // Of a convex body, on average a quarter of its surface (Cauchy 1832).
  const ShadowArea box = shadowAreaOf(makeBox({0.02, 0.03, 0.04}));
  EXPECT_NEAR(box.mean / (0.25 * 0.0052), 1, 0.05);
  EXPECT_NEAR(box.least / 0.0006, 1, 0.15);
  EXPECT_NEAR(box.largest / std::sqrt(0.0006 * 0.0006 + 0.0008 * 0.0008 + 0.0012 * 0.0012), 1,
              0.08);
  const ShadowArea cylinder = shadowAreaOf(makeCylinder(0.015, 0.065));
  EXPECT_NEAR(cylinder.mean / (0.25 * 2 * M_PI * 0.015 * 0.08), 1, 0.05);
  EXPECT_EQ(shadowAreaOf(Mesh()).mean, 0);
}

TEST(Mesh, isReadFromAFileWithItsScale) {
  const TemporaryFolder folder;
  const std::string path =
      folder.write("part.obj",
                   "v 0 0 0\nv 10 0 0\nv 0 10 0\nv 0 0 10\nf 1 3 2\nf 1 2 4\nf 1 4 3\n"
                   "f 2 3 4\n");
  const Mesh mesh = loadMesh(path, 0.001);
  EXPECT_EQ(mesh.triangles.size(), 4u);
  EXPECT_EQ(mesh.vertices.size(), 4u);
  EXPECT_NEAR(volumeOf(mesh), 1e-6 / 6, 1e-12);
}

TEST(Mesh, thatCannotBeReadIsAnErrorThatNamesTheFile) {
  const TemporaryFolder folder;
  for (const std::string& path : {folder.file("missing.stl"), folder.write("empty.obj", ""),
                                  folder.write("words.ply", "this is no mesh"),
                                  folder.write("line.obj", "v 0 0 0\nv 1 0 0\n")})
    try {
      loadMesh(path, 1);
      ADD_FAILURE() << path;
    } catch (const std::runtime_error& error) {
      EXPECT_NE(std::string(error.what()).find(path), std::string::npos) << error.what();
    }
}

}  // namespace
}  // namespace leap_object_tracker
