#include "leap_object_tracker/simulation/simulator.hpp"

#include <algorithm>
#include <cmath>

#include "leap_object_tracker/simulation/hash_random.hpp"
#include "leap_object_tracker/simulation/leap_sensor.hpp"
#include "leap_object_tracker/simulation/stereo_renderer.hpp"

namespace leap_object_tracker {
namespace {

/// Scene axes (x right, y down, z forward) to robot axes (x forward, y left, z up).
Pose fixedFromScene() {
  Pose pose = Pose::Identity();
  pose.linear() << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return pose;
}

/// Time from one frame to the next [s].
double frameInterval(const Scene& scene, HashRandom& random) {
  if (scene.timing == FrameTiming::kThesis) {
    // Rates of the thesis: normal, cut at the shortest interval seen and at 10 Hz.
    constexpr double kMean = 39, kDeviation = 12.8, kShortest = 0.014, kLowest = 10;
    for (;;) {
      const double rate = kMean + kDeviation * random.normal();
      if (rate >= kLowest && rate <= 1 / kShortest) return 1 / rate;
    }
  }
  constexpr double kJitter = 3e-4;  // [s]
  const double jitter = std::clamp(random.normal(), -2.0, 2.0) * kJitter;
  return std::max(0.5 / scene.mode.rate, 1 / scene.mode.rate + jitter);
}

}  // namespace

Stamp simulationStart() { return stampFromSeconds(1500000000); }

class Simulator::Impl {
 public:
  explicit Impl(const Scene& scene)
      : scene_(scene),
        renderer_(scene),
        left_sensor_(scene.sensor, scene.mode, mixed(scene.seed, 1)),
        right_sensor_(scene.sensor, scene.mode, mixed(scene.seed, 2)),
        auto_exposure_(scene.sensor.pulse_limit_us),
        controls_(scene.controls),
        timing_(scene.seed, 3) {}

  std::optional<SimulatedFrame> next() {
    if (frame_ >= scene_.frames) return std::nullopt;
    SimulatedFrame frame;
    const double middle = time_;
    frame.raw.stamp = start_ + std::chrono::nanoseconds(std::llround(middle * 1e9));
    frame.controls = controls_;
    const int dark = controls_.dark_interval;
    frame.lit =
        (dark == 0 || (dark > 1 && (frame_ + 1) % dark != 0)) &&
        std::any_of(controls_.leds.begin(), controls_.leds.end(), [](bool on) { return on; });

    const double half = controls_.exposure_us * 1e-6 / 2;
    std::vector<BodyPath> paths;
    for (const auto& body : scene_.bodies)
      paths.push_back({cameraFromBody(body, middle - half), cameraFromBody(body, middle + half)});
    const double gain = controls_.gain / 16.0 * controls_.digital_gain / 4.0;
    constexpr double kVisibleStep = 1.5;  // [counts]
    const std::uint64_t name = mixed(scene_.seed, 1000 + frames_ever_);
    const StereoRadiance radiance =
        renderer_.render(paths, frame.lit ? controls_.leds : std::array<bool, 3>{},
                         kVisibleStep / (controls_.exposure_us * gain), name);
    frame.raw.left = left_sensor_.expose(radiance.left, controls_, frame.lit, mixed(name, 1));
    frame.raw.right = right_sensor_.expose(radiance.right, controls_, frame.lit, mixed(name, 2));
    embedMetadata(frame.raw.left, frame.raw.right, controls_, frame.lit);

    frame.camera_from_object = cameraFromBody(scene_.bodies.front(), middle);
    frame.fixed_from_camera = fixedFromScene() * scene_.camera_motion.at(middle);
    for (std::size_t i = 1; i < scene_.bodies.size(); ++i)
      frame.others.push_back({scene_.bodies[i].name, scene_.bodies[i].is_object,
                              cameraFromBody(scene_.bodies[i], middle)});
    frame.left_visible = renderer_.visibleShare(0);
    frame.right_visible = renderer_.visibleShare(1);

    if (scene_.sensor.auto_exposure && frame.lit)
      controls_ = auto_exposure_.after(frame.raw.left, frame.raw.right, controls_);
    time_ += frameInterval(scene_, timing_);
    ++frame_;
    ++frames_ever_;
    return frame;
  }

  void rewind() {
    start_ += std::chrono::nanoseconds(std::llround(time_ * 1e9));
    time_ = 0;
    frame_ = 0;
  }

  void restart(const MotionScript& object_motion, const SensorControls& controls,
               std::uint64_t seed) {
    rewind();
    scene_.bodies.front().motion = object_motion;
    scene_.seed = seed;
    timing_ = HashRandom(seed, 3);
    auto_exposure_ = AutoExposure(scene_.sensor.pulse_limit_us);
    controls_ = controls;
    frames_ever_ = 0;
  }

  void setControls(const SensorControls& controls) { controls_ = controls; }
  const SensorControls& controls() const { return controls_; }
  const Scene& scene() const { return scene_; }

 private:
  Pose cameraFromBody(const SceneBody& body, double time) const {
    Pose scene_from_body = body.motion.at(time);
    if (body.parent == SceneBody::Parent::kObject)
      scene_from_body = scene_.bodies.front().motion.at(time) * scene_from_body;
    return scene_.camera_motion.at(time).inverse() * scene_from_body;
  }

  Scene scene_;
  StereoRenderer renderer_;
  LeapSensor left_sensor_, right_sensor_;
  AutoExposure auto_exposure_;
  SensorControls controls_;
  HashRandom timing_;
  Stamp start_ = simulationStart();
  double time_ = 0;  ///< [s] since start_, middle of the next exposure
  int frame_ = 0;
  std::uint64_t frames_ever_ = 0;
};

Simulator::Simulator(const Scene& scene) : impl_(std::make_unique<Impl>(scene)) {}
Simulator::~Simulator() = default;
std::optional<SimulatedFrame> Simulator::next() { return impl_->next(); }
void Simulator::rewind() { impl_->rewind(); }
void Simulator::restart(const MotionScript& object_motion, const SensorControls& controls,
                        std::uint64_t seed) {
  impl_->restart(object_motion, controls, seed);
}
void Simulator::setControls(const SensorControls& controls) { impl_->setControls(controls); }
const SensorControls& Simulator::controls() const { return impl_->controls(); }
const Scene& Simulator::scene() const { return impl_->scene(); }
bool Simulator::cameraMoves() const { return impl_->scene().camera_motion.moves(); }

}  // namespace leap_object_tracker
