#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "emulated_leap_bus.hpp"
#include "emulated_leap_picture.hpp"
#include "leap_object_tracker/leap/dark_frames.hpp"
#include "leap_object_tracker/leap/exposure_controller.hpp"
#include "leap_object_tracker/leap/leap_device.hpp"

namespace leap_object_tracker {
namespace {

using std::chrono::milliseconds;

Scene cubeAt(double distance) {
  Scene scene = loadScene(LEAP_SOURCE_FOLDER "/config/scenes/x10_cube.yaml");
  scene.sensor.auto_exposure = false;
  scene.samples = 4;
  SceneBody& cube = scene.bodies.front();
  cube.motion.sweeps.clear();
  cube.motion.wobbles.clear();
  cube.motion.rest.translation() = Eigen::Vector3d(0.02, 0, distance);
  return scene;
}

class SimulatedPictures : public testing::Test {
 protected:
  void start(const Scene& scene, const LeapControls& controls) {
    picture_ = std::make_unique<SimulatedPicture>(scene);
    leap_.setPicture(picture_->picture());
    bus_.port(1).plug(leap_);
    context_ = std::make_unique<UsbContext>();
    device_ = std::make_unique<LeapDevice>(*context_, "");
    LeapStreamParams params;
    params.queue = 1;
    device_->start(params, controls);
  }
  LeapFrame next() {
    for (int i = 0; i < 200; ++i)
      if (auto frame = device_->grab(milliseconds(100))) return std::move(*frame);
    throw std::runtime_error("no frame came");
  }

  std::unique_ptr<SimulatedPicture> picture_;
  EmulatedLeap leap_;
  EmulatedBus bus_;
  std::unique_ptr<UsbContext> context_;
  std::unique_ptr<LeapDevice> device_;
};

/// The object's pixels in the raw left image.
cv::Mat maskOfObject(const Scene& scene) {
  const LeapLens lens(scene.unit.left, scene.mode);
  const Pose camera_from_object = scene.bodies.front().motion.at(0);
  std::vector<cv::Point> corners, outline;
  for (const auto& vertex : scene.bodies.front().mesh.vertices) {
    const Eigen::Vector2d pixel = lens.pixel(camera_from_object * vertex);
    corners.emplace_back(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
  }
  cv::convexHull(corners, outline);
  cv::Mat mask(scene.mode.height, scene.mode.width, CV_8UC1, cv::Scalar(0));
  cv::fillConvexPoly(mask, outline, cv::Scalar(255));
  return mask;
}

double saturatedShare(const cv::Mat& image, const cv::Mat& mask) {
  return cv::countNonZero((image >= 250) & mask) / static_cast<double>(cv::countNonZero(mask));
}

class ExposureStep : public SimulatedPictures, public testing::WithParamInterface<bool> {};

TEST_P(ExposureStep, leavesLessThanOnePercentSaturatedWithinTenFrames) {
  const bool knows_region = GetParam();
  const Scene far = cubeAt(0.30), near = cubeAt(0.065);  // its front comes to 5 cm
  const ExposureController controller{ExposureParams()};
  start(far, LeapControls());
  cv::Mat mask = maskOfObject(far);
  const auto step = [&] {
    const LeapFrame frame = next();
    const cv::Rect region = knows_region ? cv::boundingRect(mask) : cv::Rect();
    if (const auto controls =
            controller.update(frame.images.left, region, frame.taken_with, device_->controls()))
      device_->setControls(*controls);
    return frame;
  };
  LeapFrame settled;
  for (int i = 0; i < 40; ++i) settled = step();
  const double far_level = cv::mean(settled.images.left, mask)[0];
  const double far_light = device_->controls().light();
  EXPECT_LT(saturatedShare(settled.images.left, mask), 0.01);
  EXPECT_TRUE(!knows_region || far_level > 60) << far_level;

  picture_->show(near);
  mask = maskOfObject(near);
  int frames = 0;
  double saturated = 1, worst_after = 0;
  for (int i = 1; i <= 40; ++i) {
    saturated = saturatedShare(step().images.left, mask);
    if (saturated >= 0.01) frames = i;
    if (i > 10) worst_after = std::max(worst_after, saturated);
  }
  std::printf(
      "30 to 5 cm: light %.0f to %.0f us, object level at 30 cm %.0f, last frame with 1 %% or"
      " more saturated: %d\n",
      far_light, device_->controls().light(), far_level, frames);
  EXPECT_LE(frames, 10);
  EXPECT_LT(worst_after, 0.01);
}

INSTANTIATE_TEST_SUITE_P(With, ExposureStep, testing::Bool(), [](const auto& info) {
  return info.param ? "theRegionOfTheObject" : "theWholeImage";
});

TEST_F(SimulatedPictures, showTheSameInSunlightOnceDarkFramesAreSubtracted) {
  Scene shade = cubeAt(0.12), sun = shade;
  shade.light.ambient = 0;
  sun.light.ambient = 1;
  LeapControls controls;
  controls.exposure_us = 120;
  controls.dark_interval = 2;

  start(sun, controls);
  DarkFrameDetector detector;
  AmbientSubtraction subtraction;
  cv::Mat plain, subtracted;
  for (int i = 0; i < 30; ++i) {
    LeapFrame frame = next();
    cv::Mat &left = frame.images.left, &right = frame.images.right;
    if (detector.isDark(frame.metadata, cv::mean(left)[0], 2)) {
      subtraction.setDark(left, right, frame.taken_with);
      continue;
    }
    left.copyTo(plain);
    if (subtraction.subtract(left, right, frame.taken_with)) left.copyTo(subtracted);
  }
  ASSERT_FALSE(subtracted.empty());

  Simulator simulator(shade);
  SensorControls same;
  same.exposure_us = controls.exposure_us;
  simulator.setControls(same);
  const cv::Mat reference = simulator.next()->raw.left;
  const cv::Mat mask = maskOfObject(shade);
  const auto difference = [&](const cv::Mat& image) {
    cv::Mat absolute;
    cv::absdiff(image, reference, absolute);
    return cv::mean(absolute, mask)[0];
  };
  std::printf("object against the picture without sun: %.1f before, %.1f after\n",
              difference(plain), difference(subtracted));
  EXPECT_GT(difference(plain), 20);
  EXPECT_LT(difference(subtracted), 6);
}

}  // namespace
}  // namespace leap_object_tracker
