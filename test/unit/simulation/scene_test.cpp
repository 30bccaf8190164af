#include "leap_object_tracker/simulation/scene.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace leap_object_tracker {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

const std::string kScenes = LEAP_SOURCE_FOLDER "/config/scenes";

class SceneFile : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = std::filesystem::temp_directory_path() /
              ("scene_test_" +
               std::string(::testing::UnitTest::GetInstance()->current_test_info()->name()));
    std::filesystem::create_directories(folder_);
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string write(const std::string& name, const std::string& text) const {
    std::ofstream(folder_ / name) << text;
    return (folder_ / name).string();
  }

  /// A scene with all that must be there, and more lines.
  std::string sceneWith(const std::string& lines) const {
    return write("scene.yaml", "calibration: " LEAP_SOURCE_FOLDER
                               "/config/calibration/leap_unit_a.yaml\n"
                               "object:\n  file: " LEAP_SOURCE_FOLDER
                               "/config/objects/cube.yaml\n" +
                                   lines);
  }

  static std::string complaintAbout(const std::string& path) {
    try {
      loadScene(path);
    } catch (const std::runtime_error& error) {
      return error.what();
    }
    return "no complaint";
  }

  std::filesystem::path folder_;
};

std::vector<std::string> yamlFilesIn(const std::string& folder) {
  std::vector<std::string> files;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".yaml") files.push_back(entry.path().string());
  return files;
}

TEST(Config, everySceneLoads) {
  const auto files = yamlFilesIn(kScenes);
  ASSERT_GE(files.size(), 25U);
  for (const auto& file : files) EXPECT_NO_THROW(loadScene(file)) << file;
}

TEST(Config, everyObjectLoads) {
  const auto files = yamlFilesIn(LEAP_SOURCE_FOLDER "/config/objects");
  ASSERT_GE(files.size(), 7U);
  for (const auto& file : files) EXPECT_GT(loadObject(file).mesh.triangles.size(), 0U) << file;
}

TEST(Config, everyCalibrationLoads) {
  for (const auto& file : yamlFilesIn(LEAP_SOURCE_FOLDER "/config/calibration"))
    EXPECT_NEAR(loadLeapUnit(file).baseline, 0.04, 2e-4) << file;
}

TEST_F(SceneFile, loadsWithDefaults) {
  const Scene scene = loadScene(sceneWith(""));
  EXPECT_EQ(scene.mode.height, 240);
  EXPECT_EQ(scene.bodies.size(), 1U);
  EXPECT_EQ(scene.object.name, "cube");
}

TEST_F(SceneFile, refusesUnknownKeysAndNamesFileSectionAndKey) {
  EXPECT_THAT(complaintAbout(sceneWith("colour: red\n")),
              AllOf(HasSubstr("scene.yaml"), HasSubstr("'colour'"), HasSubstr("known keys")));
  EXPECT_THAT(complaintAbout(sceneWith("light: {pover: 1}\n")),
              AllOf(HasSubstr("'light'"), HasSubstr("'pover'")));
  EXPECT_THAT(complaintAbout(sceneWith("sensor: {iso: 100}\n")),
              AllOf(HasSubstr("'sensor'"), HasSubstr("'iso'")));
  EXPECT_THAT(complaintAbout(sceneWith("  motion: {sweep: {range: [0, 1], speed: 3}}\n")),
              AllOf(HasSubstr("'sweep' number 1"), HasSubstr("'speed'")));
  EXPECT_THAT(complaintAbout(sceneWith("bodies:\n  - {name: a, size: [1, 1, 1], hue: 3}\n")),
              AllOf(HasSubstr("'bodies' number 1"), HasSubstr("'hue'")));
}

TEST_F(SceneFile, refusesValuesOutOfRangeAndNamesTheRange) {
  EXPECT_THAT(complaintAbout(sceneWith("sensor: {gain: 64}\n")),
              AllOf(HasSubstr("'gain'"), HasSubstr("64"), HasSubstr("16 to 63")));
  EXPECT_THAT(complaintAbout(sceneWith("mode: 640x241\n")), HasSubstr("640x240"));
  EXPECT_THAT(complaintAbout(sceneWith("timing: slow\n")), HasSubstr("steady, thesis"));
  EXPECT_THAT(complaintAbout(sceneWith("frames: 0\n")), HasSubstr("'frames'"));
  EXPECT_THAT(complaintAbout(sceneWith("frames: many\n")), HasSubstr("'frames'"));
  EXPECT_THAT(complaintAbout(sceneWith("  paint: {albedo: [0.5, 1.5]}\n")), HasSubstr("0 to 1"));
  EXPECT_THAT(complaintAbout(sceneWith("bodies:\n  - {name: a, size: [1, .nan, 1]}\n")),
              HasSubstr("'size'"));
}

TEST_F(SceneFile, saysWhatIsMissing) {
  EXPECT_THAT(complaintAbout("/nowhere.yaml"), HasSubstr("cannot open"));
  EXPECT_THAT(complaintAbout(write("a.yaml", "frames: 3\n")), HasSubstr("'calibration'"));
  EXPECT_THAT(complaintAbout(write("b.yaml", "- 3\n")), HasSubstr("map of keys"));
  EXPECT_THAT(complaintAbout(write("c.yaml", "a: [\n")), HasSubstr("not valid YAML"));
}

TEST_F(SceneFile, takesFromItsBaseWhatItDoesNotSay) {
  sceneWith("frames: 12\n  \nsensor: {gain: 20, exposure_us: 70}\n");
  const Scene scene =
      loadScene(write("top.yaml", "based_on: scene.yaml\nsensor: {gain: 30}\nseed: 5\n"));
  EXPECT_EQ(scene.frames, 12);
  EXPECT_EQ(scene.seed, 5U);
  EXPECT_EQ(scene.controls.gain, 30);
  EXPECT_EQ(scene.controls.exposure_us, 70);
}

TEST_F(SceneFile, refusesARingOfBases) {
  EXPECT_THAT(complaintAbout(write("ring.yaml", "based_on: ring.yaml\n")), HasSubstr("'based_on'"));
}

TEST_F(SceneFile, refusesABaseThatIsNoPath) {
  EXPECT_THAT(complaintAbout(write("list.yaml", "based_on: [a.yaml]\n")),
              AllOf(HasSubstr("list.yaml"), HasSubstr("'based_on'")));
}

TEST_F(SceneFile, yieldsToWhatTheCallerSays) {
  SceneOverrides overrides;
  overrides.frames = 4;
  overrides.has_seed = true;
  overrides.seed = 0;
  overrides.object_path = LEAP_SOURCE_FOLDER "/config/objects/box.yaml";
  const Scene scene = loadScene(sceneWith("seed: 9\n"), overrides);
  EXPECT_EQ(scene.frames, 4);
  EXPECT_EQ(scene.seed, 0U);
  EXPECT_EQ(scene.object.name, "box");
}

}  // namespace
}  // namespace leap_object_tracker
