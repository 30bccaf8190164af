#include "leap_object_tracker/evaluation/trajectory.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

constexpr double kUnitLengthTolerance = 0.01;
constexpr int kPoseNumbers = 7;
constexpr int kTriangleNumbers = 21;
constexpr std::chrono::microseconds kSameStamp{10};

[[noreturn]] void fail(const std::string& path, int line, const std::string& what) {
  throw std::runtime_error("'" + path + "', line " + std::to_string(line) + ": " + what);
}

std::ifstream openToRead(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error("'" + path + "': cannot be opened to read");
  return file;
}

std::ofstream openToWrite(const std::string& path) {
  std::ofstream file(path);
  if (!file) throw std::runtime_error("'" + path + "': cannot be opened to write");
  return file;
}

void checkWritten(std::ofstream& file, const std::string& path) {
  file.flush();
  if (!file) throw std::runtime_error("'" + path + "': cannot be written, is the disk full?");
}

/// Exact to the nanosecond, which a double is not for times since 1970.
std::optional<Stamp> parseStamp(const std::string& text) {
  try {
    const std::size_t point = text.find('.');
    if (point == std::string::npos || text.find_first_of("eE") != std::string::npos) {
      std::size_t used = 0;
      const double value = std::stod(text, &used);
      if (used != text.size() || !std::isfinite(value) || std::abs(value) > 9e9)
        return std::nullopt;
      return stampFromSeconds(value);
    }
    std::string fraction = text.substr(point + 1, 9);
    if (text.find_first_not_of("0123456789", point + 1) != std::string::npos) return std::nullopt;
    fraction.resize(9, '0');
    std::size_t used = 0;
    const std::int64_t whole = point == 0 ? 0 : std::stoll(text.substr(0, point), &used);
    if (used != point || std::abs(whole) > 9'000'000'000) return std::nullopt;
    const std::int64_t nanoseconds = std::stoll(fraction);
    return Stamp(std::chrono::seconds(whole) +
                 std::chrono::nanoseconds(text[0] == '-' ? -nanoseconds : nanoseconds));
  } catch (const std::logic_error&) {
    return std::nullopt;
  }
}

std::string format(Stamp stamp) {
  const auto total = stamp.time_since_epoch().count();
  std::ostringstream out;
  out << (total < 0 ? "-" : "") << std::abs(total) / 1'000'000'000 << '.' << std::setw(9)
      << std::setfill('0') << std::abs(total) % 1'000'000'000;
  return out.str();
}

/// The stamp and then `count` finite numbers; nothing if the line is anything else.
std::optional<std::pair<Stamp, std::vector<double>>> parseLine(const std::string& line, int count) {
  std::istringstream in(line);
  std::string word;
  if (!(in >> word)) return std::nullopt;
  const auto stamp = parseStamp(word);
  if (!stamp) return std::nullopt;
  std::vector<double> numbers;
  while (in >> word) {
    char* end = nullptr;
    const double number = std::strtod(word.c_str(), &end);
    if (*end != '\0' || !std::isfinite(number)) return std::nullopt;
    numbers.push_back(number);
  }
  if (static_cast<int>(numbers.size()) != count) return std::nullopt;
  return std::make_pair(*stamp, numbers);
}

bool blankOrComment(const std::string& line) {
  const std::size_t first = line.find_first_not_of(" \t\r");
  return first == std::string::npos || line[first] == '#';
}

}  // namespace

Trajectory readTum(const std::string& path) {
  std::ifstream file = openToRead(path);
  Trajectory trajectory;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    if (blankOrComment(line)) continue;
    const auto parsed = parseLine(line, kPoseNumbers);
    if (!parsed) fail(path, number, "expected eight finite numbers: stamp tx ty tz qx qy qz qw");
    const auto& [stamp, n] = *parsed;
    const Eigen::Quaterniond rotation(n[6], n[3], n[4], n[5]);
    if (std::abs(rotation.norm() - 1.0) > kUnitLengthTolerance)
      fail(path, number, "the quaternion (last four numbers) is not of unit length");
    if (!trajectory.empty() && stamp <= trajectory.back().stamp)
      fail(path, number, "the stamp is not later than that of the pose before");
    StampedPose pose;
    pose.stamp = stamp;
    pose.camera_from_object.linear() = rotation.normalized().toRotationMatrix();
    pose.camera_from_object.translation() = Eigen::Vector3d(n[0], n[1], n[2]);
    trajectory.push_back(pose);
  }
  return trajectory;
}

void writeTum(const std::string& path, const Trajectory& trajectory) {
  std::ofstream file = openToWrite(path);
  file << "# stamp tx ty tz qx qy qz qw\n" << std::setprecision(10);
  for (const auto& pose : trajectory) {
    const Eigen::Quaterniond rotation(pose.camera_from_object.linear());
    file << format(pose.stamp);
    for (int i = 0; i < 3; ++i) file << ' ' << pose.camera_from_object.translation()[i];
    for (int i = 0; i < 4; ++i) file << ' ' << rotation.coeffs()[i];
    file << '\n';
  }
  checkWritten(file, path);
}

void readCovariances(const std::string& path, Trajectory& trajectory) {
  std::ifstream file = openToRead(path);
  std::string line;
  int read = 0, found = 0;
  for (int number = 1; std::getline(file, line); ++number) {
    if (blankOrComment(line)) continue;
    if (line.find_first_of("0123456789-.") != 0) continue;
    std::replace(line.begin(), line.end(), ',', ' ');
    const auto parsed = parseLine(line, kTriangleNumbers);
    if (!parsed) fail(path, number, "expected a stamp and the 21 values of an upper triangle");
    ++read;
    const auto& [stamp, values] = *parsed;
    const auto pose = std::lower_bound(
        trajectory.begin(), trajectory.end(), stamp,
        [](const StampedPose& candidate, Stamp wanted) { return candidate.stamp < wanted; });
    if (pose == trajectory.end() || pose->stamp != stamp) continue;
    Matrix6d covariance;
    auto value = values.begin();
    for (int row = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column)
        covariance(row, column) = covariance(column, row) = *value++;
    pose->covariance = covariance;
    ++found;
  }
  if (read > 0 && found == 0)
    throw std::runtime_error("'" + path +
                             "': no stamp in common with the poses, is it of another run?");
}

void writeCovariances(const std::string& path, const Trajectory& trajectory) {
  std::ofstream file = openToWrite(path);
  file << "stamp";
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) file << ",c" << row << column;
  file << '\n' << std::setprecision(12);
  for (const auto& pose : trajectory) {
    if (!pose.covariance) continue;
    file << format(pose.stamp);
    for (int row = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column) file << ',' << (*pose.covariance)(row, column);
    file << '\n';
  }
  checkWritten(file, path);
}

std::optional<Pose> poseAt(const Trajectory& trajectory, Stamp stamp,
                           std::chrono::nanoseconds tolerance,
                           std::chrono::nanoseconds longest_gap) {
  const auto after = std::lower_bound(
      trajectory.begin(), trajectory.end(), stamp,
      [](const StampedPose& candidate, Stamp wanted) { return candidate.stamp < wanted; });
  const auto distance = [&](auto pose) { return std::chrono::abs(pose->stamp - stamp); };
  const bool has_after = after != trajectory.end();
  const bool has_before = after != trajectory.begin();
  if (has_after && distance(after) <= kSameStamp) return after->camera_from_object;
  if (has_before && distance(after - 1) <= kSameStamp) return (after - 1)->camera_from_object;
  if (has_after && has_before && after->stamp - (after - 1)->stamp <= longest_gap) {
    const StampedPose& a = *(after - 1);
    const double share = seconds(stamp - a.stamp) / seconds(after->stamp - a.stamp);
    return moved(a.camera_from_object,
                 share * twistBetween(a.camera_from_object, after->camera_from_object));
  }
  if (has_after && distance(after) <= tolerance) return after->camera_from_object;
  if (has_before && distance(after - 1) <= tolerance) return (after - 1)->camera_from_object;
  return std::nullopt;
}

}  // namespace leap_object_tracker
