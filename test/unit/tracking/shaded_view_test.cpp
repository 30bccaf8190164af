#include "leap_object_tracker/tracking/shaded_view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>

#include "cast_body.hpp"
#include "drawn_box.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/turned_rivals.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3d;

/// Two boxes as one mesh: a plate and a wall on it that stands towards -z.
Mesh plateWithWall() {
  Mesh mesh = makeBox({0.06, 0.05, 0.006});
  const Mesh wall = makeBox({0.006, 0.05, 0.03});
  const auto first = static_cast<std::uint32_t>(mesh.vertices.size());
  for (const Vector3d& vertex : wall.vertices)
    mesh.vertices.emplace_back(vertex + Vector3d(0, 0, -0.0175));
  for (const auto& t : wall.triangles)
    mesh.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  return mesh;
}

class Shaded : public ::testing::Test {
 protected:
  double score(const Mesh& mesh, const RectifiedStereoFrame& frame, const Pose& pose) const {
    std::array<EdgeField, 2> fields;
    const cv::Rect whole(cv::Point(), camera_.size);
    fields[0].build(frame.left, whole);
    fields[1].build(frame.right, whole);
    return ShadedView(mesh, camera_).logLikelihood(fields, pose);
  }

  static Pose turnedBy(const Vector3d& axis) {
    Pose pose = Pose::Identity();
    pose.translation() << 0.01, 0, 0.13;
    pose.linear() = rotationFromVector(axis);
    return pose;
  }

  const RectifiedStereoCamera camera_ = roundCamera();
  const Mesh cube_ = makeBox({0.03, 0.03, 0.03});
};

TEST_F(Shaded, prefersTheTiltThatTheShadingShowsToItsMirrorImage) {
  const Pose left = turnedBy({0, 0.5, 0}), right = turnedBy({0, -0.5, 0});
  for (const bool mirrored : {false, true}) {
    const Pose& truth = mirrored ? right : left;
    const RectifiedStereoFrame frame = castFrame(cube_, truth, camera_);
    EXPECT_GT(score(cube_, frame, truth), score(cube_, frame, mirrored ? left : right) + 10);
  }
}

TEST_F(Shaded, isTheSameForABrighterBody) {
  const Pose truth = turnedBy({0.3, 0.5, 0});
  Look dim;
  dim.scale = 0.3;
  const double bright = score(cube_, castFrame(cube_, truth, camera_), truth);
  EXPECT_NEAR(score(cube_, castFrame(cube_, truth, camera_, dim), truth), bright, 0.1 * bright);
}

TEST_F(Shaded, allowsForLightFromAllAround) {
  const Pose left = turnedBy({0, 0.5, 0}), right = turnedBy({0, -0.5, 0});
  RectifiedStereoFrame frame = castFrame(cube_, left, camera_);
  const double in_the_dark = score(cube_, frame, left);
  for (cv::Mat* eye : {&frame.left, &frame.right}) *eye += 80;
  EXPECT_GT(score(cube_, frame, left), score(cube_, frame, right) + 10);
  EXPECT_GT(score(cube_, frame, left), 0.9 * in_the_dark);
}

TEST_F(Shaded, knowsTheShadowThatABodyThrowsOnItself) {
  const Mesh body = plateWithWall();
  const Pose pose = turnedBy({0.1, 0.45, 0});
  Look lit;
  lit.shadows = false;
  EXPECT_GT(score(body, castFrame(body, pose, camera_), pose),
            score(body, castFrame(body, pose, camera_, lit), pose) + 10);
}

TEST_F(Shaded, saysLittleOfATexturedBody) {
  const Pose left = turnedBy({0, 0.5, 0}), right = turnedBy({0, -0.5, 0});
  Look checked;
  checked.checks = 0.01;
  const auto preference = [&](const Look& look) {
    const RectifiedStereoFrame frame = castFrame(cube_, left, camera_, look);
    return score(cube_, frame, left) - score(cube_, frame, right);
  };
  EXPECT_LT(std::abs(preference(checked)), 0.25 * preference({}));
}

TEST_F(Shaded, isZeroWithoutAnImageOrBehindTheCamera) {
  const Pose pose = turnedBy({0, 0.5, 0});
  EXPECT_EQ(score(cube_, {}, pose), 0);
  Pose behind = pose;
  behind.translation().z() = -0.1;
  EXPECT_EQ(score(cube_, castFrame(cube_, pose, camera_), behind), 0);
  Pose outside = pose;
  outside.translation().x() = 5;
  EXPECT_EQ(score(cube_, castFrame(cube_, pose, camera_), outside), 0);
}

TEST_F(Shaded, usesOneEyeAlone) {
  const Pose left = turnedBy({0, 0.5, 0}), right = turnedBy({0, -0.5, 0});
  Look one;
  one.in_eyes = 1;
  const RectifiedStereoFrame frame = castFrame(cube_, left, camera_, one);
  EXPECT_GT(score(cube_, frame, left), score(cube_, frame, right) + 5);
}

/// A block that is a little narrower at one end.
class Rivals : public Shaded {
 protected:
  Rivals() : object_(taperedBlock()), model_(object_, 96), refiner_(ContourParams(), camera_) {}

  static ObjectModel taperedBlock() {
    ObjectModel object = box(0.03, 0.04, 0.05);
    for (Vector3d& vertex : object.mesh.vertices)
      if (vertex.z() > 0) vertex.head<2>() *= 0.8;
    object.shape = Shape::kMesh;
    object.symmetry = {};
    return object;
  }

  /// Looks at the drawn truth, at most so often, until a pose is to be taken.
  /// @param earlier looks at which the true pose was held against the other
  std::optional<Pose> lookAt(const Pose& own, const Pose& other, int looks, int& needed,
                             bool young = false, int earlier = 0) {
    ContourMeasurement measurement(ContourParams(), Eyes::kBoth, camera_);
    const cv::Rect whole(cv::Point(), camera_.size);
    measurement.observe(castFrame(object_.mesh, truth_, camera_), {whole, whole});
    const ShadedView shaded_view(object_.mesh, camera_);
    TurnedRivals rivals(object_.symmetry, model_, refiner_, shaded_view, camera_.baseline);
    for (int i = 0; i < earlier; ++i)
      EXPECT_FALSE(rivals.look(truth_, {flipped_}, measurement, {}, false));
    for (needed = 1; needed <= looks; ++needed)
      if (const auto better = rivals.look(own, {other}, measurement, {}, young)) return better;
    return std::nullopt;
  }

  const ObjectModel object_;
  const ContourModel model_;
  const PoseRefiner refiner_;
  const Pose truth_ = turnedBy({0.5, 0.6, 0.1});
  const Pose flipped_ = [this] {
    Pose pose = truth_;
    pose.linear() = truth_.linear() * rotationFromVector({M_PI, 0, 0});
    return pose;
  }();
};

TEST_F(Rivals, takeThePlaceOfAFlippedPoseAfterAFewLooks) {
  int needed = 0;
  const auto better = lookAt(flipped_, truth_, 10, needed);
  ASSERT_TRUE(better);
  EXPECT_GT(needed, 1);  // one look is not enough
  EXPECT_LT(angleBetween(better->linear(), truth_.linear()), 0.03);
  EXPECT_LT((better->translation() - truth_.translation()).norm(), 0.001);
}

TEST_F(Rivals, takeThePlaceOfAYoungPoseSooner) {
  int late = 0, soon = 0;
  ASSERT_TRUE(lookAt(flipped_, truth_, 10, late));
  ASSERT_TRUE(lookAt(flipped_, truth_, 10, soon, true));
  EXPECT_LT(soon, late);
}

TEST_F(Rivals, needLongerAgainstAPoseThatWasBetterForLong) {
  int soon = 0, late = 0;
  ASSERT_TRUE(lookAt(flipped_, truth_, 20, soon));
  ASSERT_TRUE(lookAt(flipped_, truth_, 20, late, false, 10));
  EXPECT_GT(late, soon);
}

TEST_F(Rivals, leaveTheTruePoseAlone) {
  int needed = 0;
  EXPECT_FALSE(lookAt(truth_, flipped_, 20, needed));
  EXPECT_FALSE(lookAt(truth_, flipped_, 20, needed, true));
}

}  // namespace
}  // namespace leap_object_tracker
