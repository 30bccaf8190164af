#include <ros/time.h>
#include <rosbag/bag.h>
#include <tf2_msgs/TFMessage.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <stdexcept>
#include <string>
#include <vector>

#include "simulator_messages.hpp"

namespace leap_object_tracker {
namespace {

constexpr char kUsage[] =
    "usage: simulate_bag SCENE.yaml OUT.bag [--seed N] [--frames N] [--object FILE.yaml]\n"
    "Writes what a Leap would record of the scene: /leap/{left,right}/image_raw and camera_info, "
    "with\n"
    "the truth: /ground_truth/pose, /ground_truth/NAME/pose of other known objects,\n"
    "/ground_truth/visible (x left, y right: share of the object's visible side that the eye "
    "sees),\n"
    "and /tf if the camera moves.\n";

struct Arguments {
  std::string scene;
  std::string bag;
  SceneOverrides overrides;
};

long wholeNumber(const std::string& option, const std::string& text, long least) {
  std::size_t used = 0;
  long value = 0;
  try {
    value = std::stol(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != text.size() || value < least)
    throw std::invalid_argument(option + " '" + text + "': expected a whole number, at least " +
                                std::to_string(least));
  return value;
}

Arguments parse(const std::vector<std::string>& words) {
  Arguments arguments;
  std::vector<std::string> files;
  for (std::size_t i = 0; i < words.size(); ++i) {
    const std::string& word = words[i];
    if (word.rfind("--", 0) != 0) {
      files.push_back(word);
      continue;
    }
    if (i + 1 == words.size()) throw std::invalid_argument(word + " needs a value");
    const std::string& value = words[++i];
    if (word == "--seed") {
      arguments.overrides.seed = static_cast<std::uint64_t>(wholeNumber(word, value, 0));
      arguments.overrides.has_seed = true;
    } else if (word == "--frames") {
      arguments.overrides.frames = static_cast<int>(wholeNumber(word, value, 1));
    } else if (word == "--object") {
      arguments.overrides.object_path = value;
    } else {
      throw std::invalid_argument("unknown option " + word);
    }
  }
  if (files.size() != 2) throw std::invalid_argument("expected a scene and a bag");
  arguments.scene = files[0];
  arguments.bag = files[1];
  return arguments;
}

void writeFrame(rosbag::Bag& bag, const SimulatedFrame& frame, sensor_msgs::CameraInfo left_info,
                sensor_msgs::CameraInfo right_info, bool camera_moves) {
  const ros::Time stamp = rosTime(frame.raw.stamp);
  left_info.header.stamp = right_info.header.stamp = stamp;
  if (camera_moves) {
    tf2_msgs::TFMessage transforms;
    transforms.transforms.push_back(
        transformMessage(frame.fixed_from_camera, stamp, kFixedFrame, kLeftFrame));
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
  bag.write("/leap/left/image_raw", stamp,
            imageMessage(frame.raw.left, headerOf(stamp, kLeftFrame)));
  bag.write("/leap/right/image_raw", stamp,
            imageMessage(frame.raw.right, headerOf(stamp, kRightFrame)));
}

void run(const Arguments& arguments) {
  const Scene scene = loadScene(arguments.scene, arguments.overrides);
  const FittedCalibration fitted = fitCalibration(scene.unit, scene.mode);
  std::cout << "camera_info fits the lens of " << scene.unit.name << " to " << fitted.left_rms
            << " / " << fitted.right_rms << " px rms (largest " << fitted.left_largest << " / "
            << fitted.right_largest << ") in the central 100 deg, left / right\n";
  const auto left_info = cameraInfoMessage(fitted.calibration, false);
  const auto right_info = cameraInfoMessage(fitted.calibration, true);

  Simulator simulator(scene);
  const std::string unfinished = arguments.bag + ".unfinished";
  rosbag::Bag bag(unfinished, rosbag::bagmode::Write);
  bag.setCompression(rosbag::compression::BZ2);
  const auto begin = std::chrono::steady_clock::now();
  const bool on_terminal = isatty(STDERR_FILENO) != 0;
  int frames = 0;
  while (const auto frame = simulator.next()) {
    writeFrame(bag, *frame, left_info, right_info, simulator.cameraMoves());
    ++frames;
    if (on_terminal) std::fprintf(stderr, "\r%d of %d frames", frames, scene.frames);
  }
  if (on_terminal) std::fprintf(stderr, "\r");
  bag.close();
  std::filesystem::rename(unfinished, arguments.bag);
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  std::cout << arguments.bag << ": " << frames << " frames of " << scene.name << ", seed "
            << scene.seed << ", " << std::filesystem::file_size(arguments.bag) / 1e6 << " MB, "
            << elapsed.count() << " s\n";
}

}  // namespace
}  // namespace leap_object_tracker

int main(int argc, char** argv) {
  using namespace leap_object_tracker;
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() == 1 && (words[0] == "--help" || words[0] == "-h")) {
    std::cout << kUsage;
    return 0;
  }
  Arguments arguments;
  try {
    arguments = parse(words);
  } catch (const std::invalid_argument& error) {
    std::cerr << "simulate_bag: " << error.what() << "\n" << kUsage;
    return 2;
  }
  try {
    run(arguments);
  } catch (const std::exception& error) {
    std::cerr << "simulate_bag: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
