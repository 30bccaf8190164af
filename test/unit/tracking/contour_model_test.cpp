#include "leap_object_tracker/tracking/contour_model.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <vector>

#include "support/temporary_folder.hpp"
#include "tracking/mesh_views.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kPoints = 96;

/// Points of the view from an eye, turned to where the object stands.
std::vector<ContourPoint> seenFrom(const ContourModel& model, const Vector3d& eye) {
  const ViewChoice choice = model.choose(eye.cast<float>());
  if (choice.view == nullptr) return {};
  Eigen::Matrix3f turn;
  turn << choice.cosine, -choice.sine, 0, choice.sine, choice.cosine, 0, 0, 0, 1;
  std::vector<ContourPoint> points = choice.view->points;
  for (ContourPoint& point : points) {
    point.position = turn * point.position;
    point.tangent = turn * point.tangent;
    point.outward = turn * point.outward;
  }
  return points;
}

template <class Choose>
double lengthOf(const std::vector<ContourPoint>& points, const Choose& choose) {
  double sum = 0;
  for (const ContourPoint& point : points)
    if (choose(point)) sum += point.length;
  return sum;
}
double lengthOf(const std::vector<ContourPoint>& points) {
  return lengthOf(points, [](const ContourPoint&) { return true; });
}
double creasesOf(const std::vector<ContourPoint>& points) {
  return lengthOf(points, [](const ContourPoint& point) { return !point.outline(); });
}

ObjectModel meshOnly(const Mesh& mesh) {
  ObjectModel object;
  object.name = "body";
  object.shape = Shape::kMesh;
  object.mesh = mesh;
  return object;
}

const ContourModel& cube() {
  static const ContourModel model(makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03}), kPoints);
  return model;
}
const ContourModel& meshCube() {
  static const ContourModel model(meshOnly(makeBox({0.03, 0.03, 0.03})), kPoints);
  return model;
}

TEST(ContourOfABox, isTheRectangleOfTheOneFaceInSight) {
  const ContourModel model(makePrimitive("box", Shape::kBox, {0.02, 0.04, 0.06}), kPoints);
  const auto points = seenFrom(model, {0.2, 0, 0});
  EXPECT_NEAR(lengthOf(points), 2 * (0.04 + 0.06), 1e-6);
  for (const ContourPoint& point : points) {
    EXPECT_FLOAT_EQ(point.position.x(), 0.01F);
    ASSERT_TRUE(point.outline());
    const bool upright = std::abs(point.tangent.z()) > 0.5F;
    const Vector3f away = upright ? Vector3f(0, std::copysign(1.0F, point.position.y()), 0)
                                  : Vector3f(0, 0, std::copysign(1.0F, point.position.z()));
    EXPECT_LT((point.outward - away).norm(), 1e-5F) << point.position.transpose();
  }
}

/// Whether each crease has its first face on the side of tangent x normal.
void expectOrderedFaces(const std::vector<ContourPoint>& points, float half) {
  int creases = 0;
  for (const ContourPoint& point : points) {
    if (point.outline()) continue;
    ++creases;
    // The middle of the first face, as seen from the crease.
    const Vector3f inside = half * point.faces[0] - point.position;
    EXPECT_GT(inside.dot(point.tangent.cross(point.faces[0])), 0) << point.position.transpose();
  }
  EXPECT_GT(creases, 0);
}

TEST(ContourOfABox, namesTheFacesOfACreaseInTheirOrder) {
  for (const Vector3d& eye : {Vector3d(0.2, 0.2, 0.2), Vector3d(-0.1, 0.2, -0.15)}) {
    expectOrderedFaces(seenFrom(cube(), eye), 0.015F);
    expectOrderedFaces(seenFrom(meshCube(), eye), 0.015F);
  }
}

TEST(ContourOfABox, leavesOutTheEdgesThatItHides) {
  const ContourModel model(makePrimitive("box", Shape::kBox, {0.02, 0.04, 0.06}), kPoints);
  const auto points = seenFrom(model, {0.2, 0.2, 0.2});
  EXPECT_NEAR(lengthOf(points), 3 * (0.02 + 0.04 + 0.06), 1e-6) << "9 of 12 edges";
  EXPECT_NEAR(creasesOf(points), 0.02 + 0.04 + 0.06, 0.004) << "those at the corner in front";
  for (const ContourPoint& point : points) {
    const int behind = (point.position.x() < -0.0099F) + (point.position.y() < -0.0199F) +
                       (point.position.z() < -0.0299F);
    EXPECT_LT(behind, 2) << "on an edge behind: " << point.position.transpose();
  }
}

TEST(ContourOfABox, withRoundedEdgesLiesInsideOfTheSharpOne) {
  const ContourModel model(makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03}), kPoints, 0.001);
  // With a the angle from the bisector of the faces to the normal of the ray, the outline of the
  // rounding is 1 mm * (cos(a) / cos(45 deg) - 1) inside, on average over +-45 deg 1 mm * (4 / pi -
  // 1). An edge that is moved by s along the bisector moves its outline by s * cos(a), on average
  // s * sin(45 deg) / (pi / 4): s = 1 mm * (1 - pi / 4) * sqrt(2), 1 / sqrt(2) of that along an
  // axis.
  const double inside = 0.015 - 0.001 * (1 - M_PI / 4);
  for (const ContourPoint& point : seenFrom(model, {0.2, 0, 0}))
    EXPECT_NEAR(point.position.tail<2>().cwiseAbs().maxCoeff(), inside, 1e-6);
}

TEST(ContourOfAPrism, isATriangleFromAbove) {
  const ContourModel model(makePrimitive("prism", Shape::kPrism, {0.04, 0.05, 0}), kPoints);
  const auto points = seenFrom(model, {0, 0, 0.2});
  EXPECT_NEAR(lengthOf(points), 3 * 0.04, 1e-6);
  EXPECT_EQ(creasesOf(points), 0);
}

TEST(ContourOfAPrism, hasOneCreaseWhereItsApexFacesTheEye) {
  const ContourModel model(makePrimitive("prism", Shape::kPrism, {0.04, 0.05, 0}), kPoints);
  const auto points = seenFrom(model, {0, 0.2, 0});
  EXPECT_NEAR(lengthOf(points), 3 * 0.05 + 4 * 0.04, 1e-6);
  EXPECT_NEAR(creasesOf(points), 0.05, 0.004);
}

TEST(ContourOfACylinder, hasTwoLimbsAndTheNearHalvesOfItsRims) {
  const ContourModel model(makePrimitive("cylinder", Shape::kCylinder, {0.015, 0.065, 0}), kPoints);
  const Vector3d eye = 0.06 * Vector3d(std::cos(2.0), std::sin(2.0), 0);
  const auto points = seenFrom(model, eye);
  const double limb = std::acos(0.015 / 0.06);  // from the eye's direction to the tangent point
  const double step = 2 * M_PI / 180;
  EXPECT_NEAR(lengthOf(points), 2 * 0.065 + 4 * 0.015 * limb, 4 * 0.015 * step);
  const auto is_limb = [](const ContourPoint& point) { return point.limb > 0; };
  EXPECT_NEAR(lengthOf(points, is_limb), 2 * 0.065, 0.004);
  for (const ContourPoint& point : points) {
    if (!is_limb(point)) continue;
    EXPECT_NEAR(point.position.head<2>().norm(), 0.015, 1e-5);
    const double off_ray =
        point.outward.cast<double>().dot((eye - point.position.cast<double>()).normalized());
    EXPECT_NEAR(off_ray, 0, std::sin(step)) << "the ray touches the side";
  }
}

TEST(ContourOfACylinder, isOneRimOnItsAxis) {
  const ContourModel model(makePrimitive("cylinder", Shape::kCylinder, {0.015, 0.065, 0}), kPoints);
  const auto points = seenFrom(model, {0.001, 0.002, 0.1});
  EXPECT_NEAR(lengthOf(points), 2 * M_PI * 0.015, 1e-4);
  for (const ContourPoint& point : points) EXPECT_FLOAT_EQ(point.position.z(), 0.0325F);
}

TEST(ContourOfACylinder, showsTheWholeRimOfTheEndInSight) {
  const ContourModel model(makePrimitive("cylinder", Shape::kCylinder, {0.015, 0.065, 0}), kPoints);
  const auto points = seenFrom(model, {0.06, 0, 0.1});
  const auto upper = [](const ContourPoint& point) {
    return !(point.limb > 0) && point.position.z() > 0;
  };
  EXPECT_NEAR(lengthOf(points, upper), 2 * M_PI * 0.015, 0.003);
}

TEST(ContourModel, scoresTheSameLengthAsItRefines) {
  const ViewChoice choice = cube().choose({0.1F, 0.12F, 0.15F});
  ASSERT_NE(choice.view, nullptr);
  const auto n = static_cast<std::size_t>(cube().points());
  ASSERT_EQ(choice.view->arrays.size(), 6 * n);
  double sum = 0, first_third = 0;
  for (std::size_t i = 0; i < n; ++i) {
    double square = 0;
    for (std::size_t k = 3; k < 6; ++k) square += std::pow(choice.view->arrays[k * n + i], 2);
    sum += std::sqrt(square);
    if (i < n / 3) first_third += std::sqrt(square);
  }
  EXPECT_NEAR(sum, 9 * 0.03, 1e-6);
  EXPECT_NEAR(first_third, sum / 3, 1e-6);
}

TEST(ContourModel, knowsNoViewFromInsideTheBody) {
  EXPECT_EQ(cube().choose({0.001F, 0.002F, -0.003F}).view, nullptr);
  EXPECT_EQ(meshCube().choose({0.001F, 0.002F, -0.003F}).view, nullptr);
}

/// Eyes that are well away from the planes of the cube's faces, so that neighbouring views show the
/// same faces.
std::vector<Vector3d> eyesAroundTheCube() {
  return {{0.05, 0.05, 0.05},   {-0.06, 0.05, 0.04}, {0.04, -0.07, -0.05}, {0.09, 0.1, -0.11},
          {-0.1, -0.08, -0.07}, {0.2, 0.15, 0.18},   {-0.3, 0.2, -0.25}};
}

TEST(ContourOfAMesh, ofACubeIsThatOfTheCube) {
  for (const Vector3d& eye : eyesAroundTheCube()) {
    const auto expected = seenFrom(cube(), eye);
    const auto points = seenFrom(meshCube(), eye);
    EXPECT_NEAR(lengthOf(points), lengthOf(expected), 0.002) << eye.transpose();
    EXPECT_NEAR(creasesOf(points), creasesOf(expected), 0.004) << eye.transpose();
    for (const ContourPoint& point : expected) {
      float nearest = std::numeric_limits<float>::max();
      for (const ContourPoint& other : points)
        if (std::abs(point.tangent.dot(other.tangent)) > 0.999F &&
            (point.outward - other.outward).norm() < 0.01F)
          nearest = std::min(nearest, (point.position - other.position).norm());
      EXPECT_LT(nearest, 0.002F) << eye.transpose() << " misses " << point.position.transpose();
    }
  }
}

TEST(ContourOfAMesh, ofACylinderHasTheLimbsOfTheCylinder) {
  const ContourModel primitive(makePrimitive("cylinder", Shape::kCylinder, {0.015, 0.065, 0}),
                               kPoints);
  const ContourModel mesh(meshOnly(makeCylinder(0.015, 0.065, 60)), kPoints);
  const auto limb = [](const ContourPoint& point) { return point.limb > 0; };
  for (const Vector3d& eye : {Vector3d(0.1, 0.03, 0.02), Vector3d(-0.06, 0.1, 0.08)}) {
    const auto expected = seenFrom(primitive, eye), points = seenFrom(mesh, eye);
    EXPECT_NEAR(lengthOf(points), lengthOf(expected), 0.1 * lengthOf(expected));
    double seen = 0;
    const Vector3d aside = Vector3d(-eye.y(), eye.x(), 0).normalized();
    for (const ContourPoint& point : points) {
      if (!limb(point)) continue;
      const double off = point.position.cast<double>().dot(aside);
      EXPECT_GT(off * point.outward.cast<double>().dot(aside), 0) << "outward leaves the axis";
      EXPECT_NEAR(point.position.head<2>().norm(), 0.015, 1e-4);
      EXPECT_NEAR(point.limb, 0.015, 0.0015) << "its radius of curvature";
      // Lengths of limbs are those across the ray.
      seen += point.length;
    }
    const double across = eye.head<2>().norm() / eye.norm();
    EXPECT_NEAR(seen, 2 * 0.065 * across, 0.15 * 2 * 0.065 * across);
  }
}

TEST(ContourOfAMesh, doesNotDependOnWhichWayRoundTrianglesAreGiven) {
  Mesh turned = makeBox({0.03, 0.03, 0.03});
  for (std::size_t t = 0; t < turned.triangles.size(); t += 3)
    std::swap(turned.triangles[t][1], turned.triangles[t][2]);
  const ContourModel model(meshOnly(turned), kPoints);
  for (const Vector3d& eye : eyesAroundTheCube()) {
    const auto expected = seenFrom(meshCube(), eye), points = seenFrom(model, eye);
    ASSERT_EQ(points.size(), expected.size());
    for (std::size_t i = 0; i < points.size(); ++i) {
      EXPECT_LT((points[i].position - expected[i].position).norm(), 1e-6F);
      EXPECT_LT((points[i].outward - expected[i].outward).norm(), 1e-5F);
    }
  }
}

TEST(ContourOfAMesh, ofAnOpenSheetIsItsBorderFromBothSides) {
  Mesh sheet;
  sheet.vertices = {{-0.02, -0.03, 0}, {0.02, -0.03, 0}, {0.02, 0.03, 0}, {-0.02, 0.03, 0}};
  sheet.triangles = {{0, 1, 2}, {0, 2, 3}};
  const ContourModel model(meshOnly(sheet), kPoints);
  for (const Vector3d& eye : {Vector3d(0.01, 0.02, 0.1), Vector3d(0.01, 0.02, -0.1)}) {
    const auto points = seenFrom(model, eye);
    EXPECT_NEAR(lengthOf(points), 2 * (0.04 + 0.06), 1e-5);
    for (const ContourPoint& point : points)
      EXPECT_GT(point.outward.dot(point.position), 0.015F) << point.position.transpose();
  }
}

/// Share of the way from one place to another where a mesh is first met; 1 if nowhere.
double freeShare(const Mesh& mesh, const Vector3d& from, const Vector3d& to) {
  double free = 1;
  for (const auto& t : mesh.triangles) {
    Eigen::Matrix3d system;
    system << mesh.vertices[t[1]] - mesh.vertices[t[0]], mesh.vertices[t[2]] - mesh.vertices[t[0]],
        from - to;
    const Vector3d solution = system.partialPivLu().solve(from - mesh.vertices[t[0]]);
    const bool inside = solution.x() >= 0 && solution.y() >= 0 && solution.x() + solution.y() <= 1;
    if (inside && solution.z() > 0) free = std::min(free, solution.z());
  }
  return free;
}

struct ShippedMesh {
  ObjectModel object;
  ContourModel model;
};

/// Views are found once for all tests: it takes seconds.
const ShippedMesh& shipped(const std::string& file) {
  static std::map<std::string, ShippedMesh> all;
  const auto found = all.find(file);
  if (found != all.end()) return found->second;
  ObjectModel object = loadObject(LEAP_SOURCE_FOLDER "/config/objects/" + file);
  ContourModel model(object, kPoints);
  return all.emplace(file, ShippedMesh{std::move(object), std::move(model)}).first->second;
}

class ContourOfAShippedMesh : public testing::TestWithParam<const char*> {
 protected:
  const ContourModel& model() const { return shipped(GetParam()).model; }
  const Mesh& mesh() const { return shipped(GetParam()).object.mesh; }

  std::vector<Vector3d> eyes() const {
    std::vector<Vector3d> all;
    for (const double distance : {1.3, 2.5, 5.0})
      for (int i = 0; i < 4; ++i) {
        const double turn = 0.4 + 1.6 * i, rise = -0.9 + 0.6 * i;
        all.emplace_back(std::cos(turn) * std::cos(rise), std::sin(turn) * std::cos(rise),
                         std::sin(rise));
        all.back() *= distance * model().radius();
      }
    return all;
  }
};

TEST_P(ContourOfAShippedMesh, isInSight) {
  for (const Vector3d& eye : eyes()) {
    const auto points = seenFrom(model(), eye);
    ASSERT_EQ(points.size(), 2U * kPoints);
    int hidden = 0;
    for (const ContourPoint& point : points) {
      // From a little off the surface: the eye is up to 5 deg from where the view was taken.
      const Vector3d position = point.position.cast<double>();
      const Vector3d ray = (eye - position).normalized();
      const Vector3d start = position + 1e-3 * (point.outward.cast<double>() + ray);
      if (freeShare(mesh(), start, eye) < 1) ++hidden;
    }
    EXPECT_LE(hidden, 2 * kPoints / 12) << "from " << eye.transpose();
  }
}

TEST_P(ContourOfAShippedMesh, hasTheBodyOnTheInnerSideOfOutlinesOnly) {
  for (const Vector3d& eye : eyes()) {
    int outlines = 0, wrong = 0;
    for (const ContourPoint& point : seenFrom(model(), eye)) {
      if (!point.outline()) continue;
      ++outlines;
      // Rays that pass the point on both sides: only the inner one meets the body near the point.
      const Vector3d position = point.position.cast<double>();
      const Vector3d ray = (position - eye).normalized();
      const Vector3d outward = point.outward.cast<double>();
      const Vector3d across = (outward - ray * ray.dot(outward)).normalized();
      const double reach = 0.006;
      const auto meets = [&](double aside) {
        const Vector3d middle = position + aside * across;
        return freeShare(mesh(), middle - reach * ray, middle + reach * ray) < 1;
      };
      if (!meets(-5e-4) || meets(5e-4)) ++wrong;
    }
    EXPECT_GT(outlines, kPoints / 2) << "from " << eye.transpose();
    EXPECT_LE(wrong, outlines / 4) << "from " << eye.transpose();
  }
}

INSTANTIATE_TEST_SUITE_P(Shipped, ContourOfAShippedMesh,
                         testing::Values("mug.yaml", "bracket.yaml"), [](const auto& info) {
                           const std::string file = info.param;
                           return file.substr(0, file.find('.'));
                         });

class ContourOfAMug : public testing::Test {
 protected:
  static const ContourModel& model() { return shipped("mug.yaml").model; }
  static bool onHandle(const ContourPoint& point) { return point.position.x() > 0.0235F; }
};

TEST_F(ContourOfAMug, hidesTheHandleBehindTheCup) {
  EXPECT_EQ(lengthOf(seenFrom(model(), {-0.08, 0, 0}), onHandle), 0);
}

TEST_F(ContourOfAMug, showsTheHandleBesideTheCup) {
  const auto points = seenFrom(model(), {0, -0.12, 0});
  EXPECT_GT(lengthOf(points, onHandle), 0.05) << "its outer and its inner arc";
}

TEST_F(ContourOfAMug, hasTheCupBehindTheOutlineOfAHandleInFront) {
  const auto inner = [](const ContourPoint& point) { return point.inner > 0; };
  const auto outer = [](const ContourPoint& point) { return point.outline() && point.inner == 0; };
  const auto handle_before = [&](const ContourPoint& p) { return onHandle(p) && inner(p); };
  const auto handle_beside = [&](const ContourPoint& p) { return onHandle(p) && outer(p); };
  const auto front = seenFrom(model(), {0.15, 0, 0});
  EXPECT_GT(lengthOf(front, handle_before), 0.05);
  EXPECT_LT(lengthOf(front, handle_beside), 0.005);
  const auto side = seenFrom(model(), {0, -0.15, 0});
  EXPECT_GT(lengthOf(side, handle_beside), 0.03);
  EXPECT_LT(lengthOf(side, handle_before), 0.01);
}

TEST_F(ContourOfAMug, showsTheInsideFromAboveOnly) {
  const auto inside = [](const ContourPoint& point) {
    return point.position.head<2>().norm() < 0.0205F && std::abs(point.position.z()) < 0.023F;
  };
  EXPECT_EQ(lengthOf(seenFrom(model(), {0, -0.12, -0.02}), inside), 0);
  EXPECT_GT(lengthOf(seenFrom(model(), {0, 0, 0.12}), inside), 0.05) << "the rim of the floor";
}

void expectSame(const MeshViews& views, const MeshViews& expected) {
  EXPECT_EQ(views.nearest, expected.nearest);
  EXPECT_EQ(views.shell_limits, expected.shell_limits);
  EXPECT_EQ(views.directions, expected.directions);
  ASSERT_EQ(views.views.size(), expected.views.size());
  for (std::size_t i = 0; i < views.views.size(); ++i) {
    const ContourView &view = views.views[i], &other = expected.views[i];
    ASSERT_EQ(view.arrays, other.arrays) << "view " << i;
    ASSERT_EQ(view.points.size(), other.points.size()) << "view " << i;
    for (std::size_t k = 0; k < view.points.size(); ++k) {
      const ContourPoint &point = view.points[k], &twin = other.points[k];
      ASSERT_TRUE(point.position == twin.position && point.tangent == twin.tangent &&
                  point.outward == twin.outward && point.length == twin.length &&
                  point.limb == twin.limb)
          << "view " << i << " point " << k;
    }
  }
}

class CacheOfMeshViews : public testing::Test {
 protected:
  std::vector<std::filesystem::path> files() const {
    std::vector<std::filesystem::path> found;
    for (const auto& entry : std::filesystem::directory_iterator(cache_))
      found.push_back(entry.path());
    return found;
  }

  TemporaryFolder folder_;
  std::string cache_ = folder_.file("not/there/yet");
  const Mesh mesh_ = makePrism(0.04, 0.04);
};

TEST_F(CacheOfMeshViews, isWrittenOnceAndGivesTheSameViews) {
  const MeshViews first = makeMeshViews(mesh_, 16, cache_);
  ASSERT_EQ(files().size(), 1U);
  // A second computation would write the file anew.
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(100);
  std::filesystem::last_write_time(files()[0], long_ago);
  const auto written = std::filesystem::last_write_time(files()[0]);
  expectSame(makeMeshViews(mesh_, 16, cache_), first);
  EXPECT_EQ(std::filesystem::last_write_time(files()[0]), written);
  expectSame(makeMeshViews(mesh_, 16, ""), first);
}

TEST_F(CacheOfMeshViews, keepsMeshesAndNumbersOfPointsApart) {
  makeMeshViews(mesh_, 16, cache_);
  makeMeshViews(mesh_, 32, cache_);
  Mesh larger = mesh_;
  larger.vertices[0] *= 1.001;
  makeMeshViews(larger, 16, cache_);
  EXPECT_EQ(files().size(), 3U);
}

TEST_F(CacheOfMeshViews, isMadeAnewWhenItsFileIsDamaged) {
  const MeshViews first = makeMeshViews(mesh_, 16, cache_);
  const auto file = files().at(0);
  const auto size = std::filesystem::file_size(file);
  {
    std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
    stream.seekp(static_cast<std::streamoff>(size / 2));
    stream << "scratch";
  }
  expectSame(makeMeshViews(mesh_, 16, cache_), first);
  std::filesystem::resize_file(file, size / 3);
  expectSame(makeMeshViews(mesh_, 16, cache_), first);
  EXPECT_EQ(std::filesystem::file_size(file), size) << "whole again";
  EXPECT_EQ(files().size(), 1U) << "no temporary file is left";
}

TEST_F(CacheOfMeshViews, isDoneWithoutWhereNoFolderCanBe) {
  const std::string below_a_file = folder_.write("file", "text") + "/cache";
  EXPECT_FALSE(makeMeshViews(mesh_, 16, below_a_file).views.empty());
}

}  // namespace
}  // namespace leap_object_tracker
