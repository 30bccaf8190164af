// Plugs an emulated Leap into a nodelet manager from outside. Goes into LD_PRELOAD of a launch
// file, before libumockdev-preload; acts in processes named "nodelet" with the argument "manager".
//   LEAP_EMULATED_SCENE   scene file that the Leap looks at
//   LEAP_EMULATED_STATIC  1: nothing moves
//   LEAP_EMULATED_RATE    share of the nominal rate
//   LEAP_EMULATED_FRAMES  above 0: so many pictures are made before, then shown to and fro
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "emulated_leap_bus.hpp"
#include "emulated_leap_picture.hpp"

namespace leap_object_tracker {
namespace {

/// Everything lives until the process ends; its threads may still run then.
struct Emulation {
  std::unique_ptr<SimulatedPicture> picture;
  std::vector<Bytes> pictures;
  EmulatedLeap leap;
  EmulatedBus bus;
};

bool isWanted() {
  std::ifstream file("/proc/self/cmdline");
  std::vector<std::string> words;
  for (std::string word; std::getline(file, word, '\0');) words.push_back(word);
  if (const char* wanted = std::getenv("LEAP_EMULATED_IN"))
    return std::strcmp(program_invocation_short_name, wanted) == 0;
  return words.size() > 1 && std::strcmp(program_invocation_short_name, "nodelet") == 0 &&
         words[1] == "manager";
}

double number(const char* variable, double otherwise) {
  const char* text = std::getenv(variable);
  return text ? std::atof(text) : otherwise;
}

Scene sceneToShow(const char* path) {
  Scene scene = loadScene(path);
  scene.sensor.auto_exposure = false;
  if (number("LEAP_EMULATED_STATIC", 0) > 0) {
    scene.bodies.front().motion.sweeps.clear();
    scene.bodies.front().motion.wobbles.clear();
  }
  return scene;
}

void prepare(Emulation& emulation, const Scene& scene, std::size_t count) {
  Simulator simulator(scene);
  while (emulation.pictures.size() < count) {
    const auto seen = simulator.next();
    if (!seen) break;
    Bytes raster(2 * seen->raw.left.total());
    for (std::size_t i = 0; i < raster.size() / 2; ++i) {
      raster[2 * i] = seen->raw.left.data[i];
      raster[2 * i + 1] = seen->raw.right.data[i];
    }
    emulation.pictures.push_back(std::move(raster));
  }
  emulation.leap.setPicture([&emulation](const EmulatedLeap::Frame& frame, std::uint8_t* out) {
    const std::size_t last = emulation.pictures.size() - 1;
    const std::size_t at = last == 0 ? 0 : frame.index % (2 * last);
    const Bytes& raster = emulation.pictures[at <= last ? at : 2 * last - at];
    std::copy(raster.begin(), raster.end(), out);
  });
}

__attribute__((constructor)) void plugEmulatedLeap() {
  const char* path = std::getenv("LEAP_EMULATED_SCENE");
  if (!path || !isWanted()) return;
  const Scene scene = sceneToShow(path);
  auto* emulation = new Emulation;
  const auto pictures = static_cast<std::size_t>(number("LEAP_EMULATED_FRAMES", 0));
  if (pictures > 0) {
    prepare(*emulation, scene, pictures);
  } else {
    emulation->picture = std::make_unique<SimulatedPicture>(scene);
    emulation->leap.setPicture(emulation->picture->picture());
  }
  emulation->leap.setRate(number("LEAP_EMULATED_RATE", 0.979));
  emulation->bus.port(1).plug(emulation->leap);
}

}  // namespace
}  // namespace leap_object_tracker
