#include <rosbag/bag.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <limits>
#include <stdexcept>
#include <string>

#include "command_line.hpp"
#include "conversions.hpp"
#include "simulator_messages.hpp"

namespace leap_object_tracker {
namespace {

constexpr char kUsage[] = R"(usage: simulate_bag SCENE.yaml OUT.bag [options]

Writes what a Leap would record of a scene (config/scenes): /leap/{left,right}/image_raw and
camera_info, and the truth about it: /ground_truth/pose of the object in the left rectified optical
frame, /ground_truth/NAME/pose of other known objects, /ground_truth/visible (x left, y right: share
of the object's visible side that the eye sees), and /tf if the camera moves.

  --seed N            instead of the scene's
  --frames N          instead of the scene's
  --object FILE.yaml  instead of the scene's
)";

const std::map<std::string, int> kOptions{{"seed", 1}, {"frames", 1}, {"object", 1}};

void writeFrame(rosbag::Bag& bag, const SimulatedFrame& frame, sensor_msgs::CameraInfo left_info,
                sensor_msgs::CameraInfo right_info, bool camera_moves) {
  const ros::Time stamp = timeFrom(frame.raw.stamp);
  left_info.header.stamp = right_info.header.stamp = stamp;
  if (camera_moves) {
    tf2_msgs::TFMessage transforms;
    transforms.transforms.push_back(cameraTransform(frame, stamp));
    bag.write("/tf", stamp, transforms);
  }
  bag.write("/ground_truth/pose", stamp, truthMessage(frame.camera_from_object, stamp));
  for (const auto& other : frame.others)
    if (other.is_object)
      bag.write("/ground_truth/" + other.name + "/pose", stamp,
                truthMessage(other.camera_from_body, stamp));
  bag.write("/ground_truth/visible", stamp, visibilityMessage(frame, stamp));
  bag.write("/leap/left/camera_info", stamp, left_info);
  bag.write("/leap/right/camera_info", stamp, right_info);
  bag.write("/leap/left/image_raw", stamp, simulatedImage(frame.raw.left, stamp, false));
  bag.write("/leap/right/image_raw", stamp, simulatedImage(frame.raw.right, stamp, true));
}

/// All frames of the scene. @return how many
int writeBag(const Scene& scene, const FittedCalibration& fitted, const std::string& path) {
  const auto left_info = simulatedCameraInfo(fitted.calibration, false);
  const auto right_info = simulatedCameraInfo(fitted.calibration, true);
  Simulator simulator(scene);
  rosbag::Bag bag(path, rosbag::bagmode::Write);
  bag.setCompression(rosbag::compression::BZ2);
  const bool on_terminal = isatty(STDERR_FILENO) != 0;
  int frames = 0;
  while (const auto frame = simulator.next()) {
    writeFrame(bag, *frame, left_info, right_info, simulator.cameraMoves());
    ++frames;
    if (on_terminal) std::fprintf(stderr, "\r%d of %d frames", frames, scene.frames);
  }
  if (on_terminal) std::fputs("\r", stderr);
  bag.close();
  return frames;
}

void run(const CommandLine& line) {
  if (line.positional().size() != 2) throw UsageError("expected a scene and a bag");
  const std::string& bag = line.positional()[1];
  SceneOverrides overrides;
  overrides.object_path = line.text("object");
  if (line.has("frames"))
    overrides.frames = static_cast<int>(line.wholeNumber("frames", 1, 1000000));
  if (line.has("seed")) {
    overrides.has_seed = true;
    overrides.seed = static_cast<std::uint64_t>(
        line.wholeNumber("seed", 0, std::numeric_limits<long long>::max()));
  }
  const Scene scene = loadScene(line.positional()[0], overrides);
  const FittedCalibration fitted = fitCalibration(scene.unit, scene.mode);
  std::printf("camera_info fits the lens of %s to %.3f / %.3f px rms in the central 100 deg\n",
              scene.unit.name.c_str(), fitted.left_rms, fitted.right_rms);

  const auto begin = std::chrono::steady_clock::now();
  const std::string unfinished = bag + ".unfinished";
  const int frames = writeBag(scene, fitted, unfinished);
  std::filesystem::rename(unfinished, bag);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  std::printf("%s: %d frames of %s, seed %llu, %.1f MB, %.1f s\n", bag.c_str(), frames,
              scene.name.c_str(), static_cast<unsigned long long>(scene.seed),
              static_cast<double>(std::filesystem::file_size(bag)) / 1e6, elapsed.count());
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  return runProgram({"simulate_bag", kUsage, kOptions}, argc, argv, run);
}
