#include "ros/command_line.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

CommandLine lineOf(std::vector<std::string> words) {
  std::vector<char*> argv{const_cast<char*>("program")};
  for (auto& word : words) argv.push_back(word.data());
  return CommandLine(static_cast<int>(argv.size()), argv.data(),
                     {{"out", 1}, {"perturb", 2}, {"help", 0}});
}

TEST(CommandLine, takesOptionsWhereverTheyStand) {
  const CommandLine line = lineOf({"--out", "a.tum", "some.bag", "--help"});
  EXPECT_EQ(line.positional(), std::vector<std::string>{"some.bag"});
  EXPECT_EQ(line.text("out"), "a.tum");
  EXPECT_TRUE(line.has("help"));
}

TEST(CommandLine, takesValuesThatBeginWithAMinus) {
  EXPECT_EQ(lineOf({"--out", "-0.01 0 1"}).text("out"), "-0.01 0 1");
  EXPECT_EQ(lineOf({"--out=-3"}).text("out"), "-3");
}

TEST(CommandLine, takesExactlyAsManyValuesAsAnOptionHas) {
  const CommandLine line = lineOf({"--perturb", "5", "3.5", "some.bag"});
  EXPECT_DOUBLE_EQ(line.number("perturb", 1, 0, 180), 3.5);
  EXPECT_EQ(line.positional().size(), 1u);
}

TEST(CommandLine, refusesWhatItDoesNotKnow) {
  EXPECT_THROW(lineOf({"--outt", "x"}), UsageError);
  EXPECT_THROW(lineOf({"--out"}), UsageError);
  EXPECT_THROW(lineOf({"--out", "a", "--out", "b"}), UsageError);
}

TEST(CommandLine, refusesNumbersOutOfRange) {
  const CommandLine line = lineOf({"--perturb", "5", "deg", "--out", "1.5"});
  EXPECT_THROW(line.number("perturb", 0, 0, 4), UsageError);
  EXPECT_THROW(line.number("perturb", 1, 0, 4), UsageError);
  EXPECT_THROW(line.wholeNumber("out", 0, 4), UsageError);
}

}  // namespace
}  // namespace leap_object_tracker
