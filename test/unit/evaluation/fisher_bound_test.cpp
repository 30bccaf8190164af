#include "leap_object_tracker/evaluation/fisher_bound.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace leap_object_tracker {
namespace {

StereoCalibration pinholes() {
  CameraCalibration eye;
  eye.size = cv::Size(640, 480);
  eye.fx = eye.fy = 100;
  eye.cx = 320;
  eye.cy = 240;
  StereoCalibration calibration;
  calibration.left = calibration.right = eye;
  calibration.baseline = 0.04;
  return calibration;
}

Pose at(double x, double y, double z) {
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(x, y, z);
  return pose;
}

/// A square of four lines in the plane z = 0, side 2 cm, in pieces of 1 mm.
std::vector<LineElement> square() {
  std::vector<LineElement> lines;
  for (int i = 0; i < 20; ++i) {
    const double along = 0.001 * (i + 0.5) - 0.01;
    for (const double side : {-0.01, 0.01}) {
      lines.push_back({{along, side, 0}, Eigen::Vector3d::UnitX(), 0.001});
      lines.push_back({{side, along, 0}, Eigen::Vector3d::UnitY(), 0.001});
    }
  }
  return lines;
}

TEST(LineInformation, ofOneLineIsThatOfItsPlaceAcross) {
  // 1 cm along x, seen from 10 cm at 100 px: 10 px long, 1000 px/m.
  const std::vector<LineElement> line{{{0, 0, 0}, Eigen::Vector3d::UnitX(), 0.01}};
  const Matrix6d information =
      lineInformation(pinholes(), 0, at(0, 0, 0.1), line, EdgeNoise{0.5, 2});
  EXPECT_NEAR(information(1, 1), 10.0 / 2 / 0.25 * 1e6, 1e2);
  EXPECT_NEAR(information(0, 0), 0, 1e-3);
  EXPECT_NEAR(information(2, 2), 0, 1e-3);
}

TEST(LineInformation, leavesOutWhatIsOutsideOfTheImageOrBehind) {
  const std::vector<LineElement> line{{{0, 0, 0}, Eigen::Vector3d::UnitX(), 0.01}};
  EXPECT_EQ(lineInformation(pinholes(), 0, at(0.5, 0, 0.1), line).norm(), 0);
  EXPECT_EQ(lineInformation(pinholes(), 0, at(0, 0, -0.1), line).norm(), 0);
  // In the right eye's image, but not in that of the left one.
  EXPECT_EQ(lineInformation(pinholes(), 0, at(0.33, 0, 0.1), line).norm(), 0);
  EXPECT_GT(lineInformation(pinholes(), 1, at(0.33, 0, 0.1), line).norm(), 0);
}

TEST(LineInformation, countsVerticalPlacesHalfWhereRowsAreBinned) {
  StereoCalibration binned = pinholes();
  for (CameraCalibration* eye : {&binned.left, &binned.right}) eye->fy /= 2, eye->cy /= 2;
  const std::vector<LineElement> line{{{0, 0, 0}, Eigen::Vector3d::UnitX(), 0.01}};
  const double full = lineInformation(pinholes(), 0, at(0, 0, 0.1), line)(1, 1);
  EXPECT_NEAR(lineInformation(binned, 0, at(0, 0, 0.1), line)(1, 1), full / 4, 1e-6 * full);
}

TEST(LineInformation, foretellsTheChangeOfAResidual) {
  // Second derivative of half the squared residuals across the lines, by finite differences.
  const std::vector<LineElement> line{
      {{0.004, -0.003, 0.002}, Eigen::Vector3d(1, 2, -1).normalized(), 0.001}};
  const Pose pose = at(0.02, -0.01, 0.12);
  const Matrix6d information = lineInformation(pinholes(), 1, pose, line, EdgeNoise{1, 1});
  const auto pixel = [](const Pose& moved_pose, const Eigen::Vector3d& point) {
    const Eigen::Vector3d p = moved_pose * point - Eigen::Vector3d(0.04, 0, 0);
    return Eigen::Vector2d(320 + 100 * p.x() / p.z(), 240 + 100 * p.y() / p.z());
  };
  const Eigen::Vector3d tip = line[0].position + 1e-5 * line[0].tangent;
  const Eigen::Vector2d along = pixel(pose, tip) - pixel(pose, line[0].position);
  const Eigen::Vector2d normal(-along.y(), along.x());
  const double pixels = along.norm() / 1e-5 * line[0].length;
  for (int axis = 0; axis < 6; ++axis) {
    constexpr double kStep = 1e-6;
    Pose moved_pose = pose;
    if (axis < 3)
      moved_pose.translation()[axis] += kStep;
    else
      moved_pose.linear() =
          rotationFromVector(kStep * Eigen::Vector3d::Unit(axis - 3)) * pose.linear();
    const double slope = normal.normalized().dot(pixel(moved_pose, line[0].position) -
                                                 pixel(pose, line[0].position)) /
                         kStep;
    EXPECT_NEAR(information(axis, axis), pixels * slope * slope,
                1e-3 * (1 + pixels * slope * slope));
  }
}

TEST(BoundFrom, growsWithDepthAndFallsWithTheSecondEye) {
  const auto bound = [](double z, bool both) {
    Matrix6d information = lineInformation(pinholes(), 0, at(0.02, 0, z), square());
    if (both) information += lineInformation(pinholes(), 1, at(0.02, 0, z), square());
    return *boundFrom(information, at(0.02, 0, z), {});
  };
  EXPECT_GT(bound(0.2, true).position, 2 * bound(0.1, true).position);
  EXPECT_GT(bound(0.1, false).position, 1.3 * bound(0.1, true).position);
  EXPECT_GT(bound(0.1, false).orientation, 1.3 * bound(0.1, true).orientation);
}

TEST(BoundFrom, isNothingWhereADirectionStaysOpen) {
  const std::vector<LineElement> line{{{0, 0, 0}, Eigen::Vector3d::UnitX(), 0.01}};
  EXPECT_FALSE(boundFrom(lineInformation(pinholes(), 0, at(0, 0, 0.1), line), at(0, 0, 0.1), {}));
}

TEST(BoundFrom, leavesOutTheFreeAxis) {
  Matrix6d information = Matrix6d::Identity();
  information(5, 5) = 0;  // no information about the turn about z
  Symmetry symmetry;
  EXPECT_FALSE(boundFrom(information, Pose::Identity(), symmetry));
  symmetry.free_axis = Eigen::Vector3d::UnitZ();
  const auto bound = boundFrom(information, Pose::Identity(), symmetry);
  ASSERT_TRUE(bound);
  EXPECT_NEAR(bound->position, std::sqrt(3.0), 1e-9);
  EXPECT_NEAR(bound->orientation, std::sqrt(2.0), 1e-9);
}

}  // namespace
}  // namespace leap_object_tracker
