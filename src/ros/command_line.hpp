#pragma once

#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace leap_object_tracker {

/// A command line that is not as the usage says.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Options of the form `--name value`, wherever they stand, and the rest in its order. Values may
/// begin with a minus sign.
class CommandLine {
 public:
  /// @param options how many values follow each known option, without the two dashes
  /// @throw UsageError for options that are unknown, given twice, or short of values.
  CommandLine(int argc, char** argv, const std::map<std::string, int>& options);

  const std::vector<std::string>& positional() const { return positional_; }
  bool has(const std::string& option) const { return values_.count(option) != 0; }
  std::string text(const std::string& option, const std::string& otherwise = "") const;
  /// @throw UsageError if it is no number between low and high.
  double number(const std::string& option, std::size_t index, double low, double high) const;
  long long wholeNumber(const std::string& option, long long low, long long high) const;

 private:
  std::vector<std::string> positional_;
  std::map<std::string, std::vector<std::string>> values_;
};

}  // namespace leap_object_tracker
