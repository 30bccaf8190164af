#include "leap_object_tracker/simulation/simulator.hpp"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>

#include "leap_object_tracker/rectification/stereo_rectifier.hpp"

namespace leap_object_tracker {
namespace {

/// A bare plate of 2 x 2 x 0.02 mm in the dark, seen without noise.
Scene plateScene(const std::string& mode) {
  Scene scene;
  scene.unit = loadLeapUnit(LEAP_SOURCE_FOLDER "/config/calibration/leap_unit_a.yaml");
  scene.mode = sensorMode(mode);
  scene.frames = 3;
  scene.object = makePrimitive("plate", Shape::kBox, {0.002, 0.002, 0.00002});
  scene.samples = 256;
  scene.sensor.auto_exposure = false;
  scene.sensor.full_well = 1e9;
  scene.sensor.read_noise = scene.sensor.fixed_noise = scene.sensor.dark_offset = 0;
  scene.sensor.glow = 0;
  scene.light.ambient = 0;
  SceneBody body;
  body.name = "plate";
  body.mesh = scene.object.mesh;
  body.paint.grain = body.paint.gloss = body.edge_radius = 0;
  scene.bodies.push_back(body);
  return scene;
}

void place(Scene& scene, const Eigen::Vector3d& position) {
  scene.bodies.front().motion.rest.translation() = position;
}

/// Centre of the light, but for the metadata.
Eigen::Vector2d lightCenter(const cv::Mat& image) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  double weight = 0;
  for (int v = 0; v < image.rows - 1; ++v)
    for (int u = 0; u < image.cols; ++u) {
      const double value = image.at<std::uint8_t>(v, u);
      sum += value * Eigen::Vector2d(u, v);
      weight += value;
    }
  return sum / weight;
}

/// Where the light of the plate's front falls, each point into the pixel that it meets.
Eigen::Vector2d frontCenter(const LeapLens& lens, const Pose& eye_from_plate) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  constexpr int kSteps = 60;
  for (int i = 0; i < kSteps; ++i)
    for (int j = 0; j < kSteps; ++j) {
      const Eigen::Vector3d on_front(0.002 * ((i + 0.5) / kSteps - 0.5),
                                     0.002 * ((j + 0.5) / kSteps - 0.5), -1e-5);
      sum += lens.pixel(eye_from_plate * on_front).array().round().matrix();
    }
  return sum / (kSteps * kSteps);
}

double columnVariance(const cv::Mat& image) {
  const double center = lightCenter(image).x();
  double sum = 0, weight = 0;
  for (int v = 0; v < image.rows - 1; ++v)
    for (int u = 0; u < image.cols; ++u) {
      sum += image.at<std::uint8_t>(v, u) * (u - center) * (u - center);
      weight += image.at<std::uint8_t>(v, u);
    }
  return sum / weight;
}

double meanGray(const SimulatedFrame& frame) {
  return cv::mean(frame.raw.left.rowRange(0, frame.raw.left.rows - 1))[0];
}

bool same(const cv::Mat& a, const cv::Mat& b) { return cv::norm(a, b, cv::NORM_INF) == 0; }

Scene noisyScene(std::uint64_t seed) {
  SceneOverrides overrides;
  overrides.has_seed = true;
  overrides.seed = seed;
  overrides.frames = 3;
  return loadScene(LEAP_SOURCE_FOLDER "/config/scenes/wobble_cube_textured.yaml", overrides);
}

TEST(Simulator, showsThePlateInBothEyesWhereTheTruthPutsIt) {
  for (const char* mode : {"640x480", "640x240"})
    for (const Eigen::Vector3d& position :
         {Eigen::Vector3d(0.02, 0, 0.1), Eigen::Vector3d(-0.05, 0.04, 0.12),
          Eigen::Vector3d(0.09, -0.05, 0.11)}) {
      Scene scene = plateScene(mode);
      scene.controls.exposure_us = 200 * std::pow(position.norm() / 0.1, 4);  // equally bright
      place(scene, position);
      const auto frame = Simulator(scene).next();
      ASSERT_TRUE(frame);
      const LeapLens left(scene.unit.left, scene.mode), right(scene.unit.right, scene.mode);
      const Pose left_from_plate = frame->camera_from_object;
      const Pose right_from_plate =
          Eigen::Translation3d(-scene.unit.baseline, 0, 0) * left_from_plate;
      EXPECT_LT((lightCenter(frame->raw.left) - frontCenter(left, left_from_plate)).norm(), 0.04)
          << mode << " at " << position.transpose();
      EXPECT_LT((lightCenter(frame->raw.right) - frontCenter(right, right_from_plate)).norm(), 0.04)
          << mode << " at " << position.transpose();
    }
}

TEST(Simulator, agreesWithTheRectifierAboutPlaceAndDisparity) {
  for (const char* mode : {"640x480", "640x240"}) {
    Scene scene = plateScene(mode);
    scene.unit = loadLeapUnit(LEAP_SOURCE_FOLDER "/config/calibration/leap_unit_a_centred.yaml");
    scene.object = makePrimitive("plate", Shape::kBox, {0.01, 0.01, 0.00002});
    scene.bodies.front().mesh = scene.object.mesh;
    scene.bodies.front().paint.albedo_high = 0.3;
    const StereoCalibration calibration = fitCalibration(scene.unit, scene.mode).calibration;
    const RectifiedStereoCamera camera = rectifiedCamera(calibration, {});
    const StereoRectifier rectifier(calibration, camera);
    place(scene, {0.02, 0.01, 0.11});
    auto frame = Simulator(scene).next();
    for (cv::Mat* raw : {&frame->raw.left, &frame->raw.right})  // but for the metadata
      raw->row(raw->rows - 1).setTo(0);
    const RectifiedStereoFrame rectified = rectifier.rectify(frame->raw);
    const Eigen::Vector3d front = frame->camera_from_object * Eigen::Vector3d(0, 0, -1e-5);
    EXPECT_LT((lightCenter(rectified.left) - camera.leftPixel(front)).norm(), 0.12) << mode;
    EXPECT_LT((lightCenter(rectified.right) - camera.rightPixel(front)).norm(), 0.12) << mode;
  }
}

TEST(Simulator, blursAMovingPlateEvenlyAboutTheTruth) {
  Scene scene = plateScene("640x480");
  place(scene, {0.02, 0, 0.1});
  const auto resting = Simulator(scene).next();
  scene.bodies.front().motion.sweeps.push_back({0, -0.02, 0.02, 0.1});  // 1.26 m/s at first
  scene.controls.exposure_us = 2000;
  scene.light.power /= 10;
  const auto moving = Simulator(scene).next();
  const LeapLens left(scene.unit.left, scene.mode);
  const Eigen::Vector2d truth = left.pixel(moving->camera_from_object.translation());
  EXPECT_LT((lightCenter(moving->raw.left) - truth).norm(), 0.1);
  // The way of 2.5 mm widens the patch like an even distribution: by its square over 12.
  const double way =
      (left.pixel({0.02 + 0.00126, 0, 0.1}) - left.pixel({0.02 - 0.00126, 0, 0.1})).x();
  EXPECT_NEAR(columnVariance(moving->raw.left) - columnVariance(resting->raw.left), way * way / 12,
              0.15);
}

TEST(Simulator, dimsWithTheSquareOfTheDistance) {
  // A plate of many pixels: the grey value of one in its middle tells the light on it.
  const auto grayAt = [](double depth) {
    Scene scene = plateScene("640x480");
    scene.object = makePrimitive("plate", Shape::kBox, {0.05, 0.05, 0.0002});
    scene.bodies.front().mesh = scene.object.mesh;
    scene.controls = SensorControls{};
    scene.controls.leds = {false, true, false};
    place(scene, {0.02, 0, depth});
    const auto frame = Simulator(scene).next();
    const Eigen::Vector2d pixel =
        LeapLens(scene.unit.left, scene.mode).pixel({0.02, 0, depth - 0.0001});
    return static_cast<double>(frame->raw.left.at<std::uint8_t>(
        static_cast<int>(std::lround(pixel.y())), static_cast<int>(std::lround(pixel.x()))));
  };
  EXPECT_NEAR(grayAt(0.1) / grayAt(0.2), 4, 0.2);
}

TEST(Simulator, givesTheSameBytesForTheSameSeedWhateverTheThreads) {
  Simulator many(noisyScene(3)), other_seed(noisyScene(4));
  Simulator one(noisyScene(3));
  for (int i = 0; i < 3; ++i) {
    const auto a = many.next();
    const auto b = [&] {
      const tbb::global_control single(tbb::global_control::max_allowed_parallelism, 1);
      return one.next();
    }();
    const auto c = other_seed.next();
    ASSERT_TRUE(a && b && c);
    EXPECT_EQ(a->raw.stamp, b->raw.stamp);
    EXPECT_TRUE(same(a->raw.left, b->raw.left));
    EXPECT_TRUE(same(a->raw.right, b->raw.right));
    EXPECT_FALSE(same(a->raw.left, c->raw.left));
  }
  EXPECT_FALSE(many.next());
}

TEST(Simulator, goesOnInTimeAfterRewind) {
  Simulator simulator(plateScene("640x240"));
  Stamp last;
  while (const auto frame = simulator.next()) last = frame->raw.stamp;
  simulator.rewind();
  const auto again = simulator.next();
  ASSERT_TRUE(again);
  EXPECT_GT(again->raw.stamp, last);
}

TEST(Simulator, restartsAsIfItHadBeenMadeWithTheOtherMotion) {
  Scene scene = plateScene("640x240");
  scene.sensor.read_noise = 1;
  place(scene, {0, 0, 0.1});
  Simulator simulator(scene);
  simulator.next();
  MotionScript elsewhere;
  elsewhere.rest.translation() = Eigen::Vector3d(0.03, 0.01, 0.12);
  SensorControls controls = scene.controls;
  controls.exposure_us = 400;
  simulator.restart(elsewhere, controls, 9);
  const auto restarted = simulator.next();
  EXPECT_TRUE(restarted->camera_from_object.isApprox(elsewhere.rest));
  EXPECT_EQ(restarted->controls.exposure_us, 400);

  scene.seed = 9;
  scene.controls = controls;
  scene.bodies.front().motion = elsewhere;
  const auto made = Simulator(scene).next();
  EXPECT_EQ(cv::norm(restarted->raw.left, made->raw.left, cv::NORM_INF), 0);
  EXPECT_EQ(cv::norm(restarted->raw.right, made->raw.right, cv::NORM_INF), 0);
}

TEST(Simulator, takesFramesAsUnevenlyAsTheThesis) {
  Scene scene = plateScene("640x120");
  place(scene, {0, 0, -1});
  scene.timing = FrameTiming::kThesis;
  scene.frames = 400;
  Simulator simulator(scene);
  std::optional<Stamp> before;
  double sum = 0, squares = 0, shortest = 1;
  int count = 0;
  while (const auto frame = simulator.next()) {
    if (before) {
      const double interval = seconds(frame->raw.stamp - *before);
      shortest = std::min(shortest, interval);
      sum += 1 / interval;
      squares += 1 / (interval * interval);
      ++count;
    }
    before = frame->raw.stamp;
  }
  const double mean = sum / count;
  EXPECT_NEAR(mean, 39, 2);
  EXPECT_NEAR(std::sqrt(squares / count - mean * mean), 12.8, 2);
  EXPECT_GE(shortest, 0.014);
}

TEST(Simulator, obeysItsControls) {
  Scene scene = plateScene("640x240");
  place(scene, {0.02, 0, 0.15});
  Simulator simulator(scene);
  SensorControls controls = simulator.controls();
  controls.exposure_us = 100;
  simulator.setControls(controls);
  const auto dim = simulator.next();
  controls.exposure_us = 200;
  simulator.setControls(controls);
  const auto bright = simulator.next();
  controls.leds = {false, false, false};
  simulator.setControls(controls);
  const auto dark = simulator.next();
  EXPECT_NEAR(meanGray(*bright) / meanGray(*dim), 2, 0.1);
  EXPECT_EQ(meanGray(*dark), 0);
  EXPECT_FALSE(dark->lit);
  EXPECT_EQ(dim->controls.exposure_us, 100);
}

TEST(Simulator, leavesEveryNthFrameDark) {
  Scene scene = plateScene("640x240");
  place(scene, {0.02, 0, 0.15});
  scene.controls.dark_interval = 2;
  Simulator simulator(scene);
  const auto first = simulator.next(), second = simulator.next(), third = simulator.next();
  EXPECT_TRUE(first->lit);
  EXPECT_FALSE(second->lit);
  EXPECT_TRUE(third->lit);
  EXPECT_EQ(meanGray(*second), 0);
}

TEST(Simulator, tellsHowMuchOfTheObjectEachEyeSees) {
  Scene scene = plateScene("640x240");
  place(scene, {0.02, 0, 0.15});
  const auto open = Simulator(scene).next();
  EXPECT_NEAR(open->left_visible, 1, 0.01);
  EXPECT_NEAR(open->right_visible, 1, 0.01);

  SceneBody screen = scene.bodies.front();  // on the line from the left eye only
  screen.mesh = makeBox({0.01, 0.01, 0.001});
  screen.motion.rest.translation() = Eigen::Vector3d(0.01, 0, 0.075);
  scene.bodies.push_back(screen);
  const auto screened = Simulator(scene).next();
  EXPECT_EQ(screened->left_visible, 0);
  EXPECT_NEAR(screened->right_visible, 1, 0.01);

  scene.bodies.pop_back();
  place(scene, {0.02, 0.5, 0.15});  // below the image
  EXPECT_EQ(Simulator(scene).next()->left_visible, 0);
}

TEST(Simulator, castsShadows) {
  Scene scene = plateScene("640x240");
  scene.object = makePrimitive("plate", Shape::kBox, {0.01, 0.01, 0.00002});
  scene.bodies.front().mesh = scene.object.mesh;
  scene.controls.leds = {false, true, false};
  place(scene, {0.06, 0, 0.15});
  const auto open = Simulator(scene).next();
  SceneBody screen = scene.bodies.front();  // half way from the centre LED to the plate
  screen.mesh = makeBox({0.01, 0.01, 0.0005});
  screen.paint.albedo_high = 0;
  screen.motion.rest.translation() = Eigen::Vector3d(0.04, 0, 0.075);
  scene.bodies.push_back(screen);
  const auto shaded = Simulator(scene).next();
  EXPECT_GT(meanGray(*open), 0.003);  // the plate is a few pixels of 150,000
  EXPECT_NEAR(shaded->right_visible, 1, 0.01);
  EXPECT_LT(meanGray(*shaded), 0.05 * meanGray(*open));
}

TEST(Simulator, keepsARestingObjectInPlaceInTheFixedFrameOfAMovingCamera) {
  Scene scene = plateScene("640x240");
  place(scene, {0.02, 0, 0.2});
  scene.camera_motion.sweeps.push_back({0, -0.05, 0.05, 0.1});
  Simulator simulator(scene);
  ASSERT_TRUE(simulator.cameraMoves());
  const auto first = simulator.next(), second = simulator.next();
  const Pose before = first->fixed_from_camera * first->camera_from_object;
  const Pose after = second->fixed_from_camera * second->camera_from_object;
  EXPECT_GT(
      (first->fixed_from_camera.translation() - second->fixed_from_camera.translation()).norm(),
      0.01);
  EXPECT_LT((before.matrix() - after.matrix()).norm(), 1e-12);
  EXPECT_NEAR(before.translation().x(), 0.2, 1e-9);  // ahead of the robot
}

TEST(FitCalibration, describesTheLensWhereObjectsAre) {
  for (const char* file : {"leap_unit_a.yaml", "leap_unit_b.yaml", "leap_unit_a_centred.yaml"}) {
    const LeapUnit unit =
        loadLeapUnit(std::string(LEAP_SOURCE_FOLDER "/config/calibration/") + file);
    const FittedCalibration fitted = fitCalibration(unit, sensorMode("640x240"));
    EXPECT_LT(fitted.left_rms, 0.3) << file;
    EXPECT_LT(fitted.right_rms, 0.3) << file;
  }
}

TEST(FitCalibration, isExactForALensWithoutTangentialTerms) {
  const LeapUnit unit =
      loadLeapUnit(LEAP_SOURCE_FOLDER "/config/calibration/leap_unit_a_centred.yaml");
  const SensorMode mode = sensorMode("640x240");
  const StereoCalibration calibration = fitCalibration(unit, mode).calibration;
  const LeapLens lens(unit.right, mode);
  for (double x = -0.1; x <= 0.11; x += 0.05)
    for (double y = -0.1; y <= 0.11; y += 0.05) {
      const Eigen::Vector3d point(x, y, 0.1);
      const Eigen::Vector3d raw = calibration.right.rectified_from_raw.transpose() * point;
      const Eigen::Vector2d pixel = pixelFromRay(calibration.right, raw.hnormalized());
      EXPECT_LT((pixel - lens.pixel(point)).norm(), 0.005) << point.transpose();
    }
}

}  // namespace
}  // namespace leap_object_tracker
