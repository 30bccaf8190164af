#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iostream>

#include "command_line.hpp"
#include "leap_object_tracker/evaluation/trajectory.hpp"
#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/contour_measurement.hpp"
#include "leap_object_tracker/tracking/tracker.hpp"
#include "object_region.hpp"
#include "parameters.hpp"
#include "stereo_bag.hpp"

namespace leap_object_tracker {
namespace {

constexpr const char* kUsage =
    R"(usage: particle_table BAG --object FILE.yaml --out FOLDER [options]

Tracks an object from its true start pose and writes what the particles do:
  poses.tum                            the estimates
  particles.csv                        for each pair: stamp, spread of the particles, support
  weights_first.csv, weights_last.csv  histogram of the particles' weights, share of the largest
  cloud_first.csv, cloud_last.csv      places of some particles [mm]

  --particles N  (default: 100000)
  --threads N, --seed N
)";

const std::map<std::string, int> kOptions{
    {"object", 1}, {"out", 1}, {"particles", 1}, {"threads", 1}, {"seed", 1}};

constexpr int kMargin = 40;  // [px] around the object, where edges are looked for
constexpr int kBins = 50;
constexpr int kShown = 2000;  // particles in a cloud

/// Root mean square distance [m] and angle [rad] from the estimate.
struct Spread {
  double position = 0;
  double rotation = 0;
};

Spread spreadOf(const std::vector<Pose>& particles, const Pose& center) {
  Spread spread;
  for (const auto& particle : particles) {
    spread.position += (particle.translation() - center.translation()).squaredNorm();
    spread.rotation += std::pow(angleBetween(particle.linear(), center.linear()), 2);
  }
  const auto count = static_cast<double>(particles.size());
  return {std::sqrt(spread.position / count), std::sqrt(spread.rotation / count)};
}

class ParticleTable {
 public:
  explicit ParticleTable(const CommandLine& line)
      : folder_(line.text("out")),
        object_(loadObject(line.text("object"))),
        bag_(line.positional().front(), StereoBagTopics(), Eyes::kBoth),
        truth_(bag_.truth()),
        params_(readParams(line)),
        rectifier_(bag_.calibration(), rectifiedCamera(bag_.calibration(), {})),
        tracker_(params_, object_, rectifier_.camera()),
        contours_(object_, params_.contour.points, params_.contour.edge_radius,
                  params_.contour.cache_folder),
        measurement_(params_.contour, params_.eyes, rectifier_.camera()) {
    if (truth_.empty()) throw std::runtime_error("the bag has no true poses to start from");
    std::filesystem::create_directories(folder_);
    particles_ = createFile(folder_ / "particles.csv");
    particles_ << "stamp,spread_mm,spread_deg,effective_share,support\n";
  }

  void run() {
    tracker_.start(truth_.front().camera_from_object);
    bag_.forEachPair([this](const RawStereoFrame& raw) { track(raw); });
    if (!last_) throw std::runtime_error("the tracker found no pose in any pair of the bag");
    writeFrame(*last_, "last");
    writeTum((folder_ / "poses.tum").string(), poses_);
    std::cout << poses_.size() << " poses, written to " << folder_.string() << '\n';
  }

 private:
  /// A frame and the particles after it.
  struct Moment {
    RectifiedStereoFrame frame;
    Pose estimate;
    std::vector<Pose> particles;
  };

  static TrackerParams readParams(const CommandLine& line) {
    TrackerParams params;
    params.measurement = Measurement::kContour;
    params.filter.particles = 100000;
    readFilterOptions(line, params);
    return params;
  }

  void track(const RawStereoFrame& raw) {
    if (raw.stamp + std::chrono::milliseconds(1) < truth_.front().stamp) return;
    const RectifiedStereoFrame frame = rectifier_.rectify(raw);
    const auto estimate = tracker_.track(frame);
    if (!estimate) return;
    poses_.push_back({estimate->stamp, estimate->camera_from_object, {}});
    const Moment moment{frame, estimate->camera_from_object, tracker_.particles()};
    const Spread spread = spreadOf(moment.particles, moment.estimate);
    char line[160];
    std::snprintf(line, sizeof line, "%.9f,%.4f,%.4f,%.4f,%.4f\n", seconds(raw.stamp),
                  1e3 * spread.position, 180 / M_PI * spread.rotation,
                  tracker_.report().effective_share, tracker_.report().support);
    particles_ << line;
    if (!last_) writeFrame(moment, "first");
    last_ = moment;
  }

  void writeFrame(const Moment& moment, const std::string& name) {
    std::ofstream weights = createFile(folder_ / ("weights_" + name + ".csv"));
    weights << "log weight below the largest [nats],particles\n";
    const std::vector<int> counts = histogramOfWeights(moment);
    for (int bin = 0; bin < kBins; ++bin)
      weights << bin + 0.5 - kBins << ',' << counts[static_cast<std::size_t>(bin)] << '\n';
    std::ofstream cloud = createFile(folder_ / ("cloud_" + name + ".csv"));
    cloud << "x_mm,y_mm,z_mm\n";
    const std::size_t step = std::max<std::size_t>(1, moment.particles.size() / kShown);
    for (std::size_t i = 0; i < moment.particles.size(); i += step) {
      const Eigen::Vector3d place = 1e3 * moment.particles[i].translation();
      cloud << place.x() << ',' << place.y() << ',' << place.z() << '\n';
    }
  }

  /// Log weights by the sharp contour likelihood of both eyes, below the largest in bins of one
  /// nat; the first bin holds all that is smaller.
  std::vector<int> histogramOfWeights(const Moment& moment) {
    measurement_.observe(
        moment.frame, objectRegions(object_.mesh, moment.estimate, rectifier_.camera(), kMargin));
    std::vector<ParticlePose> poses;
    for (const auto& particle : moment.particles) poses.push_back(toParticlePose(particle));
    std::vector<float> scores(poses.size());
    measurement_.score(contours_, ContourMeasurement::Sharpness::kSharp, poses.data(), poses.size(),
                       scores.data());
    const float best = *std::max_element(scores.begin(), scores.end());
    std::vector<int> counts(kBins, 0);
    for (const float score : scores)
      ++counts[static_cast<std::size_t>(
          std::clamp(kBins - 1 + static_cast<int>(score - best), 0, kBins - 1))];
    return counts;
  }

  std::filesystem::path folder_;
  ObjectModel object_;
  StereoBag bag_;
  Trajectory truth_;
  TrackerParams params_;
  StereoRectifier rectifier_;
  Tracker tracker_;
  ContourModel contours_;
  ContourMeasurement measurement_;
  std::ofstream particles_;
  Trajectory poses_;
  std::optional<Moment> last_;
};

void run(const CommandLine& line) {
  if (line.positional().size() != 1) throw UsageError("expected one BAG");
  for (const char* needed : {"object", "out"})
    if (!line.has(needed)) throw UsageError(std::string("--") + needed + " is missing");
  ParticleTable(line).run();
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"particle_table", kUsage, kOptions}, argc, argv, run);
}
