#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/Vector3Stamped.h>
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <optional>

#include "command_line.hpp"
#include "conversions.hpp"
#include "leap_object_tracker/evaluation/fisher_bound.hpp"
#include "leap_object_tracker/tracking/contour_model.hpp"
#include "stereo_bag.hpp"

namespace leap_object_tracker {
namespace {

constexpr const char* kUsage = R"(usage: fisher_bound BAG --object FILE.yaml [options]

Prints what accuracy the images of a bag allow in one frame (Cramer-Rao bound from the Fisher
information of the object's visible lines in both eyes, at the true poses), and the root mean square
of it over the frames. What other bodies hide counts as seen: a bound from below all the same.

  --sigma PX          noise of a line across itself, in raw pixels (0.3)
  --correlation PX    length of line that is one independent measurement, in raw pixels (3)
  --eyes NAME         both | left | right
  --least-visible S   only frames in which both eyes together see this share of the object (0.5)
  --truth FILE.tum    writes the true poses
  --csv FILE.csv      stamp, depth, visible shares and bounds of every frame
)";

const std::map<std::string, int> kOptions{{"object", 1},       {"sigma", 1}, {"correlation", 1},
                                          {"eyes", 1},         {"csv", 1},   {"truth", 1},
                                          {"least-visible", 1}};

/// A true pose, and the share of the object's side that each eye sees (1 if the bag does not tell).
struct TrueFrame {
  std::uint64_t stamp = 0;  ///< [ns]
  std::optional<Pose> camera_from_object;
  double left_visible = 1, right_visible = 1;
};

/// In one walk through the bag.
std::vector<TrueFrame> readTruth(const std::string& path) {
  std::map<std::uint64_t, TrueFrame> frames;
  rosbag::Bag bag(path, rosbag::bagmode::Read);
  const std::vector<std::string> topics{"/ground_truth/pose", "/ground_truth/visible"};
  for (const auto& entry : rosbag::View(bag, rosbag::TopicQuery(topics))) {
    if (const auto pose = entry.instantiate<geometry_msgs::PoseStamped>())
      frames[pose->header.stamp.toNSec()].camera_from_object = poseFrom(pose->pose);
    if (const auto visible = entry.instantiate<geometry_msgs::Vector3Stamped>()) {
      TrueFrame& frame = frames[visible->header.stamp.toNSec()];
      frame.left_visible = visible->vector.x;
      frame.right_visible = visible->vector.y;
    }
  }
  std::vector<TrueFrame> truth;
  for (auto& [stamp, frame] : frames) {
    frame.stamp = stamp;
    if (frame.camera_from_object) truth.push_back(frame);
  }
  if (truth.empty()) throw std::runtime_error("bag '" + path + "': has no /ground_truth/pose");
  return truth;
}

/// Lines that an eye sees at a pose.
std::vector<LineElement> visibleLines(const ContourModel& model, const Eigen::Vector3d& eye_place,
                                      const Pose& camera_from_object) {
  const Eigen::Vector3d eye_in_object = camera_from_object.inverse() * eye_place;
  const std::optional<ContourView> exact = model.exactView(eye_in_object);
  const ViewChoice choice =
      exact ? ViewChoice{&*exact, 1, 0} : model.choose(eye_in_object.cast<float>());
  std::vector<LineElement> lines;
  if (choice.view == nullptr) return lines;
  const Eigen::Matrix3d turn = rotationFromVector({0, 0, std::atan2(choice.sine, choice.cosine)});
  for (const ContourPoint& point : choice.view->points)
    lines.push_back({turn * point.position.cast<double>(), turn * point.tangent.cast<double>(),
                     static_cast<double>(point.length)});
  return lines;
}

void run(const CommandLine& line) {
  if (line.positional().size() != 1) throw UsageError("expected one BAG");
  if (!line.has("object")) throw UsageError("--object is missing");
  EdgeNoise noise;
  if (line.has("sigma")) noise.sigma = line.number("sigma", 0, 1e-3, 100);
  if (line.has("correlation")) noise.correlation_length = line.number("correlation", 0, 1e-3, 1000);
  const double least_visible =
      line.has("least-visible") ? line.number("least-visible", 0, 0, 1) : 0.5;
  const std::string eyes = line.text("eyes", "both");
  if (eyes != "both" && eyes != "left" && eyes != "right")
    throw UsageError("--eyes '" + eyes + "' must be both, left or right");

  const std::string& path = line.positional().front();
  const ObjectModel object = loadObject(line.text("object"));
  const ContourModel model(object, 96);
  const StereoBag bag(path, {}, Eyes::kBoth);
  const std::vector<TrueFrame> truth = readTruth(path);

  std::ofstream csv;
  if (line.has("csv")) {
    csv = createFile(line.text("csv"));
    csv << "stamp,depth_mm,left_visible,right_visible,position_bound_mm,orientation_bound_deg\n"
        << std::fixed;
  }
  if (line.has("truth")) {
    Trajectory trajectory;
    for (const TrueFrame& frame : truth)
      trajectory.push_back(
          {Stamp(std::chrono::nanoseconds(frame.stamp)), *frame.camera_from_object, {}});
    writeTum(line.text("truth"), trajectory);
  }
  double position = 0, orientation = 0;
  int frames = 0;
  for (const TrueFrame& frame : truth) {
    const Pose& pose = *frame.camera_from_object;
    Matrix6d information = Matrix6d::Zero();
    for (const int eye : {0, 1}) {
      if (eyes == (eye == 0 ? "right" : "left")) continue;
      const Eigen::Vector3d place(eye == 0 ? 0 : bag.calibration().baseline, 0, 0);
      information +=
          lineInformation(bag.calibration(), eye, pose, visibleLines(model, place, pose), noise);
    }
    const auto bound = boundFrom(information, pose, object.symmetry);
    if (csv.is_open()) {
      csv << std::setprecision(9) << 1e-9 * static_cast<double>(frame.stamp) << std::setprecision(4)
          << ',' << 1e3 * pose.translation().z() << ',' << frame.left_visible << ','
          << frame.right_visible << ',';
      if (bound) csv << 1e3 * bound->position << ',' << 180 / M_PI * bound->orientation;
      csv << (bound ? "\n" : ",\n");
    }
    if (!bound || (frame.left_visible + frame.right_visible) / 2 < least_visible) continue;
    ++frames;
    position += bound->position * bound->position;
    orientation += bound->orientation * bound->orientation;
  }
  if (frames == 0) throw std::runtime_error("bag '" + path + "': no frame shows enough");
  std::printf("frames                      %d of %zu\n", frames, truth.size());
  std::printf("position bound RMS [mm]     %.3f\n", 1e3 * std::sqrt(position / frames));
  std::printf("orientation bound RMS [deg] %.3f\n", 180 / M_PI * std::sqrt(orientation / frames));
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"fisher_bound", kUsage, kOptions}, argc, argv, run);
}
