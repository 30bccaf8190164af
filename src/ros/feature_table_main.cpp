#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "command_line.hpp"
#include "leap_object_tracker/evaluation/trajectory_error.hpp"
#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/feature_measurement.hpp"
#include "object_region.hpp"
#include "stereo_bag.hpp"

namespace leap_object_tracker {
namespace {

constexpr const char* kUsage = R"(usage: feature_table BAG --object FILE.yaml [options]

Counts what the two corner detectors find on an object, in every pair of a bag with true poses:
corners (mean of both eyes), good matches, and points in space, each as the mean over the pairs.

  --csv FILE.csv     the means, one line for each detector
  --frames FILE.csv  the counts of every pair: stamp, and each count of FAST and of SURF
)";

const std::map<std::string, int> kOptions{{"object", 1}, {"csv", 1}, {"frames", 1}};

constexpr int kMargin = 8;            // [px] around the object
constexpr double kOnSurface = 0.002;  // [m] from the true surface
constexpr double kReach = 0.004;      // [m] of the window of depths, beyond the object

using Clock = std::chrono::steady_clock;

/// What one detector found in one pair.
struct Count {
  double corners = 0, matches = 0, features = 0, on_object = 0, milliseconds = 0;
};

class DetectorCounter {
 public:
  DetectorCounter(const ObjectModel& object, const RectifiedStereoCamera& camera,
                  CornerDetector detector)
      : object_(object),
        camera_(camera),
        distance_(object),
        extractor_(FeatureParams(), camera, detector) {}

  Count count(const RectifiedStereoFrame& frame, const Pose& camera_from_object) {
    FeatureWindow window;
    window.regions = objectRegions(object_.mesh, camera_from_object, camera_, kMargin);
    const double reach = radiusOf(object_.mesh) + kReach;
    window.nearest = std::max(0.02, camera_from_object.translation().z() - reach);
    window.farthest = camera_from_object.translation().z() + reach;
    const auto begin = Clock::now();
    const auto& features = extractor_.extract(frame, window);
    Count result;
    result.milliseconds = 1e3 * std::chrono::duration<double>(Clock::now() - begin).count();
    const auto& counts = extractor_.counts();
    result.corners = 0.5 * (counts.left_corners + counts.right_corners);
    result.matches = counts.matches;
    result.features = counts.features;
    const Pose object_from_camera = camera_from_object.inverse();
    for (const auto& feature : features)
      if (std::abs(distance_((object_from_camera * feature.point_in_camera).cast<float>())) <
          kOnSurface)
        result.on_object += 1;
    return result;
  }

 private:
  const ObjectModel& object_;
  const RectifiedStereoCamera& camera_;
  SignedDistance distance_;
  FeatureExtractor extractor_;
};

double meanOf(const std::vector<Count>& counts, double Count::*member) {
  double sum = 0;
  for (const auto& count : counts) sum += count.*member;
  return sum / static_cast<double>(counts.size());
}

void print(std::ostream& out, const std::string& bag, const char* detector,
           const std::vector<Count>& counts) {
  out << bag << ',' << detector;
  for (const auto member : {&Count::corners, &Count::matches, &Count::features, &Count::on_object,
                            &Count::milliseconds})
    out << ',' << std::round(100 * meanOf(counts, member)) / 100;
  out << '\n';
}

void run(const CommandLine& line) {
  if (line.positional().size() != 1) throw UsageError("expected one BAG");
  if (!line.has("object")) throw UsageError("--object is missing");
  const ObjectModel object = loadObject(line.text("object"));
  const StereoBag bag(line.positional().front(), StereoBagTopics(), Eyes::kBoth);
  const Trajectory truth = bag.truth();
  if (truth.empty()) throw std::runtime_error("the bag has no true poses to look at the object");
  const StereoRectifier rectifier(bag.calibration(), rectifiedCamera(bag.calibration(), {}));
  DetectorCounter fast(object, rectifier.camera(), CornerDetector::kFast);
  DetectorCounter surf(object, rectifier.camera(), CornerDetector::kSurf);
  std::vector<Count> of_fast, of_surf;
  std::ofstream frames;
  if (line.has("frames")) {
    frames = createFile(line.text("frames"));
    frames << "stamp,fast_corners,fast_matches,fast_points,surf_corners,surf_matches,surf_points\n";
  }
  bag.forEachPair([&](const RawStereoFrame& raw) {
    using namespace std::chrono_literals;
    const auto pose = poseAt(truth, raw.stamp, 1ms, 100ms);
    if (!pose) return;
    const RectifiedStereoFrame frame = rectifier.rectify(raw);
    of_fast.push_back(fast.count(frame, *pose));
    of_surf.push_back(surf.count(frame, *pose));
    if (!frames.is_open()) return;
    char stamp[32];
    std::snprintf(stamp, sizeof stamp, "%.9f", seconds(raw.stamp));
    frames << stamp;
    for (const auto* count : {&of_fast.back(), &of_surf.back()})
      frames << ',' << count->corners << ',' << count->matches << ',' << count->on_object;
    frames << '\n';
  });
  if (of_fast.empty()) throw std::runtime_error("no pair of the bag has a true pose");
  const std::string name = std::filesystem::path(line.positional().front()).stem().string();
  std::ofstream csv;
  if (line.has("csv")) csv = createFile(line.text("csv"));
  for (std::ostream* out :
       {static_cast<std::ostream*>(&std::cout), static_cast<std::ostream*>(&csv)}) {
    if (out == &csv && !csv.is_open()) continue;
    *out << "bag,detector,corners,matches,points,points_on_object,ms\n";
    print(*out, name, "FAST", of_fast);
    print(*out, name, "SURF", of_surf);
  }
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"feature_table", kUsage, kOptions}, argc, argv, run);
}
