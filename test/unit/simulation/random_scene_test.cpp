#include "leap_object_tracker/simulation/random_scene.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>

#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/simulation/leap_sensor.hpp"
#include "leap_object_tracker/simulation/simulator.hpp"

namespace leap_object_tracker {
namespace {

const char* const kCalibration = LEAP_SOURCE_FOLDER "/config/calibration/leap_unit_a_centred.yaml";

ObjectModel cube() { return makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03}); }

RectifiedStereoCamera cameraOf(const Scene& scene) {
  return rectifiedCamera(fitCalibration(scene.unit, scene.mode).calibration, {});
}

TEST(RandomScene, isTheSameForTheSameSeedOnly) {
  const RandomScene a = randomScene(cube(), kCalibration, 4),
                    b = randomScene(cube(), kCalibration, 4);
  EXPECT_EQ(a.surroundings, b.surroundings);
  EXPECT_EQ(a.scene.light.ambient, b.scene.light.ambient);
  ASSERT_EQ(a.scene.bodies.size(), b.scene.bodies.size());
  for (std::size_t i = 0; i < a.scene.bodies.size(); ++i)
    EXPECT_TRUE(a.scene.bodies[i].motion.rest.isApprox(b.scene.bodies[i].motion.rest));
  EXPECT_NE(a.scene.light.ambient, randomScene(cube(), kCalibration, 5).scene.light.ambient);
}

TEST(RandomScene, hasEveryKindOfSurroundingsMostlyTheDarkWall) {
  std::set<Surroundings> kinds;
  int dark = 0;
  for (std::uint64_t seed = 0; seed < 200; ++seed) {
    const Surroundings kind = randomScene(cube(), kCalibration, seed).surroundings;
    kinds.insert(kind);
    dark += kind == Surroundings::kDarkWall;
  }
  EXPECT_EQ(kinds.size(), 4U);
  EXPECT_NEAR(dark, 120, 25);
}

TEST(RandomPlacement, keepsToItsRangeAndToBothImages) {
  const Scene scene = randomScene(cube(), kCalibration, 1).scene;
  const RectifiedStereoCamera camera = cameraOf(scene);
  PlacementRange range;
  const RandomPlacement placement(scene, camera, range);
  HashRandom random(3);
  double nearest = 1, farthest = 0, widest = 0;
  for (int i = 0; i < 200; ++i) {
    const Pose pose = placement.draw(random).rest;
    const double depth = pose.translation().z();
    EXPECT_GE(depth, range.nearest);
    EXPECT_LE(depth, range.farthest);
    for (const int eye : {0, 1}) EXPECT_GE(placement.shareInImages(pose, eye), 0.7);
    nearest = std::min(nearest, depth);
    farthest = std::max(farthest, depth);
    widest = std::max(widest, std::atan2(pose.translation().head<2>().norm(), depth));
  }
  EXPECT_LT(nearest, 0.05);
  EXPECT_GT(farthest, 0.25);
  EXPECT_GT(widest, 50 * M_PI / 180);
}

TEST(RandomPlacement, staysNearTheAxisIfTold) {
  const Scene scene = randomScene(cube(), kCalibration, 1).scene;
  PlacementRange range;
  range.widest = 0.3;
  const RandomPlacement placement(scene, cameraOf(scene), range);
  HashRandom random(3);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d at = placement.draw(random).rest.translation();
    EXPECT_LE(std::hypot(at.x() - 0.02, at.y()), std::tan(0.301) * at.z());
  }
}

TEST(RandomPlacement, countsWhatTheImagesShow) {
  const Scene scene = randomScene(cube(), kCalibration, 1).scene;
  const RectifiedStereoCamera camera = cameraOf(scene);
  const RandomPlacement placement(scene, camera, {});
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(0.02, 0, 0.1);
  EXPECT_DOUBLE_EQ(placement.shareInImages(pose, 0), 1);
  // The middle of the cube on the upper border of the rectified image.
  pose.translation().y() = -camera.center_v / camera.focal_length * 0.1;
  EXPECT_NEAR(placement.shareInImages(pose, 0), 0.5, 0.25);
  pose.translation().y() *= 3;
  EXPECT_DOUBLE_EQ(placement.shareInImages(pose, 0), 0);
  pose.translation() = Eigen::Vector3d(0.02, 0, -0.1);
  EXPECT_DOUBLE_EQ(placement.shareInImages(pose, 1), 0);
}

TEST(RandomPlacement, staysOutOfOtherBodies) {
  Scene scene = randomScene(cube(), kCalibration, 1).scene;
  scene.bodies.resize(1);
  SceneBody slab;
  slab.mesh = makeBox({2, 2, 0.2});
  slab.motion.rest.translation() = Eigen::Vector3d(0, 0, 0.25);  // its front at 15 cm
  scene.bodies.push_back(slab);
  const RandomPlacement placement(scene, cameraOf(scene), {});
  HashRandom random(1);
  for (int i = 0; i < 50; ++i) EXPECT_LT(placement.draw(random).rest.translation().z(), 0.14);
}

TEST(RandomPlacement, saysSoWhenTheObjectFitsNowhere) {
  const Scene scene =
      randomScene(makePrimitive("house", Shape::kBox, {3, 3, 3}), kCalibration, 1).scene;
  const RandomPlacement placement(scene, cameraOf(scene), {});
  HashRandom random(1);
  EXPECT_THROW(placement.draw(random), std::runtime_error);
}

TEST(RandomControls, bringTheBrightestToWhereAHostWantsIt) {
  RawStereoFrame frame;
  frame.left = cv::Mat(240, 640, CV_8UC1, cv::Scalar(38));
  frame.right = frame.left.clone();
  SensorControls controls;
  controls.exposure_us = 50;
  HashRandom random(1);
  for (int i = 0; i < 50; ++i) {
    const SensorControls next = randomControls(frame, controls, 511, random);
    EXPECT_GE(next.exposure_us, 0.5 * 5 * 50 - 1);
    EXPECT_LE(next.exposure_us, 1.3 * 5 * 50 + 1);
    EXPECT_EQ(next.gain, 16);
  }
}

TEST(Brighter, usesExposureFirstAndThenGain) {
  SensorControls controls;
  controls.exposure_us = 300;
  EXPECT_DOUBLE_EQ(brighter(controls, 1.5, 511).exposure_us, 450);
  EXPECT_EQ(brighter(controls, 1.5, 511).gain, 16);
  EXPECT_DOUBLE_EQ(brighter(controls, 2.5, 500).exposure_us, 500);
  EXPECT_EQ(brighter(controls, 2.5, 500).gain, 24);
  EXPECT_EQ(brighter(controls, 100, 511).gain, 31);
  EXPECT_DOUBLE_EQ(brighter(controls, 1e-6, 511).exposure_us, 10);
}

}  // namespace
}  // namespace leap_object_tracker
