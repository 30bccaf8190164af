#pragma once

#include <ros/node_handle.h>
#include <yaml-cpp/yaml.h>

#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "command_line.hpp"
#include "leap_object_tracker/rectification/stereo_rectifier.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// Both ends belong to it.
struct Range {
  double low;
  double high;
};

/// Reads one level of a tree of parameters. A key that is absent keeps the default of the struct. A
/// value outside its range, of another type, or a key that nobody read is an error that names all.
class ParameterReader {
 public:
  /// @param where what the user wrote it into, for messages: a file or a namespace
  ParameterReader(const YAML::Node& tree, std::string where);

  void read(const std::string& key, bool& value);
  void read(const std::string& key, std::string& value);
  void read(const std::string& key, double& value, Range range);
  void read(const std::string& key, int& value, Range range);
  void read(const std::string& key, std::uint64_t& value);

  /// One word of a list, each with the value that it stands for.
  template <class T>
  void read(const std::string& key, T& value, const std::vector<std::pair<std::string, T>>& words) {
    std::string word, list;
    for (const auto& known : words) {
      list += (list.empty() ? "" : ", ") + known.first;
      if (known.second == value) word = known.first;
    }
    read(key, word);
    for (const auto& known : words)
      if (known.first == word) {
        value = known.second;
        return;
      }
    refuse(key, word, "one of: " + list);
  }

  /// Reads the keys below `key` by a function that takes a ParameterReader&.
  template <class Read>
  void section(const std::string& key, const Read& read_keys) {
    known_.insert(key);
    ParameterReader reader(child(key), where_ + ", in '" + key + "'");
    read_keys(reader);
    reader.finish();
    in_force_ += key + ":\n";
    std::istringstream lines(reader.inForce());
    for (std::string line; std::getline(lines, line);) in_force_ += "  " + line + "\n";
  }

  /// A key that others read.
  void ignore(const std::string& key) { known_.insert(key); }

  /// @throw std::invalid_argument for keys that nobody read.
  void finish() const;

  /// All values that hold, as YAML.
  const std::string& inForce() const { return in_force_; }

 private:
  template <class T>
  void find(const std::string& key, T& value, const std::string& expected);
  YAML::Node child(const std::string& key) const;
  [[noreturn]] void refuse(const std::string& key, const std::string& value,
                           const std::string& expected) const;

  YAML::Node tree_;
  std::string where_;
  std::set<std::string> known_;
  std::string in_force_;
};

/// What the tracker nodelet is told beside the parameters of the tracker itself.
struct TrackerNodeParams {
  TrackerParams tracker;
  std::string object;            ///< path of the object file
  std::string object_frame;      ///< child frame of the transform; empty: the name of the object
  std::string fixed_frame;       ///< frame that the object rests or moves in; empty: the camera
  std::string start = "search";  ///< search | wait | "x y z qx qy qz qw" in the left camera
  double tf_patience = 0.004;    ///< [s] to wait for the transform of the fixed frame
  double overlay_rate = 15;      ///< [Hz] at most; 0: none
  int shown_particles = 200;     ///< in the PoseArray at most
};

struct RectifyNodeParams {
  RectificationParams rectification;
  Eyes eyes = Eyes::kBoth;  ///< an eye that is not wanted may be missing
};

/// @throw std::invalid_argument naming key, value and what is allowed.
TrackerNodeParams readTrackerNodeParams(ParameterReader& reader);
RectifyNodeParams readRectifyNodeParams(ParameterReader& reader);

/// Options --particles, --threads and --seed of a program, each if it is given and known there.
/// @throw UsageError
void readFilterOptions(const CommandLine& line, TrackerParams& params);

/// @throw std::invalid_argument naming the file and what is wrong with it.
YAML::Node loadYamlFile(const std::string& path);
/// The parameters below the node handle's own namespace.
YAML::Node parameterTree(const ros::NodeHandle& nh);

}  // namespace leap_object_tracker
