#include "leap_object_tracker/tracking/shaded_view.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <optional>

#include "drawn_box.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/turned_rivals.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3d;

constexpr double kLamps[] = {-0.015, 0.02, 0.055};  // [m] along the baseline

struct Hit {
  double distance = std::numeric_limits<double>::infinity();
  Vector3d normal = Vector3d::Zero();
};

/// Nearest triangle along a ray (Moller and Trumbore 1997).
Hit cast(const std::vector<std::array<Vector3d, 3>>& triangles, const Vector3d& from,
         const Vector3d& direction) {
  Hit hit;
  for (const auto& [a, b, c] : triangles) {
    const Vector3d ab = b - a, ac = c - a, p = direction.cross(ac);
    const double scale = ab.dot(p);
    if (std::abs(scale) < 1e-15) continue;
    const Vector3d to = from - a;
    const double u = to.dot(p) / scale, v = direction.dot(to.cross(ab)) / scale;
    const double distance = ac.dot(to.cross(ab)) / scale;
    if (u < 0 || v < 0 || u + v > 1 || distance < 1e-6 || distance >= hit.distance) continue;
    hit = {distance, ab.cross(ac).normalized()};
  }
  return hit;
}

struct Look {
  bool shadows = true;
  double scale = 0.6;  ///< grey levels of a white surface square to a lamp, times metres squared
  double checks = 0;   ///< [m] of squares, every other one darker; 0: plain
  double in_eyes = 2;
};

/// A matt body lit by three lamps, by ray casting.
RectifiedStereoFrame castFrame(const Mesh& mesh, const Pose& pose,
                               const RectifiedStereoCamera& camera, const Look& look = {}) {
  std::vector<std::array<Vector3d, 3>> triangles;
  for (const auto& t : mesh.triangles)
    triangles.push_back(
        {pose * mesh.vertices[t[0]], pose * mesh.vertices[t[1]], pose * mesh.vertices[t[2]]});
  RectifiedStereoFrame frame;
  frame.stamp = stampFromSeconds(1);
  for (int eye = 0; eye < look.in_eyes; ++eye) {
    cv::Mat& image = eye == 0 ? frame.left : frame.right;
    image = cv::Mat(camera.size, CV_8UC1, cv::Scalar(4));
    const Vector3d origin(eye * camera.baseline, 0, 0);
    for (int v = 160; v < 320; ++v)
      for (int u = 220; u < 420; ++u) {
        const Vector3d ray((u - camera.center_u) / camera.focal_length,
                           (v - camera.center_v) / camera.focal_length, 1);
        const Hit hit = cast(triangles, origin, ray);
        if (std::isinf(hit.distance)) continue;
        const Vector3d at = origin + hit.distance * ray;
        double light = 0;
        for (const double lamp : kLamps) {
          const Vector3d to = Vector3d(lamp, 0, 0) - at;
          const double cosine = hit.normal.dot(to.normalized());
          if (cosine <= 0) continue;
          if (look.shadows && cast(triangles, at + 1e-5 * hit.normal, to).distance < 1) continue;
          light += look.scale * cosine / to.squaredNorm();
        }
        if (look.checks > 0) {
          const Vector3d own = pose.inverse() * at / look.checks;
          const auto cell = [](double x) { return static_cast<int>(std::floor(x + 0.01)); };
          if (((cell(own.x()) + cell(own.y()) + cell(own.z())) & 1) != 0) light *= 0.25;
        }
        image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(std::min(255.0, 4 + light));
      }
    cv::GaussianBlur(image, image, cv::Size(7, 7), 0.78, 1.08);
  }
  return frame;
}

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
  std::optional<Pose> lookAt(const Pose& own, const Pose& other, int looks, int& needed) {
    ContourMeasurement measurement(ContourParams(), Eyes::kBoth, camera_);
    const cv::Rect whole(cv::Point(), camera_.size);
    measurement.observe(castFrame(object_.mesh, truth_, camera_), {whole, whole});
    TurnedRivals rivals(object_, model_, refiner_, camera_);
    for (needed = 1; needed <= looks; ++needed)
      if (const auto better = rivals.look(own, {other}, measurement, {})) return better;
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

TEST_F(Rivals, leaveTheTruePoseAlone) {
  int needed = 0;
  EXPECT_FALSE(lookAt(truth_, flipped_, 20, needed));
}

}  // namespace
}  // namespace leap_object_tracker
