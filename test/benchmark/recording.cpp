#include "recording.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <tuple>

#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/simulation/simulator.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "tracking/random.hpp"

namespace leap_object_tracker {
namespace {

Recording render(const std::string& name, const std::string& mode, int frames) {
  Scene scene = loadScene(LEAP_SOURCE_FOLDER "/config/scenes/" + name + ".yaml");
  scene.mode = sensorMode(mode);
  scene.timing = FrameTiming::kSteady;
  scene.frames = frames;
  scene.samples = 4;
  Recording recording;
  recording.object = scene.object;
  recording.calibration = fitCalibration(scene.unit, scene.mode).calibration;
  const StereoRectifier rectifier(recording.calibration,
                                  rectifiedCamera(recording.calibration, {}));
  recording.camera = rectifier.camera();
  Simulator simulator(scene);
  while (auto frame = simulator.next()) {
    recording.rectified.push_back(rectifier.rectify(frame->raw));
    recording.camera_from_object.push_back(frame->camera_from_object);
    recording.raw.push_back(std::move(frame->raw));
  }
  return recording;
}

/// The projected bounding sphere and a margin around it.
cv::Rect regionOf(const Recording& recording, double radius, double eye_x) {
  constexpr double kMargin = 15;  // [px]
  Eigen::Vector3d centre = recording.camera_from_object.front().translation();
  centre.x() -= eye_x;
  const Eigen::Vector2d pixel = recording.camera.leftPixel(centre);
  const double reach = kMargin + recording.camera.focal_length * radius / centre.z();
  const cv::Point low(static_cast<int>(pixel.x() - reach), static_cast<int>(pixel.y() - reach));
  const cv::Point high(static_cast<int>(pixel.x() + reach), static_cast<int>(pixel.y() + reach));
  return cv::Rect(low, high) & cv::Rect(cv::Point(), recording.camera.size);
}

}  // namespace

const Recording& recording(const std::string& scene, const std::string& mode, int frames) {
  static std::map<std::tuple<std::string, std::string, int>, Recording> known;
  const auto key = std::make_tuple(scene, mode, frames);
  auto found = known.find(key);
  if (found == known.end()) found = known.emplace(key, render(scene, mode, frames)).first;
  return found->second;
}

Observation::Observation(const Recording& recording, const ContourParams& params)
    : recording_(recording) {
  const double radius = radiusOf(recording.object.mesh);
  const RectifiedStereoFrame& frame = recording.rectified.front();
  const float sigma = 1.2F;
  const double peak = (1 - params.outlier_share) / (std::sqrt(2 * M_PI) * sigma);
  const EdgeKernel kernel{
      sigma, static_cast<float>(std::log(1 + peak * 2 * params.truncation / params.outlier_share))};
  for (std::size_t eye = 0; eye < 2; ++eye) {
    regions_[eye] = regionOf(recording, radius, eye == 0 ? 0 : recording.camera.baseline);
    fields_[eye].build(eye == 0 ? frame.left : frame.right, regions_[eye]);
    fields_[eye].transform(kernel, 1, maps_[eye]);
  }
}

std::vector<ParticlePose> Observation::particles(std::size_t count) const {
  constexpr double kPositionSigma = 0.001;  // [m]
  constexpr double kRotationSigma = 0.03;   // [rad]
  std::vector<ParticlePose> poses;
  poses.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    CounterRandom random(1, 1, i);
    const auto normals = random.sixNormals();
    Twist step;
    for (int k = 0; k < 6; ++k)
      step[k] = (k < 3 ? kPositionSigma : kRotationSigma) *
                static_cast<double>(normals[static_cast<std::size_t>(k)]);
    poses.push_back(toParticlePose(movedInCamera(recording_.camera_from_object.front(), step)));
  }
  return poses;
}

std::array<EyeView, 2> Observation::eyes() const {
  std::array<EyeView, 2> eyes;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    eyes[eye].map = &maps_[eye];
    eyes[eye].focal_length = static_cast<float>(recording_.camera.focal_length);
    eyes[eye].center_u = static_cast<float>(recording_.camera.center_u);
    eyes[eye].center_v = static_cast<float>(recording_.camera.center_v);
    eyes[eye].eye_x = eye == 0 ? 0 : static_cast<float>(recording_.camera.baseline);
  }
  return eyes;
}

}  // namespace leap_object_tracker
