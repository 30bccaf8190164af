#include "parameters.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

namespace leap_object_tracker {
namespace {

const std::vector<std::pair<std::string, Eyes>> kEyes{
    {"both", Eyes::kBoth}, {"left", Eyes::kLeft}, {"right", Eyes::kRight}};

const std::vector<std::pair<std::string, Measurement>> kMeasurements{
    {"auto", Measurement::kAuto},
    {"contour", Measurement::kContour},
    {"feature", Measurement::kFeature},
    {"both", Measurement::kBoth}};

std::string printed(double value) {
  std::ostringstream text;
  text << value;
  return text.str();
}

std::string printed(const Range& range) {
  return printed(range.low) + " to " + printed(range.high);
}

/// Where the user's programs keep what they can compute again; empty if there is no such place.
std::string usersCacheFolder() {
  const char* const cache = std::getenv("XDG_CACHE_HOME");
  const char* const home = std::getenv("HOME");
  if (cache != nullptr && *cache == '/') return std::string(cache) + "/leap_object_tracker";
  if (home != nullptr && *home == '/') return std::string(home) + "/.cache/leap_object_tracker";
  return "";
}

YAML::Node treeFrom(XmlRpc::XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return YAML::Node(static_cast<bool>(value));
    case XmlRpc::XmlRpcValue::TypeInt:
      return YAML::Node(static_cast<int>(value));
    case XmlRpc::XmlRpcValue::TypeDouble:
      return YAML::Node(static_cast<double>(value));
    case XmlRpc::XmlRpcValue::TypeString:
      return YAML::Node(static_cast<std::string>(value));
    case XmlRpc::XmlRpcValue::TypeArray: {
      YAML::Node list(YAML::NodeType::Sequence);
      for (int i = 0; i < value.size(); ++i) list.push_back(treeFrom(value[i]));
      return list;
    }
    case XmlRpc::XmlRpcValue::TypeStruct: {
      YAML::Node map(YAML::NodeType::Map);
      for (auto& entry : value) map[entry.first] = treeFrom(entry.second);
      return map;
    }
    default:
      return YAML::Node();
  }
}

}  // namespace

ParameterReader::ParameterReader(const YAML::Node& tree, std::string where)
    : tree_(tree), where_(std::move(where)) {
  if (tree_.IsDefined() && !tree_.IsNull() && !tree_.IsMap())
    throw std::invalid_argument(where_ + ": must be a map of keys and values");
}

YAML::Node ParameterReader::child(const std::string& key) const {
  const YAML::Node& tree = tree_;  // a node that is not const would grow the key
  if (!tree.IsMap() || !tree[key]) return YAML::Node();
  return tree[key];
}

template <class T>
void ParameterReader::find(const std::string& key, T& value, const std::string& expected) {
  known_.insert(key);
  const YAML::Node node = child(key);
  if (node.IsNull()) return;
  try {
    value = node.as<T>();
  } catch (const YAML::Exception&) {
    refuse(key, node.IsScalar() ? node.Scalar() : "not a single value", expected);
  }
}

void ParameterReader::refuse(const std::string& key, const std::string& value,
                             const std::string& expected) const {
  throw std::invalid_argument(where_ + ": '" + key + ": " + value + "' must be " + expected);
}

void ParameterReader::read(const std::string& key, bool& value) {
  find(key, value, "true or false");
  in_force_ += key + ": " + (value ? "true" : "false") + "\n";
}

void ParameterReader::read(const std::string& key, std::string& value) {
  find(key, value, "a text");
  in_force_ += key + ": '" + value + "'\n";
}

void ParameterReader::read(const std::string& key, double& value, Range range) {
  find(key, value, "a number, " + printed(range));
  if (!(value >= range.low) || !(value <= range.high))
    refuse(key, printed(value), "a number, " + printed(range));
  in_force_ += key + ": " + printed(value) + "\n";
}

void ParameterReader::read(const std::string& key, int& value, Range range) {
  find(key, value, "a whole number, " + printed(range));
  if (value < range.low || value > range.high)
    refuse(key, std::to_string(value), "a whole number, " + printed(range));
  in_force_ += key + ": " + std::to_string(value) + "\n";
}

void ParameterReader::read(const std::string& key, std::uint64_t& value) {
  find(key, value, "a whole number, 0 or above");
  in_force_ += key + ": " + std::to_string(value) + "\n";
}

void ParameterReader::finish() const {
  if (!tree_.IsMap()) return;
  for (const auto& entry : tree_) {
    const auto key = entry.first.as<std::string>();
    if (known_.count(key) != 0) continue;
    std::string list;
    for (const auto& name : known_) list += (list.empty() ? "" : ", ") + name;
    throw std::invalid_argument(where_ + ": unknown key '" + key + "'; known keys: " + list);
  }
}

TrackerNodeParams readTrackerNodeParams(ParameterReader& reader) {
  TrackerNodeParams params;
  TrackerParams& tracker = params.tracker;
  reader.read("object", params.object);
  reader.read("object_frame", params.object_frame);
  reader.read("fixed_frame", params.fixed_frame);
  reader.read("start", params.start);
  reader.read("tf_patience", params.tf_patience, {0, 1});
  reader.read("overlay_rate", params.overlay_rate, {0, 1000});
  reader.read("shown_particles", params.shown_particles, {0, 100000});
  reader.read<Measurement>("measurement", tracker.measurement, kMeasurements);
  reader.read<Eyes>("eyes", tracker.eyes, kEyes);
  reader.read("threads", tracker.threads, {1, 256});
  reader.section("motion", [&](ParameterReader& r) {
    MotionParams& p = tracker.motion;
    r.read("linear_acceleration", p.linear_acceleration, {0, 1000});
    r.read("angular_acceleration", p.angular_acceleration, {0, 10000});
    r.read("velocity_damping", p.velocity_damping, {0, 1000});
  });
  reader.section("filter", [&](ParameterReader& r) {
    FilterParams& p = tracker.filter;
    r.read("particles", p.particles, {1, 10000000});
    r.read("least_particles", p.least_particles, {0, 10000000});
    r.read("budget_ms", p.budget_ms, {0, 1000});
    r.read("layers", p.layers, {1, 20});
    r.read("resample_below", p.resample_below, {0, 1});
    r.read("seed", p.seed);
  });
  reader.section("contour", [&](ParameterReader& r) {
    ContourParams& p = tracker.contour;
    r.read("points", p.points, {8, 4096});
    r.read("truncation", p.truncation, {1, 100});
    r.read("outlier_share", p.outlier_share, {0.001, 0.99});
    r.read("edge_sigma", p.edge_sigma, {0.01, 10});
    r.read("edge_radius", p.edge_radius, {0, 0.01});
    r.read("limb_darkening", p.limb_darkening, {0, 2});
    std::string cache = "auto";
    r.read("cache_folder", cache);
    p.cache_folder = cache == "auto" ? usersCacheFolder() : cache;
  });
  reader.section("feature", [&](ParameterReader& r) {
    FeatureParams& p = tracker.feature;
    r.read("corners", p.corners, {8, 4096});
    r.read("resolution", p.resolution, {100, 100000});
    r.read("least_contrast", p.least_contrast, {0, 1});
    r.read("ratio", p.ratio, {0, 1});
    r.read("epipolar_distance", p.epipolar_distance, {0, 100});
    r.read("disparity_sigma", p.disparity_sigma, {0.01, 10});
    r.read("corner_sigma", p.corner_sigma, {0.01, 10});
    r.read("model_sigma", p.model_sigma, {0, 0.1});
    r.read("outlier_share", p.outlier_share, {0.001, 0.99});
    r.read("independent_share", p.independent_share, {0.001, 1});
    r.read("landmarks", p.landmarks, {0, 100000});
    r.read("map_position_sigma", p.map_position_sigma, {0, 1});
    r.read("map_rotation_sigma_deg", p.map_rotation_sigma_deg, {0, 180});
    r.read("map_file", p.map_file);
  });
  reader.section("volume", [&](ParameterReader& r) {
    VolumeParams& p = tracker.volume;
    r.read("nearest", p.nearest, {0.001, 100});
    r.read("farthest", p.farthest, {0.001, 100});
  });
  reader.section("start_sigma", [&](ParameterReader& r) {
    StartParams& p = tracker.start;
    r.read("position", p.position_sigma, {0, 1});
    r.read("rotation_deg", p.rotation_sigma_deg, {0, 180});
  });
  // image_transport keeps the settings of its plugins below the topic's name.
  for (const char* key : {"overlay", "image_transport"}) reader.ignore(key);
  reader.finish();
  return params;
}

RectifyNodeParams readRectifyNodeParams(ParameterReader& reader) {
  RectifyNodeParams params;
  RectificationParams& p = params.rectification;
  reader.read("width", p.width, {0, 4096});
  reader.read("height", p.height, {0, 4096});
  reader.read("focal_length", p.focal_length, {0, 10000});
  reader.read("horizontal_fov_deg", p.horizontal_fov_deg, {0, 174});
  reader.read<Eyes>("eyes", params.eyes, kEyes);
  reader.ignore("image_transport");
  reader.finish();
  return params;
}

void readFilterOptions(const CommandLine& line, TrackerParams& params) {
  if (line.has("particles"))
    params.filter.particles = static_cast<int>(line.wholeNumber("particles", 1, 10000000));
  if (line.has("threads")) params.threads = static_cast<int>(line.wholeNumber("threads", 1, 256));
  if (line.has("seed"))
    params.filter.seed = static_cast<std::uint64_t>(
        line.wholeNumber("seed", 0, std::numeric_limits<long long>::max()));
}

YAML::Node loadYamlFile(const std::string& path) {
  try {
    return YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw std::invalid_argument("'" + path + "': cannot open the file");
  } catch (const YAML::Exception& error) {
    throw std::invalid_argument("'" + path + "' is not valid YAML: " + error.what());
  }
}

YAML::Node parameterTree(const ros::NodeHandle& nh) {
  XmlRpc::XmlRpcValue value;
  if (!nh.getParam(nh.getNamespace(), value)) return YAML::Node();
  return treeFrom(value);
}

}  // namespace leap_object_tracker
