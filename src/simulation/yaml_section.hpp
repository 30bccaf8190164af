#pragma once

#include <yaml-cpp/yaml.h>

#include <Eigen/Dense>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace leap_object_tracker {

/// One map of a YAML file. Every key must be read; what is left over is a typing mistake.
class YamlSection {
 public:
  /// @param place what a message calls this map: "'x10.yaml', section 'light'"
  YamlSection(YAML::Node node, std::string place)
      : node_(std::move(node)), place_(std::move(place)) {
    if (!node_.IsMap()) throw std::runtime_error(place_ + ": must be a map of keys");
  }

  [[noreturn]] void complain(const std::string& key, const std::string& what) const {
    throw std::runtime_error(place_ + ", key '" + key + "': " + what);
  }

  bool has(const std::string& key) { return static_cast<bool>(take(key)); }

  YAML::Node take(const std::string& key) {
    known_.insert(key);
    const YAML::Node& map = node_;
    return map[key];
  }

  YamlSection section(const std::string& key) {
    if (!has(key)) complain(key, "is missing; it must be a map");
    return YamlSection(take(key), place_ + ", section '" + key + "'");
  }

  /// Leaves `value` as it is when the key is absent.
  template <class T>
  void read(const std::string& key, T& value, const std::string& expected) {
    if (has(key)) value = as<T>(key, expected);
  }

  template <class T>
  void require(const std::string& key, T& value, const std::string& expected) {
    if (!has(key)) complain(key, "is missing; expected " + expected);
    read(key, value, expected);
  }

  void readNumber(const std::string& key, double& value, double least, double most,
                  const std::string& unit) {
    const std::string range = "a number from " + text(least) + " to " + text(most) +
                              (unit.empty() ? "" : " [" + unit + "]");
    read(key, value, range);
    if (has(key) && !(value >= least && value <= most))
      complain(key, "is " + text(value) + "; expected " + range);
  }

  void readInteger(const std::string& key, int& value, int least, int most) {
    const std::string range =
        "a whole number from " + std::to_string(least) + " to " + std::to_string(most);
    read(key, value, range);
    if (has(key) && !(value >= least && value <= most))
      complain(key, "is " + std::to_string(value) + "; expected " + range);
  }

  void readVector(const std::string& key, Eigen::Vector3d& value, double limit,
                  const std::string& unit) {
    if (!has(key)) return;
    const std::string expected =
        "[x, y, z], each within +-" + text(limit) + (unit.empty() ? "" : " [" + unit + "]");
    const auto numbers = as<std::vector<double>>(key, expected);
    if (numbers.size() != 3) complain(key, "expected " + expected);
    for (int i = 0; i < 3; ++i) {
      value[i] = numbers[static_cast<std::size_t>(i)];
      if (!(std::abs(value[i]) <= limit)) complain(key, "expected " + expected);
    }
  }

  /// To be called last. @throw std::runtime_error for a key that nobody asked for.
  void finish() const {
    for (const auto& entry : node_) {
      const auto key = entry.first.as<std::string>();
      if (known_.count(key) != 0) continue;
      std::string list;
      for (const auto& name : known_) list += (list.empty() ? "" : ", ") + name;
      complain(key, "is unknown; known keys: " + list);
    }
  }

  const std::string& place() const { return place_; }

 private:
  template <class T>
  T as(const std::string& key, const std::string& expected) const {
    try {
      return node_[key].as<T>();
    } catch (const YAML::Exception&) {
      complain(key, "expected " + expected);
    }
  }

  static std::string text(double value) {
    std::string digits = std::to_string(value);
    digits.erase(digits.find_last_not_of('0') + 1);
    if (digits.back() == '.') digits.pop_back();
    return digits;
  }

  YAML::Node node_;
  std::string place_;
  std::set<std::string> known_;
};

/// Reads a file. @param kind what a message calls it: "scene file"
inline YAML::Node loadYaml(const std::string& path, const std::string& kind) {
  try {
    return YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw std::runtime_error(kind + " '" + path + "': cannot open the file");
  } catch (const YAML::Exception& error) {
    throw std::runtime_error(kind + " '" + path + "': is not valid YAML: " + error.what());
  }
}

}  // namespace leap_object_tracker
