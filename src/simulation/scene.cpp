#include "leap_object_tracker/simulation/scene.hpp"

#include <filesystem>
#include <map>
#include <stdexcept>

#include "leap_object_tracker/simulation/hash_random.hpp"
#include "yaml_section.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kDeepestBase = 8;

std::string absolutePath(const std::string& base_file, const std::string& path) {
  const std::filesystem::path folder = std::filesystem::path(base_file).parent_path();
  return std::filesystem::absolute(folder / path).lexically_normal().string();
}

void makeAbsolute(YAML::Node map, const std::string& key, const std::string& file) {
  if (map.IsMap() && map[key] && map[key].IsScalar())
    map[key] = absolutePath(file, map[key].as<std::string>());
}

/// Keys of `above` replace those of `below`; maps are joined key by key.
YAML::Node merged(const YAML::Node& below, const YAML::Node& above) {
  if (!below || !below.IsMap() || !above.IsMap()) return YAML::Clone(above);
  YAML::Node result = YAML::Clone(below);
  for (const auto& entry : above) {
    const auto key = entry.first.as<std::string>();
    result[key] = merged(below[key], entry.second);
  }
  return result;
}

/// A scene file with what it is based on, all paths absolute.
YAML::Node loadTree(const std::string& path, int depth = 0) {
  YAML::Node root = loadYaml(path, "scene file");
  if (!root.IsMap()) throw std::runtime_error("scene file '" + path + "': must be a map of keys");
  makeAbsolute(root, "calibration", path);
  if (root["object"]) makeAbsolute(root["object"], "file", path);
  if (root["bodies"] && root["bodies"].IsSequence())
    for (auto body : root["bodies"]) makeAbsolute(body, "file", path);
  if (!root["based_on"]) return root;
  if (!root["based_on"].IsScalar())
    throw std::runtime_error("scene file '" + path +
                             "', key 'based_on': expected the path of a scene file");
  if (depth >= kDeepestBase)
    throw std::runtime_error("scene file '" + path +
                             "', key 'based_on': the files go round in a ring");
  const YAML::Node base =
      loadTree(absolutePath(path, root["based_on"].as<std::string>()), depth + 1);
  root.remove("based_on");
  return merged(base, root);
}

template <class T>
T chosen(YamlSection& section, const std::string& key, const std::map<std::string, T>& choices,
         T fallback) {
  if (!section.has(key)) {
    section.take(key);
    return fallback;
  }
  std::string list;
  for (const auto& choice : choices) list += (list.empty() ? "" : ", ") + choice.first;
  std::string word;
  section.read(key, word, list);
  const auto found = choices.find(word);
  if (found == choices.end()) section.complain(key, "is '" + word + "'; expected one of " + list);
  return found->second;
}

double radians(double degrees) { return degrees * M_PI / 180; }

/// Turns about the axes of the parent, x first.
Eigen::Quaterniond turnFromDegrees(const Eigen::Vector3d& degrees) {
  return Eigen::AngleAxisd(radians(degrees.z()), Eigen::Vector3d::UnitZ()) *
         Eigen::AngleAxisd(radians(degrees.y()), Eigen::Vector3d::UnitY()) *
         Eigen::AngleAxisd(radians(degrees.x()), Eigen::Vector3d::UnitX());
}

std::vector<YAML::Node> listOf(YamlSection& section, const std::string& key) {
  std::vector<YAML::Node> result;
  const YAML::Node node = section.take(key);
  if (!node) return result;
  if (node.IsMap()) return {node};
  if (!node.IsSequence()) section.complain(key, "must be a map or a list of maps");
  for (const auto& entry : node) result.push_back(entry);
  return result;
}

std::string entryPlace(const YamlSection& section, const std::string& key, std::size_t index) {
  return section.place() + ", '" + key + "' number " + std::to_string(index + 1);
}

MotionScript readMotion(YamlSection section, std::uint64_t seed) {
  MotionScript motion;
  Eigen::Vector3d position = Eigen::Vector3d::Zero(), degrees = Eigen::Vector3d::Zero();
  bool upright = false;
  section.readVector("position", position, 10, "m");
  section.readVector("orientation_deg", degrees, 360, "deg");
  section.read("upright", upright, "true or false");
  // Upright: the body's z points up in the image and its y away from the camera.
  const Eigen::Quaterniond base =
      upright ? turnFromDegrees({90, 0, 0}) : turnFromDegrees({0, 0, 0});
  motion.rest.translation() = position;
  motion.rest.linear() = (turnFromDegrees(degrees) * base).toRotationMatrix();

  const auto sweeps = listOf(section, "sweep");
  for (std::size_t i = 0; i < sweeps.size(); ++i) {
    YamlSection entry(sweeps[i], entryPlace(section, "sweep", i));
    MotionScript::Sweep sweep;
    sweep.axis = chosen<int>(entry, "axis", {{"x", 0}, {"y", 1}, {"z", 2}}, 0);
    std::vector<double> range;
    entry.require("range", range, "[low, high] in metres from the rest pose");
    if (range.size() != 2 || !(range[0] <= 0) || !(range[1] >= 0) || !(range[1] - range[0] <= 10))
      entry.complain("range", "expected [low, high] in metres with low <= 0 <= high");
    sweep.low = range[0];
    sweep.high = range[1];
    entry.readNumber("period", sweep.period, 0.05, 1000, "s");
    entry.finish();
    motion.sweeps.push_back(sweep);
  }

  const auto wobbles = listOf(section, "wobble");
  for (std::size_t i = 0; i < wobbles.size(); ++i) {
    YamlSection entry(wobbles[i], entryPlace(section, "wobble", i));
    MotionScript::Wobble wobble;
    Eigen::Vector3d wobble_degrees = Eigen::Vector3d::Zero();
    entry.readVector("amplitude", wobble.amplitude, 10, "m");
    entry.readVector("amplitude_deg", wobble_degrees, 180, "deg");
    entry.readNumber("period", wobble.period, 0.05, 1000, "s");
    entry.finish();
    wobble.angular_amplitude = wobble_degrees * (M_PI / 180);
    HashRandom random(seed, i);
    for (double& phase : wobble.phases) phase = random.uniform(0, 2 * M_PI);
    motion.wobbles.push_back(wobble);
  }

  const auto keyframes = listOf(section, "keyframes");
  for (std::size_t i = 0; i < keyframes.size(); ++i) {
    YamlSection entry(keyframes[i], entryPlace(section, "keyframes", i));
    MotionScript::Keyframe keyframe;
    Eigen::Vector3d turn = Eigen::Vector3d::Zero();
    if (!entry.has("t")) entry.complain("t", "is missing; expected a time [s]");
    entry.readNumber("t", keyframe.time, -1000, 1000, "s");
    entry.readVector("offset", keyframe.offset, 10, "m");
    entry.readVector("turn_deg", turn, 360, "deg");
    entry.finish();
    keyframe.turn = turnFromDegrees(turn);
    if (!motion.keyframes.empty() && !(motion.keyframes.back().time < keyframe.time))
      entry.complain("t", "must be later than that of the keyframe before");
    motion.keyframes.push_back(keyframe);
  }

  Eigen::Vector3d spin = Eigen::Vector3d::Zero();
  section.readVector("spin_deg", spin, 3600, "deg/s");
  motion.spin = spin * (M_PI / 180);
  section.finish();
  return motion;
}

Paint readPaint(YamlSection section, std::uint64_t seed) {
  Paint paint;
  paint.kind = chosen<PaintKind>(section, "kind",
                                 {{"plain", PaintKind::kPlain},
                                  {"checker", PaintKind::kChecker},
                                  {"stripes", PaintKind::kStripes},
                                  {"noise", PaintKind::kNoise},
                                  {"blobs", PaintKind::kBlobs}},
                                 paint.kind);
  const std::string expected = "[low, high], each from 0 to 1";
  std::vector<double> albedo{paint.albedo_low, paint.albedo_high};
  section.read("albedo", albedo, expected);
  if (albedo.size() != 2 || !(albedo[0] >= 0) || !(albedo[0] <= albedo[1]) || !(albedo[1] <= 1))
    section.complain("albedo", "expected " + expected);
  paint.albedo_low = albedo[0];
  paint.albedo_high = albedo[1];
  section.readNumber("scale", paint.scale, 1e-4, 10, "m");
  section.readNumber("grain", paint.grain, 0, 1, "");
  section.readNumber("gloss", paint.gloss, 0, 1, "");
  section.readNumber("shininess", paint.shininess, 1, 1000, "");
  section.finish();
  paint.seed = seed;
  return paint;
}

/// Keys that the object and all other bodies share.
void readLook(YamlSection& section, SceneBody& body, std::uint64_t seed) {
  if (section.has("paint"))
    body.paint = readPaint(section.section("paint"), mixed(seed, 1));
  else
    body.paint.seed = mixed(seed, 1);
  if (section.has("motion")) body.motion = readMotion(section.section("motion"), mixed(seed, 2));
  double millimetres = body.edge_radius * 1e3;
  section.readNumber("edge_radius_mm", millimetres, 0, 5, "mm");
  body.edge_radius = millimetres * 1e-3;
}

Mesh readInlineShape(YamlSection& section) {
  const auto shape = chosen<Shape>(
      section, "shape",
      {{"box", Shape::kBox}, {"cylinder", Shape::kCylinder}, {"prism", Shape::kPrism}},
      Shape::kBox);
  const std::string expected = shape == Shape::kBox        ? "[x, y, z] in metres"
                               : shape == Shape::kCylinder ? "[radius, height] in metres"
                                                           : "[side, height] in metres";
  std::vector<double> numbers;
  section.require("size", numbers, expected);
  if (numbers.size() != (shape == Shape::kBox ? 3U : 2U))
    section.complain("size", "expected " + expected);
  Eigen::Vector3d size = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!(numbers[i] > 0 && numbers[i] <= 10))
      section.complain("size", "expected lengths above 0 and at most 10 m: " + expected);
    size[static_cast<Eigen::Index>(i)] = numbers[i];
  }
  return makePrimitive("", shape, size).mesh;
}

SceneBody readBody(YamlSection section, std::uint64_t seed) {
  SceneBody body;
  section.require("name", body.name, "a word");
  if (section.has("file")) {
    std::string path;
    section.read("file", path, "the path of an object file");
    body.mesh = loadObject(path).mesh;
    body.is_object = true;
  } else {
    body.mesh = readInlineShape(section);
  }
  body.parent = chosen<SceneBody::Parent>(
      section, "attached_to",
      {{"scene", SceneBody::Parent::kScene}, {"object", SceneBody::Parent::kObject}},
      SceneBody::Parent::kScene);
  readLook(section, body, seed);
  section.finish();
  return body;
}

void readLight(YamlSection section, Scene& scene) {
  section.readNumber("power", scene.light.power, 0, 1, "counts/us at 1 m");
  section.readNumber("ambient", scene.light.ambient, 0, 10, "counts/us");
  section.readNumber("lobe_exponent", scene.light.lobe_exponent, 0, 20, "");
  std::vector<bool> leds{true, true, true};
  section.read("leds", leds, "[left, centre, right], true or false");
  if (leds.size() != 3) section.complain("leds", "expected three of true or false");
  for (std::size_t i = 0; i < 3; ++i) scene.controls.leds[i] = leds[i];
  section.finish();
}

void readSensor(YamlSection section, Scene& scene) {
  SensorParams& sensor = scene.sensor;
  SensorControls& controls = scene.controls;
  section.readNumber("exposure_us", controls.exposure_us, 10, 65535, "us");
  section.readInteger("gain", controls.gain, 16, 63);
  section.readInteger("digital_gain", controls.digital_gain, 4, 15);
  section.read("gamma", controls.gamma, "true or false");
  section.readInteger("dark_interval", controls.dark_interval, 0, 127);
  section.read("auto_exposure", sensor.auto_exposure, "true or false");
  section.readNumber("pulse_limit_us", sensor.pulse_limit_us, 10, 65535, "us");
  section.readNumber("full_well", sensor.full_well, 100, 1e9, "electrons");
  section.readNumber("read_noise", sensor.read_noise, 0, 50, "counts");
  section.readNumber("fixed_noise", sensor.fixed_noise, 0, 50, "counts");
  section.readNumber("dark_offset", sensor.dark_offset, 0, 100, "counts");
  section.readNumber("lens_blur", sensor.lens_blur, 0, 5, "px");
  section.readNumber("vignetting", sensor.vignetting, 0, 10, "");
  section.readNumber("glow", sensor.glow, 0, 10, "counts/us");
  section.finish();
}

}  // namespace

Scene loadScene(const std::string& path, const SceneOverrides& overrides) {
  YamlSection file(loadTree(path), "scene file '" + path + "'");
  Scene scene;
  scene.name = std::filesystem::path(path).stem().string();
  file.take("description");
  int seed = 1;
  file.readInteger("seed", seed, 0, 1000000000);
  scene.seed = overrides.has_seed ? overrides.seed : static_cast<std::uint64_t>(seed);
  file.readInteger("frames", scene.frames, 1, 1000000);
  if (overrides.frames > 0) scene.frames = overrides.frames;
  file.readInteger("samples", scene.samples, 1, 4096);

  std::string calibration, mode = "640x240";
  file.require("calibration", calibration, "the path of a calibration file");
  scene.unit = loadLeapUnit(calibration);
  file.read("mode", mode, "WIDTHxHEIGHT");
  try {
    scene.mode = sensorMode(mode);
  } catch (const std::runtime_error& error) {
    file.complain("mode", error.what());
  }
  scene.timing = chosen<FrameTiming>(
      file, "timing", {{"steady", FrameTiming::kSteady}, {"thesis", FrameTiming::kThesis}},
      FrameTiming::kSteady);
  if (file.has("light")) readLight(file.section("light"), scene);
  if (file.has("sensor")) readSensor(file.section("sensor"), scene);

  YamlSection object = file.section("object");
  object.require("file", scene.object_path, "the path of an object file");
  if (!overrides.object_path.empty()) scene.object_path = overrides.object_path;
  scene.object = loadObject(scene.object_path);
  SceneBody target;
  target.name = scene.object.name;
  target.mesh = scene.object.mesh;
  target.is_object = true;
  readLook(object, target, mixed(scene.seed, 100));
  object.finish();
  scene.bodies.push_back(target);

  const auto bodies = listOf(file, "bodies");
  for (std::size_t i = 0; i < bodies.size(); ++i)
    scene.bodies.push_back(readBody(YamlSection(bodies[i], entryPlace(file, "bodies", i)),
                                    mixed(scene.seed, 101 + i)));
  if (file.has("camera_motion"))
    scene.camera_motion = readMotion(file.section("camera_motion"), mixed(scene.seed, 7));
  file.finish();
  return scene;
}

}  // namespace leap_object_tracker
