#pragma once

#include <filesystem>
#include <fstream>
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

/// What a program says of itself. Each has the option --help as well.
struct Program {
  const char* name;
  const char* usage;
  std::map<std::string, int> options;
};

/// The main function of a program: runs it, or says what is wrong.
/// @return 0, 1 after an error, 2 for a command line that is not as the usage says
int runProgram(const Program& program, int argc, char** argv, void (*run)(const CommandLine&));

/// @throw std::runtime_error naming the file, if it cannot be written.
std::ofstream createFile(const std::filesystem::path& path);

}  // namespace leap_object_tracker
