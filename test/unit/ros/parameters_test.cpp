#include "ros/parameters.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

namespace leap_object_tracker {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string complaintAbout(const std::string& yaml) {
  try {
    ParameterReader reader(YAML::Load(yaml), "file 'tracker.yaml'");
    readTrackerNodeParams(reader);
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
  return "";
}

TEST(ParameterReader, keepsTheDefaultsOfTheStructForKeysThatAreAbsent) {
  ParameterReader reader(YAML::Node(), "nothing");
  const TrackerNodeParams params = readTrackerNodeParams(reader);
  EXPECT_EQ(params.tracker.filter.particles, TrackerParams().filter.particles);
  EXPECT_EQ(params.start, "search");
}

TEST(ParameterReader, readsKeysOfSections) {
  ParameterReader reader(YAML::Load("{eyes: left, filter: {particles: 77}}"), "text");
  const TrackerNodeParams params = readTrackerNodeParams(reader);
  EXPECT_EQ(params.tracker.filter.particles, 77);
  EXPECT_EQ(params.tracker.eyes, Eyes::kLeft);
}

TEST(ParameterReader, refusesAnUnknownKeyAndListsTheKnownOnes) {
  EXPECT_THAT(complaintAbout("particels: 5"),
              AllOf(HasSubstr("tracker.yaml"), HasSubstr("'particels'"), HasSubstr("threads")));
}

TEST(ParameterReader, refusesAnUnknownKeyInASection) {
  EXPECT_THAT(complaintAbout("filter: {particels: 5}"),
              AllOf(HasSubstr("in 'filter'"), HasSubstr("'particels'"), HasSubstr("particles")));
}

TEST(ParameterReader, namesKeyValueAndRange) {
  EXPECT_THAT(complaintAbout("filter: {resample_below: 1.5}"),
              AllOf(HasSubstr("resample_below"), HasSubstr("1.5"), HasSubstr("0 to 1")));
}

TEST(ParameterReader, refusesNotANumber) {
  EXPECT_THAT(complaintAbout("filter: {resample_below: .nan}"), HasSubstr("resample_below"));
}

TEST(ParameterReader, refusesAValueOfAnotherType) {
  EXPECT_THAT(complaintAbout("threads: many"), AllOf(HasSubstr("threads"), HasSubstr("many")));
  EXPECT_THAT(complaintAbout("threads: [1, 2]"), HasSubstr("threads"));
  EXPECT_THAT(complaintAbout("filter: 5"), HasSubstr("map of keys"));
}

TEST(ParameterReader, refusesAWordThatIsNotOfTheList) {
  EXPECT_THAT(complaintAbout("eyes: three"),
              AllOf(HasSubstr("three"), HasSubstr("both, left, right")));
}

TEST(ParameterReader, printsAllValuesAsYamlThatReadsTheSame) {
  ParameterReader first(YAML::Load("{threads: 3, filter: {particles: 77}}"), "text");
  readTrackerNodeParams(first);
  ParameterReader second(YAML::Load(first.inForce()), "printed");
  EXPECT_EQ(readTrackerNodeParams(second).tracker.filter.particles, 77);
  EXPECT_EQ(second.inForce(), first.inForce());
}

TEST(ParameterFiles, allOfTheTrackerLoad) {
  int files = 0;
  for (const auto& entry : std::filesystem::directory_iterator(LEAP_SOURCE_FOLDER "/config")) {
    if (entry.path().filename().string().rfind("tracker_", 0) != 0) continue;
    SCOPED_TRACE(entry.path().string());
    ParameterReader reader(loadYamlFile(entry.path().string()), entry.path().string());
    EXPECT_NO_THROW(readTrackerNodeParams(reader));
    ++files;
  }
  EXPECT_GE(files, 1);
}

TEST(ParameterFiles, thatOfTheRectificationLoads) {
  ParameterReader reader(loadYamlFile(LEAP_SOURCE_FOLDER "/config/rectify.yaml"), "rectify.yaml");
  EXPECT_EQ(readRectifyNodeParams(reader).rectification.width, 0);
}

TEST(ParameterFiles, thatAreMissingOrNoYamlAreErrors) {
  EXPECT_THROW(loadYamlFile("/nowhere.yaml"), std::invalid_argument);
  EXPECT_THROW(loadYamlFile(LEAP_SOURCE_FOLDER "/config/report/uPlot.min.css"),
               std::invalid_argument);
}

}  // namespace
}  // namespace leap_object_tracker
