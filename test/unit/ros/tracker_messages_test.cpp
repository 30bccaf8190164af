#include "ros/tracker_messages.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

ObjectModel smallCube() {
  return makePrimitive("cube", Shape::kBox, Eigen::Vector3d(0.03, 0.03, 0.03));
}

Pose ahead(double x, double z) {
  Pose pose = Pose::Identity();
  pose.translation() = Eigen::Vector3d(x, 0, z);
  return pose;
}

const RectifiedStereoCamera kCamera{100, 99.5, 49.5, 0.04, {200, 100}};

TEST(TrackerMessages, regionHoldsTheProjectedCube) {
  // The near face at z = 0.085 spans +-0.015 m: +-17.6 px about the centre.
  const auto region = regionMessage(kCamera, smallCube(), ahead(0, 0.1));
  EXPECT_EQ(region->x_offset, 81u);
  EXPECT_EQ(region->y_offset, 31u);
  EXPECT_EQ(region->width, 36u);
}

TEST(TrackerMessages, regionIsCutAtTheBorderOfTheImage) {
  const auto region = regionMessage(kCamera, smallCube(), ahead(0.1, 0.1));
  EXPECT_LE(region->x_offset + region->width, 200u);
  EXPECT_GT(region->width, 0u);
  EXPECT_EQ(regionMessage(kCamera, smallCube(), ahead(1.0, 0.1))->width, 0u);
}

TEST(TrackerMessages, particlesAreThinnedOut) {
  const std::vector<Pose> particles(1000, Pose::Identity());
  EXPECT_EQ(particlesMessage(particles, 200, {})->poses.size(), 200u);
  EXPECT_EQ(particlesMessage(particles, 0, {})->poses.size(), 0u);
  EXPECT_EQ(particlesMessage({}, 200, {})->poses.size(), 0u);
  EXPECT_LE(particlesMessage(particles, 300, {})->poses.size(), 300u);
}

TEST(TrackerMessages, covarianceIsRowByRow) {
  PoseEstimate estimate;
  estimate.camera_from_object = ahead(0, 0.1);
  estimate.covariance = Matrix6d::Zero();
  estimate.covariance(0, 5) = 3;
  EXPECT_DOUBLE_EQ(poseMessage(estimate, {})->pose.covariance[5], 3);
}

TEST(TrackerMessages, meshRidesOnTheFrameOfTheObject) {
  const auto shown = meshMessage(smallCube(), "cube_frame", true);
  EXPECT_EQ(shown->markers[0].header.frame_id, "cube_frame");
  EXPECT_EQ(shown->markers[0].points.size(), 36u);  // 12 triangles
  EXPECT_EQ(meshMessage(smallCube(), "cube_frame", false)->markers[0].action,
            visualization_msgs::Marker::DELETE);
}

TEST(TrackerMessages, ordersAreReadFromWords) {
  EXPECT_EQ(orderFrom("search").kind, TrackerOrder::Kind::kSearch);
  EXPECT_EQ(orderFrom("wait").kind, TrackerOrder::Kind::kStop);
  EXPECT_EQ(orderFrom("0 0 0.1 0 0 0 1").kind, TrackerOrder::Kind::kStart);
  EXPECT_THROW(orderFrom("truth"), std::invalid_argument);
}

}  // namespace
}  // namespace leap_object_tracker
