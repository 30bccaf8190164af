// What track_bag says to input that it cannot use: a clear message, a non-zero exit, no pose.
#include <geometry_msgs/PoseStamped.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rosbag/bag.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "support/program_run.hpp"
#include "support/stereo_messages.hpp"
#include "support/temporary_folder.hpp"

namespace leap_object_tracker {
namespace {

using testing::HasSubstr;

/// One exposure of a bag, to be spoilt by a test.
struct Exposure {
  sensor_msgs::Image left, right;
  sensor_msgs::CameraInfo left_info, right_info;
};
using Spoil = std::function<void(int frame, Exposure& exposure)>;

class TrackBagInput : public testing::Test {
 protected:
  static constexpr int kFrames = 5;

  /// A bag of grey images, 10 ms apart.
  std::string writeBag(const Spoil& spoil = {}, const std::string& left_out = "") {
    const std::string path = folder_.file("test.bag");
    rosbag::Bag bag(path, rosbag::bagmode::Write);
    for (int frame = 0; frame < kFrames; ++frame) {
      const ros::Time stamp = ros::Time(1000) + ros::Duration(0.01 * frame);
      Exposure exposure{grayImage(64, 48, 20, stamp), grayImage(64, 48, 20, stamp),
                        smallCamera(false, stamp), smallCamera(true, stamp)};
      if (spoil) spoil(frame, exposure);
      const auto write = [&](const std::string& topic, const auto& message) {
        if (topic != left_out) bag.write(topic, stamp, message);
      };
      write("/leap/left/image_raw", exposure.left);
      write("/leap/right/image_raw", exposure.right);
      write("/leap/left/camera_info", exposure.left_info);
      write("/leap/right/camera_info", exposure.right_info);
    }
    return path;
  }

  ProgramRun track(const std::string& bag, const std::string& options = "",
                   const std::string& object = LEAP_SOURCE_FOLDER "/config/objects/cube.yaml") {
    return runProgram(TRACK_BAG " '" + bag + "' --object '" + object + "' --out '" +
                      folder_.file("poses.tum") + "' --start '0 0 0.1 0 0 0 1' " + options);
  }

  void expectComplaint(const ProgramRun& run, const std::string& about) {
    EXPECT_EQ(run.exit_code, 1) << run.output;
    EXPECT_THAT(run.output, HasSubstr(about));
  }

  TemporaryFolder folder_;
};

TEST_F(TrackBagInput, runsOnABagWithoutFault) {
  const ProgramRun run = track(writeBag(), "--timing " + folder_.file("times.csv"));
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("frames            5"));
  std::ifstream times(folder_.file("times.csv"));
  int lines = 0;
  for (std::string line; std::getline(times, line);) ++lines;
  EXPECT_EQ(lines, 1 + kFrames);
}

TEST_F(TrackBagInput, namesABagThatIsMissing) {
  expectComplaint(track("/nowhere/x.bag"), "/nowhere/x.bag");
}

TEST_F(TrackBagInput, saysThatABagWasCutOff) {
  const std::string bag = writeBag();
  std::filesystem::resize_file(bag, std::filesystem::file_size(bag) / 2);
  expectComplaint(track(bag), "bag '");
}

TEST_F(TrackBagInput, saysThatAFileIsNoBag) {
  expectComplaint(track(LEAP_SOURCE_FOLDER "/package.xml"), "package.xml");
}

TEST_F(TrackBagInput, namesATopicThatIsMissing) {
  for (const std::string& topic :
       std::vector<std::string>{"/leap/left/image_raw", "/leap/right/image_raw",
                                "/leap/left/camera_info", "/leap/right/camera_info"})
    expectComplaint(track(writeBag({}, topic)), topic);
}

TEST_F(TrackBagInput, doesWithoutTheRightEyeIfToldSo) {
  const ProgramRun run = track(writeBag({}, "/leap/right/image_raw"), "--eyes left");
  EXPECT_EQ(run.exit_code, 0) << run.output;
}

TEST_F(TrackBagInput, refusesAnotherEncoding) {
  expectComplaint(track(writeBag([](int, Exposure& e) { e.left.encoding = "bgr8"; })), "bgr8");
}

TEST_F(TrackBagInput, refusesImagesOfAnotherSizeThanCameraInfo) {
  expectComplaint(track(writeBag([](int, Exposure& e) {
                    e.right = grayImage(32, 48, 20, e.right.header.stamp);
                  })),
                  "32x48");
}

TEST_F(TrackBagInput, refusesASizeThatChanges) {
  expectComplaint(track(writeBag([](int frame, Exposure& e) {
                    if (frame >= 3) {
                      e.left = grayImage(64, 24, 20, e.left.header.stamp);
                      e.right = grayImage(64, 24, 20, e.right.header.stamp);
                    }
                  })),
                  "64x24");
}

TEST_F(TrackBagInput, refusesACameraThatChanges) {
  expectComplaint(track(writeBag([](int frame, Exposure& e) {
                    if (frame >= 3) e.left_info.K[0] = 120;
                  })),
                  "changes");
}

TEST_F(TrackBagInput, refusesFewerBytesThanPixels) {
  expectComplaint(track(writeBag([](int, Exposure& e) { e.left.data.resize(100); })), "100 bytes");
}

TEST_F(TrackBagInput, saysHowFarStampsThatNeverMatchAreApart) {
  expectComplaint(
      track(writeBag([](int, Exposure& e) { e.right.header.stamp += ros::Duration(0.004); })),
      "same stamp");
}

TEST_F(TrackBagInput, refusesAnUncalibratedCamera) {
  expectComplaint(track(writeBag([](int, Exposure& e) {
                    e.left_info.K.fill(0);
                    e.left_info.R.fill(0);
                    e.left_info.P.fill(0);
                  })),
                  "not calibrated");
}

TEST_F(TrackBagInput, refusesABaselineOfZero) {
  expectComplaint(track(writeBag([](int, Exposure& e) { e.right_info.P[3] = 0; })), "baseline");
}

TEST_F(TrackBagInput, warnsOfTimeThatJumpsBack) {
  const ProgramRun run = track(writeBag([](int frame, Exposure& e) {
    if (frame >= 3)
      e.left.header.stamp = e.right.header.stamp = ros::Time(990) + ros::Duration(0.01 * frame);
  }));
  EXPECT_EQ(run.exit_code, 0) << run.output;
  EXPECT_THAT(run.output, HasSubstr("backwards"));
}

TEST_F(TrackBagInput, refusesObjectFilesThatAreWrong) {
  const std::string bag = writeBag();
  const auto refused = [&](const std::string& yaml, const std::string& about) {
    expectComplaint(track(bag, "", folder_.write("object.yaml", yaml)), about);
  };
  refused("name: a\nshape: box\nsize: [0.03, .nan, 0.03]\n", "size");
  refused("name: a\nshape: box\nsize: [0.03, 0, 0.03]\n", "size");
  refused("name: a\nshape: box\nsize: [0.03, 0.03, 0.03]\ncolour: red\n", "colour");
  refused("name: a\nshape: mesh\nmesh: nowhere.stl\n", "nowhere.stl");
  folder_.write("torn.obj", "v 1 2\nf 1 2 9\n");
  refused("name: a\nshape: mesh\nmesh: torn.obj\n", "torn.obj");
  refused("name: [a\n", "YAML");
  expectComplaint(track(bag, "", "/nowhere.yaml"), "/nowhere.yaml");
}

TEST_F(TrackBagInput, refusesAConfigurationThatIsWrong) {
  const std::string config = folder_.write("config.yaml", "filter: {particels: 9}\n");
  expectComplaint(track(writeBag(), "--config " + config), "particels");
}

TEST_F(TrackBagInput, refusesToStartFromTruthThatTheBagDoesNotHave) {
  const ProgramRun run = runProgram(TRACK_BAG " '" + writeBag() +
                                    "' --object " LEAP_SOURCE_FOLDER
                                    "/config/objects/cube.yaml --start truth --out '" +
                                    folder_.file("poses.tum") + "'");
  expectComplaint(run, "truth");
}

TEST_F(TrackBagInput, refusesToWriteWhereItCannot) {
  const ProgramRun run = runProgram(TRACK_BAG " '" + writeBag() +
                                    "' --object " LEAP_SOURCE_FOLDER
                                    "/config/objects/cube.yaml --out /nowhere/poses.tum");
  expectComplaint(run, "/nowhere/poses.tum");
}

TEST_F(TrackBagInput, explainsItsUsage) {
  for (const std::string& arguments :
       std::vector<std::string>{"", "--nonsense 3", "a.bag", "a.bag b.bag --object x --out y",
                                "a.bag --object x --out y --perturb 1"}) {
    const ProgramRun run = runProgram(TRACK_BAG " " + arguments);
    EXPECT_EQ(run.exit_code, 2) << arguments;
    EXPECT_THAT(run.output, HasSubstr("usage: track_bag"));
  }
}

}  // namespace
}  // namespace leap_object_tracker
