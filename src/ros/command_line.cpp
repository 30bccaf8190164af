#include "command_line.hpp"

#include <cstdlib>
#include <iostream>

namespace leap_object_tracker {

CommandLine::CommandLine(int argc, char** argv, const std::map<std::string, int>& options) {
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word.rfind("--", 0) != 0) {
      positional_.push_back(word);
      continue;
    }
    const auto equals = word.find('=');
    const std::string name = word.substr(2, equals == std::string::npos ? equals : equals - 2);
    const auto known = options.find(name);
    if (known == options.end()) throw UsageError("unknown option --" + name);
    if (has(name)) throw UsageError("--" + name + " is given twice");
    auto& values = values_[name];
    if (equals != std::string::npos) values.push_back(word.substr(equals + 1));
    while (static_cast<int>(values.size()) < known->second) {
      if (++i >= argc)
        throw UsageError("--" + name + " needs " + std::to_string(known->second) + " value(s)");
      values.emplace_back(argv[i]);
    }
  }
}

std::string CommandLine::text(const std::string& option, const std::string& otherwise) const {
  const auto found = values_.find(option);
  return found == values_.end() || found->second.empty() ? otherwise : found->second.front();
}

double CommandLine::number(const std::string& option, std::size_t index, double low,
                           double high) const {
  const std::string& word = values_.at(option).at(index);
  char* end = nullptr;
  const double value = std::strtod(word.c_str(), &end);
  if (word.empty() || *end != '\0' || !(value >= low) || !(value <= high))
    throw UsageError("--" + option + " '" + word + "' must be a number from " +
                     std::to_string(low) + " to " + std::to_string(high));
  return value;
}

long long CommandLine::wholeNumber(const std::string& option, long long low, long long high) const {
  const std::string& word = values_.at(option).at(0);
  char* end = nullptr;
  const long long value = std::strtoll(word.c_str(), &end, 10);
  if (word.empty() || *end != '\0' || value < low || value > high)
    throw UsageError("--" + option + " '" + word + "' must be a whole number from " +
                     std::to_string(low) + " to " + std::to_string(high));
  return value;
}

int runProgram(const Program& program, int argc, char** argv, void (*run)(const CommandLine&)) {
  try {
    std::map<std::string, int> options = program.options;
    options["help"] = 0;
    const CommandLine line(argc, argv, options);
    if (line.has("help"))
      std::cout << program.usage;
    else
      run(line);
    return 0;
  } catch (const UsageError& error) {
    std::cerr << program.name << ": " << error.what() << "\n\n" << program.usage;
    return 2;
  } catch (const std::exception& error) {
    std::cerr << program.name << ": " << error.what() << "\n";
    return 1;
  }
}

std::ofstream createFile(const std::filesystem::path& path) {
  std::ofstream file(path);
  if (!file) throw std::runtime_error("cannot write '" + path.string() + "'");
  return file;
}

}  // namespace leap_object_tracker
