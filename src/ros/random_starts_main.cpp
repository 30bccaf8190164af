#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "command_line.hpp"
#include "leap_object_tracker/evaluation/start_trials.hpp"
#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/simulation/random_scene.hpp"
#include "leap_object_tracker/simulation/simulator.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "overlay.hpp"
#include "parameters.hpp"

namespace leap_object_tracker {
namespace {

namespace fs = std::filesystem;

constexpr const char* kUsage =
    R"(usage: random_starts OBJECT.yaml [OBJECT.yaml ...] --calibration FILE.yaml [options]

Starts a tracker from nothing on random poses, each in a short simulated sequence of its own, and
prints how often it is right in the third frame, by object, surroundings and depth: within 2 mm and
2 deg up to 15 cm, 5 mm and 5 deg beyond; wrong is off by more than 10 mm or 10 deg.

  --calibration FILE.yaml of the simulated Leap (config/calibration)
  --number N              of starts, shared by the objects (1000)
  --seed N                of poses, scenes and noise (1)
  --scenes N              random surroundings and paints of each object (10)
  --depth NEAR FAR        [m] of the object's origin (0.04 0.30)
  --uniform               depths evenly over metres instead of their logarithm
  --widest DEG            off the axis of the pair at most (90)
  --visible SHARE         of the object that each eye sees at least (0.7)
  --frames N              of each sequence (4)
  --config FILE.yaml      parameters of the tracker (config/tracker_*.yaml)
  --threads N
  --csv FILE.csv          every frame of every start
  --list-failures         those that are not right in the third frame, as they come
  --only INDEX            this start alone
  --save FOLDER           pictures of the failures (with --only: of that start): what each eye sees,
                          rectified; above with the estimate, below with the truth
)";

const std::map<std::string, int> kOptions{
    {"number", 1},  {"seed", 1},   {"scenes", 1}, {"depth", 2},         {"uniform", 0},
    {"visible", 1}, {"widest", 1}, {"frames", 1}, {"calibration", 1},   {"config", 1},
    {"threads", 1}, {"csv", 1},    {"only", 1},   {"list-failures", 0}, {"save", 1}};

constexpr std::size_t kDue = 3;  // the frame that is judged

TrackerParams readParams(const CommandLine& line) {
  ParameterReader reader(line.has("config") ? loadYamlFile(line.text("config")) : YAML::Node(),
                         "file '" + line.text("config") + "'");
  TrackerParams params = readTrackerNodeParams(reader).tracker;
  readFilterOptions(line, params);
  // Each start has a tracker of its own; the views of a mesh are computed once.
  if (params.contour.cache_folder.empty())
    params.contour.cache_folder =
        (fs::temp_directory_path() / "leap_object_tracker_views").string();
  return params;
}

PlacementRange readRange(const CommandLine& line) {
  PlacementRange range;
  if (line.has("depth")) {
    range.nearest = line.number("depth", 0, 0.02, 2);
    range.farthest = line.number("depth", 1, range.nearest, 2);
  }
  range.uniform = line.has("uniform");
  if (line.has("widest")) range.widest = M_PI / 180 * line.number("widest", 0, 5, 90);
  if (line.has("visible")) range.least_visible = line.number("visible", 0, 0.1, 1);
  return range;
}

long long wholeNumber(const CommandLine& line, const std::string& option, long long otherwise,
                      long long low, long long high) {
  return line.has(option) ? line.wholeNumber(option, low, high) : otherwise;
}

class RandomStarts {
 public:
  explicit RandomStarts(const CommandLine& line)
      : line_(line),
        params_(readParams(line)),
        range_(readRange(line)),
        number_(static_cast<int>(wholeNumber(line, "number", 1000, 1, 1000000))),
        frames_(static_cast<int>(wholeNumber(line, "frames", 4, 3, 1000))),
        scenes_(static_cast<int>(wholeNumber(line, "scenes", 10, 1, 1000))),
        seed_(static_cast<std::uint64_t>(
            wholeNumber(line, "seed", 1, 0, std::numeric_limits<long long>::max()))) {
    for (const auto& path : line.positional()) {
      objects_.push_back(loadObject(path));
      objects_.back().textured.reset();  // their paint is drawn at random
    }
    if (line.has("only")) only_ = static_cast<int>(line.wholeNumber("only", 0, number_ - 1));
    if (line.has("save")) fs::create_directories(line.text("save"));
    if (!line.has("csv")) return;
    csv_.open(line.text("csv"));
    if (!csv_) throw std::runtime_error("cannot write '" + line.text("csv") + "'");
    writeStartCsvHeading(csv_);
  }

  void run() {
    const int objects = static_cast<int>(objects_.size());
    for (int object = 0; object < objects; ++object)
      for (int scene = 0; scene < scenes_; ++scene) runScene(object, scene);
    if (isatty(STDERR_FILENO) != 0) std::fputs("\r", stderr);
    writeStartTable(std::cout, trials_);
  }

 private:
  /// All starts of one object in one scene: the starts take turns at objects, then at scenes.
  void runScene(int object, int scene) {
    const int objects = static_cast<int>(objects_.size());
    const auto mine = [&](int index) {
      return index % objects == object && index / objects % scenes_ == scene &&
             (only_ < 0 || index == only_);
    };
    std::vector<int> indices;
    for (int index = 0; index < number_; ++index)
      if (mine(index)) indices.push_back(index);
    if (indices.empty()) return;

    const ObjectModel& model = objects_[static_cast<std::size_t>(object)];
    const auto name = mixed(seed_, static_cast<std::uint64_t>(object * scenes_ + scene));
    RandomScene random = randomScene(model, line_.text("calibration"), name);
    random.scene.frames = frames_;
    const StereoCalibration calibration =
        fitCalibration(random.scene.unit, random.scene.mode).calibration;
    const StereoRectifier rectifier(calibration, rectifiedCamera(calibration, {}));
    const RandomPlacement placement(random.scene, rectifier.camera(), range_);
    Simulator simulator(random.scene);
    for (const int index : indices) {
      StartTrial trial;
      trial.index = index;
      trial.object = model.name;
      trial.surroundings = wordFrom(random.surroundings);
      runTrial(model, placement, rectifier, simulator, trial);
      trials_.push_back(trial);
      if (csv_.is_open()) {
        writeStartCsv(csv_, trial);
        csv_.flush();
      }
      if (isatty(STDERR_FILENO) != 0)
        std::fprintf(stderr, "\r%zu of %d starts ", trials_.size(), number_);
    }
  }

  /// The first frame of a placement of which both eyes see enough.
  SimulatedFrame place(const RandomPlacement& placement, int index, Simulator& simulator) const {
    constexpr int kAttempts = 100, kLooks = 3;
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      const std::uint64_t name = mixed(mixed(seed_, 1000 + static_cast<std::uint64_t>(index)),
                                       static_cast<std::uint64_t>(attempt));
      HashRandom random(name);
      const MotionScript motion = placement.draw(random);
      // Where the light is too strong to be measured, or too weak, the next look is better.
      SensorControls controls = simulator.scene().controls;
      for (int look = 0; look < kLooks; ++look) {
        simulator.restart(motion, controls, name);
        const auto frame = simulator.next();
        if (!frame || std::min(frame->left_visible, frame->right_visible) < range_.least_visible)
          break;
        if (look + 1 == kLooks) return *frame;
        controls =
            randomControls(frame->raw, controls, simulator.scene().sensor.pulse_limit_us, random);
      }
    }
    throw std::runtime_error("start " + std::to_string(index) +
                             ": both eyes see too little of the object, wherever it is");
  }

  void runTrial(const ObjectModel& object, const RandomPlacement& placement,
                const StereoRectifier& rectifier, Simulator& simulator, StartTrial& trial) {
    using Clock = std::chrono::steady_clock;
    Tracker tracker(params_, object, rectifier.camera());
    tracker.search();
    std::optional<SimulatedFrame> frame = place(placement, trial.index, simulator);
    const Eigen::Vector3d origin = frame->camera_from_object.translation();
    trial.depth = origin.z();
    const Eigen::Vector3d from_middle =
        origin - Eigen::Vector3d(rectifier.camera().baseline / 2, 0, 0);
    trial.off_axis = std::atan2(from_middle.head<2>().norm(), from_middle.z());
    trial.visible = std::min(frame->left_visible, frame->right_visible);
    for (; frame; frame = simulator.next()) {
      const auto begin = Clock::now();
      const RectifiedStereoFrame rectified = rectifier.rectify(frame->raw);
      const std::optional<PoseEstimate> estimate = tracker.track(rectified);
      const std::chrono::duration<double, std::milli> elapsed = Clock::now() - begin;
      const auto pose =
          estimate ? std::make_optional(estimate->camera_from_object) : std::optional<Pose>();
      StartFrame judged = judgeStart(pose, frame->camera_from_object, object.symmetry);
      judged.total_ms = elapsed.count();
      judged.search_ms = tracker.report().search_ms;
      trial.frames.push_back(judged);
      if (trial.frames.size() == kDue) tell(trial, *frame, rectified, tracker, pose);
    }
  }

  void tell(const StartTrial& trial, const SimulatedFrame& frame,
            const RectifiedStereoFrame& rectified, const Tracker& tracker,
            const std::optional<Pose>& estimate) const {
    const StartVerdict verdict = verdictOf(trial, kDue);
    if (verdict == StartVerdict::kRight && only_ < 0) return;
    if (line_.has("list-failures") || only_ >= 0) {
      const Eigen::Vector3d at = 100 * frame.camera_from_object.translation();
      const StartFrame& judged = trial.frames.back();
      std::printf(
          "start %d (seed %llu): %s, %s, %s, at %.1f %.1f %.1f cm, %.0f deg off axis, "
          "%.0f %% visible, %.0f us; support %.2f",
          trial.index, static_cast<unsigned long long>(seed_), wordFrom(verdict).c_str(),
          trial.object.c_str(), trial.surroundings.c_str(), at.x(), at.y(), at.z(),
          trial.off_axis * 180 / M_PI, 100 * trial.visible,
          frame.controls.exposure_us * frame.controls.gain / 16, tracker.report().support);
      if (judged.tracked)
        std::printf(", off by %.2f mm and %.2f deg", 1e3 * judged.position,
                    judged.orientation * 180 / M_PI);
      std::printf("\n");
      std::fflush(stdout);
    }
    if (line_.has("save")) save(trial.index, frame, rectified, tracker, estimate);
  }

  void save(int index, const SimulatedFrame& frame, const RectifiedStereoFrame& rectified,
            const Tracker& tracker, const std::optional<Pose>& estimate) const {
    std::ostringstream stem;
    stem << line_.text("save") << "/" << std::setw(6) << std::setfill('0') << index;
    cv::Mat both;
    cv::vconcat(drawOverlay(rectified, tracker, estimate),
                drawOverlay(rectified, tracker, frame.camera_from_object), both);
    for (const auto& [name, image] : {std::make_pair(stem.str() + ".png", both),
                                      std::make_pair(stem.str() + "_left.png", rectified.left),
                                      std::make_pair(stem.str() + "_right.png", rectified.right)})
      if (!cv::imwrite(name, image)) throw std::runtime_error("cannot write '" + name + "'");
  }

  const CommandLine& line_;
  TrackerParams params_;
  PlacementRange range_;
  int number_, frames_, scenes_;
  std::uint64_t seed_;
  int only_ = -1;
  std::vector<ObjectModel> objects_;
  std::vector<StartTrial> trials_;
  std::ofstream csv_;
};

void run(const CommandLine& line) {
  if (line.positional().empty()) throw UsageError("expected at least one OBJECT.yaml");
  if (!line.has("calibration")) throw UsageError("--calibration is missing");
  RandomStarts(line).run();
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"random_starts", kUsage, kOptions}, argc, argv, run);
}
