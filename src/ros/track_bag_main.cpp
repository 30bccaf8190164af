#include <tf2/exceptions.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "command_line.hpp"
#include "conversions.hpp"
#include "leap_object_tracker/evaluation/report_text.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "overlay.hpp"
#include "parameters.hpp"
#include "stereo_bag.hpp"
#include "tracker_words.hpp"

namespace leap_object_tracker {
namespace {

constexpr const char* kUsage = R"(usage: track_bag BAG --object FILE.yaml --out POSES.tum [options]

Tracks an object through a recorded stereo camera, every pair once, and writes the poses in TUM
format: stamp tx ty tz qx qy qz qw, the object in the left rectified optical frame.

  --config FILE.yaml      parameters of the tracker (config/tracker_*.yaml)
  --rectify FILE.yaml     parameters of the rectification (config/rectify.yaml)
  --start HOW             search (default) | truth | "x y z qx qy qz qw"
  --perturb MM DEG        moves and turns the start pose by as much, in a random direction
  --method NAME           auto | contour | feature | both: instead of the key 'measurement'
  --map FILE.yaml         landmarks of the object to begin with
  --save-map FILE.yaml    the landmarks known at the end
  --eyes NAME             both | left | right
  --particles N, --threads N, --seed N
  --every N               takes only the first of every N pairs: motion N times as fast
  --fixed-frame FRAME     frame that the object rests or moves in, if the bag's tf knows the camera
  --timing FILE.csv       stamp, state and milliseconds of every pair
  --errors FILE.csv       errors of every frame that has a true pose
  --covariances FILE.csv  stamp and upper triangle of the covariance of every pose
  --overlay DIR           PNG of every 10th pair with the contour of the estimate
  --overlay-every N
  --left-image, --right-image, --left-info, --right-info, --calibration, --truth TOPIC
)";

const std::map<std::string, int> kOptions{
    {"object", 1},      {"out", 1},           {"config", 1},      {"rectify", 1},
    {"start", 1},       {"perturb", 2},       {"method", 1},      {"eyes", 1},
    {"every", 1},       {"particles", 1},     {"threads", 1},     {"seed", 1},
    {"fixed-frame", 1}, {"timing", 1},        {"errors", 1},      {"covariances", 1},
    {"overlay", 1},     {"overlay-every", 1}, {"left-image", 1},  {"right-image", 1},
    {"left-info", 1},   {"right-info", 1},    {"calibration", 1}, {"truth", 1},
    {"map", 1},         {"save-map", 1}};

using Clock = std::chrono::steady_clock;

double millisecondsSince(Clock::time_point begin) {
  return 1e3 * std::chrono::duration<double>(Clock::now() - begin).count();
}

TrackerParams readParams(const CommandLine& line) {
  ParameterReader reader(line.has("config") ? loadYamlFile(line.text("config")) : YAML::Node(),
                         "file '" + line.text("config") + "'");
  TrackerParams params = readTrackerNodeParams(reader).tracker;
  if (line.has("method")) params.measurement = measurementFromWord(line.text("method"));
  if (line.has("map")) params.feature.map_file = line.text("map");
  if (line.has("eyes")) params.eyes = eyesFromWord(line.text("eyes"));
  readFilterOptions(line, params);
  return params;
}

StereoBagTopics readTopics(const CommandLine& line) {
  StereoBagTopics topics;
  topics.left_image = line.text("left-image", topics.left_image);
  topics.right_image = line.text("right-image", topics.right_image);
  topics.left_info = line.text("left-info", topics.left_info);
  topics.right_info = line.text("right-info", topics.right_info);
  topics.calibration = line.text("calibration", topics.calibration);
  topics.truth = line.text("truth", topics.truth);
  return topics;
}

/// The pose moved and turned by the given amounts, in directions drawn evenly over the sphere.
Pose perturbed(const Pose& pose, double metres, double radians, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::normal_distribution<double> normal;
  const auto direction = [&] {
    const double x = normal(random), y = normal(random), z = normal(random);
    return Eigen::Vector3d(x, y, z).normalized();
  };
  Pose result = pose;
  result.translation() += metres * direction();
  result.linear() = pose.linear() * rotationFromVector(radians * direction());
  return result;
}

/// A pose to start from and when.
struct Start {
  Pose camera_from_object;
  std::optional<Stamp> stamp;  ///< absent: with the first frame
};

std::optional<Start> readStart(const CommandLine& line, const StereoBag& bag,
                               const TrackerParams& params) {
  const std::string how = line.text("start", "search");
  if (how == "search") {
    if (line.has("perturb")) throw UsageError("--perturb needs a start pose, not --start search");
    return std::nullopt;
  }
  Start start;
  if (how == "truth") {
    const auto truth = bag.firstTruth();
    if (!truth) throw std::runtime_error("--start truth: the bag has no true poses");
    start = {truth->camera_from_object, truth->stamp};
  } else {
    start.camera_from_object = poseFrom(how);
  }
  if (line.has("perturb"))
    start.camera_from_object =
        perturbed(start.camera_from_object, 1e-3 * line.number("perturb", 0, 0, 1000),
                  M_PI / 180 * line.number("perturb", 1, 0, 180), params.filter.seed);
  return start;
}

/// One bag, from the first pair to the last.
class BagTracking {
 public:
  explicit BagTracking(const CommandLine& line)
      : line_(line),
        params_(readParams(line)),
        object_(loadObject(line.text("object"))),
        bag_(line.positional().front(), readTopics(line), params_.eyes),
        start_(readStart(line, bag_, params_)),
        rectifier_(bag_.calibration(), rectifiedCamera(bag_.calibration(), rectification(line))),
        tracker_(params_, object_, rectifier_.camera()) {
    if (line.has("fixed-frame")) transforms_ = bag_.transforms();
    if (!start_) tracker_.search();
    if (line.has("timing")) {
      timing_ = createFile(line.text("timing"));
      timing_ << "stamp,state,rectification_ms,edges_ms,filter_ms,total_ms\n" << std::fixed;
    }
    if (line.has("overlay")) std::filesystem::create_directories(line.text("overlay"));
    if (line.has("every")) every_ = static_cast<std::size_t>(line.wholeNumber("every", 1, 1000000));
    if (line.has("overlay-every"))
      overlay_every_ = static_cast<std::size_t>(line.wholeNumber("overlay-every", 1, 1000000));
    createFile(line.text("out"));  // fails now, not after the work
  }

  void run() {
    const auto rest = bag_.forEachPair([this](const RawStereoFrame& frame) { track(frame); });
    truth_ = rest.truth;
    if (isatty(STDERR_FILENO) != 0) std::fprintf(stderr, "\r%40s\r", "");
    if (rest.images_left_alone > 0)
      warn(std::to_string(rest.images_left_alone) + " images had no partner of the same stamp");
    if (backwards_ > 0)
      warn("time jumped backwards " + std::to_string(backwards_) +
           " times; the poses are written in the order of the bag, figures are of the first run");
    if (transforms_ && no_transform_ > 0)
      warn("no transform from " + bag_.cameraFrame() + " to " + line_.text("fixed-frame") +
           " for " + std::to_string(no_transform_) + " frames: the camera was taken to be at rest");
    if (line_.has("save-map")) tracker_.saveLandmarks(line_.text("save-map"));
    writeResults();
  }

 private:
  static RectificationParams rectification(const CommandLine& line) {
    ParameterReader reader(line.has("rectify") ? loadYamlFile(line.text("rectify")) : YAML::Node(),
                           "file '" + line.text("rectify") + "'");
    return readRectifyNodeParams(reader).rectification;
  }

  static void warn(const std::string& what) { std::cerr << "track_bag: warning: " << what << "\n"; }

  std::optional<Pose> fixedFromCamera(Stamp stamp) {
    if (!transforms_) return std::nullopt;
    try {
      return poseFrom(transforms_->lookupTransform(line_.text("fixed-frame"), bag_.cameraFrame(),
                                                   timeFrom(stamp)));
    } catch (const tf2::TransformException&) {
      ++no_transform_;
      return std::nullopt;
    }
  }

  void track(const RawStereoFrame& raw) {
    using namespace std::chrono_literals;
    if (pairs_++ % every_ != 0) return;
    if (!frames_.empty() && raw.stamp <= frames_.back()) ++backwards_;
    if (start_ && (!start_->stamp || *start_->stamp <= raw.stamp + 1ms)) {
      tracker_.start(start_->camera_from_object);
      start_.reset();
    }
    const std::optional<Pose> fixed_from_camera = fixedFromCamera(raw.stamp);

    const auto begin = Clock::now();
    const RectifiedStereoFrame frame = rectifier_.rectify(raw);
    const double rectification_ms = millisecondsSince(begin);
    const std::optional<PoseEstimate> estimate = tracker_.track(frame, fixed_from_camera);
    const double total_ms = millisecondsSince(begin);

    frames_.push_back(raw.stamp);
    total_ms_.push_back(total_ms);
    if (estimate)
      poses_.push_back({estimate->stamp, estimate->camera_from_object, estimate->covariance});
    const TrackerReport& report = tracker_.report();
    if (timing_.is_open())
      timing_ << std::setprecision(9) << seconds(raw.stamp) << ',' << wordFrom(report.state) << ','
              << std::setprecision(4) << rectification_ms << ',' << report.edges_ms << ','
              << report.filter_ms + report.search_ms << ',' << total_ms << '\n';
    if (line_.has("overlay") && (frames_.size() - 1) % overlay_every_ == 0)
      writeOverlay(frame, estimate);
    if (isatty(STDERR_FILENO) != 0 && frames_.size() % 20 == 0)
      std::fprintf(stderr, "\r%zu of %zu pairs", frames_.size(), bag_.mostPairs());
  }

  void writeOverlay(const RectifiedStereoFrame& frame,
                    const std::optional<PoseEstimate>& estimate) {
    std::ostringstream name;
    name << line_.text("overlay") << "/" << std::setw(5) << std::setfill('0') << frames_.size() - 1
         << ".png";
    const auto pose =
        estimate ? std::make_optional(estimate->camera_from_object) : std::optional<Pose>();
    if (!cv::imwrite(name.str(), drawOverlay(frame, tracker_, pose)))
      throw std::runtime_error("cannot write '" + name.str() + "'");
  }

  void writeResults() {
    writeTum(line_.text("out"), poses_);
    if (line_.has("covariances")) writeCovariances(line_.text("covariances"), poses_);
    std::vector<double> sorted = total_ms_;
    std::sort(sorted.begin(), sorted.end());
    std::printf("object            %s, symmetry: %s\n", object_.name.c_str(),
                describe(object_.symmetry).c_str());
    std::printf("frames            %zu, %zu with a pose, %zu without\n", frames_.size(),
                poses_.size(), frames_.size() - poses_.size());
    const ErrorStatistics time = statisticsOf(total_ms_);
    std::printf("time [ms]         median %.2f, 99 %% %.2f, %.0f frames/s\n", time.median,
                sorted[static_cast<std::size_t>(0.99 * static_cast<double>(sorted.size() - 1))],
                1e3 / time.mean);
    if (truth_.empty()) {
      std::printf("no true poses in the bag: no errors to print\n");
      return;
    }
    if (poses_.empty()) {
      std::printf("no pose to judge\n");
      return;
    }
    EvaluationParams evaluation;
    evaluation.frames = frames_;
    printErrors(compare(poses_, truth_, object_, evaluation));
  }

  void printErrors(const TrajectoryReport& report) {
    const auto row = [](const char* name, const ErrorStatistics& e, double scale) {
      std::printf("%-17s RMS %.3f, median %.3f, 95 %% %.3f, largest %.3f\n", name, scale * e.rms,
                  scale * e.median, scale * e.p95, scale * e.largest);
    };
    constexpr double kDegrees = 180 / M_PI;
    row("position [mm]", report.position, 1e3);
    row("orientation [deg]", report.orientation, kDegrees);
    row("ADD-S [mm]", report.add_s, 1e3);
    std::printf("within 2 mm, 2 deg  %.1f %% of the frames\n", 100 * report.within_2mm_2deg);
    std::printf("within 5 mm, 5 deg  %.1f %% of the frames\n", 100 * report.within_5mm_5deg);
    std::printf("beyond 10 mm, 10 deg  %.1f %% of the frames\n", 100 * report.wrong);
    std::printf("frames without pose  %d\n", report.without_pose);
    if (report.nees)
      std::printf("NEES              mean %.2f, 95 %% band %.2f to %.2f\n", report.nees->mean,
                  report.nees->band_low, report.nees->band_high);
    if (line_.has("errors")) {
      std::ofstream file = createFile(line_.text("errors"));
      writeFrameCsv(file, report);
    }
  }

  const CommandLine& line_;
  TrackerParams params_;
  ObjectModel object_;
  StereoBag bag_;
  Trajectory truth_;
  std::optional<Start> start_;
  StereoRectifier rectifier_;
  Tracker tracker_;
  std::unique_ptr<tf2::BufferCore> transforms_;
  std::ofstream timing_;
  std::size_t overlay_every_ = 10;
  std::size_t every_ = 1;
  std::size_t pairs_ = 0;
  std::vector<Stamp> frames_;
  std::vector<double> total_ms_;
  Trajectory poses_;
  std::size_t backwards_ = 0;
  std::size_t no_transform_ = 0;
};

void run(const CommandLine& line) {
  if (line.positional().size() != 1) throw UsageError("expected one BAG");
  for (const char* needed : {"object", "out"})
    if (!line.has(needed)) throw UsageError(std::string("--") + needed + " is missing");
  BagTracking(line).run();
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"track_bag", kUsage, kOptions}, argc, argv, run);
}
