#include "leap_object_tracker/tracking/contour_reach.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "leap_object_tracker/tracking/contour_model.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3f;

const Eigen::AlignedBox2f kEverything(Eigen::Vector2f(-1e3F, -1e3F), Eigen::Vector2f(1e3F, 1e3F));

TEST(ContourReach, isThatOfItsPoints) {
  const ContourModel model(makePrimitive("box", Shape::kBox, {0.02, 0.04, 0.06}), 96);
  const Eigen::Matrix3f rotation =
      Eigen::AngleAxisf(0.7F, Vector3f(1, 2, 3).normalized()).toRotationMatrix();
  const Vector3f origin(0.03F, -0.02F, 0.12F);
  const ViewChoice choice = model.choose(-(rotation.transpose() * origin));
  ASSERT_NE(choice.view, nullptr);
  const auto stride = static_cast<std::size_t>(model.points());
  const float* values = choice.view->arrays.data();
  for (const std::size_t count : {std::size_t{32}, stride}) {
    const ContourReach reach =
        reachOfContour(values, stride, count, origin, rotation, 0.02F, kEverything);
    float length = 0;
    Eigen::Array<float, ContourReach::kDirections, 1> extents;
    extents.setConstant(-1e9F);
    for (std::size_t i = 0; i < count; ++i) {
      const auto column = [&](std::size_t first) {
        return Vector3f(values[first * stride + i], values[(first + 1) * stride + i],
                        values[(first + 2) * stride + i]);
      };
      const Vector3f at = origin + rotation * column(0), along = rotation * column(3);
      const Eigen::Vector2f slope = at.head<2>() / at.z();
      length += (along.head<2>() - slope * along.z()).norm() / at.z();
      for (int k = 0; k < ContourReach::kDirections; ++k) {
        const double angle = 2 * M_PI * k / ContourReach::kDirections;
        extents[k] = std::max(extents[k], static_cast<float>(std::cos(angle)) * slope.x() +
                                              static_cast<float>(std::sin(angle)) * slope.y());
      }
    }
    EXPECT_NEAR(reach.length, length, 1e-4F * length);
    EXPECT_LT((reach.extents - extents).abs().maxCoeff(), 1e-5F);
  }
}

TEST(ContourReach, staysFiniteBesideTheEye) {
  const ContourModel model(makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03}), 96);
  const ViewChoice choice = model.choose(Vector3f(0, 0, -0.1F));
  ASSERT_NE(choice.view, nullptr);
  const auto stride = static_cast<std::size_t>(model.points());
  const auto reach = [&](float depth) {
    return reachOfContour(choice.view->arrays.data(), stride, stride, Vector3f(0, 0, depth),
                          Eigen::Matrix3f::Identity(), 0.02F, kEverything)
        .extents[0];
  };
  EXPECT_NEAR(reach(0.05F), 0.015F / 0.035F, 1e-5F);
  EXPECT_NEAR(reach(0.03F), 0.015F / 0.02F, 1e-5F) << "its near face is 15 mm away";
  EXPECT_NEAR(reach(-0.1F), 0.015F / 0.02F, 1e-5F) << "it is behind the eye";
}

TEST(ContourReach, countsTheLengthInsideTheWindow) {
  const ContourModel model(makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03}), 96);
  const ViewChoice choice = model.choose(Vector3f(0, 0, -0.1F));
  ASSERT_NE(choice.view, nullptr);
  const auto stride = static_cast<std::size_t>(model.points());
  const auto length = [&](const Eigen::AlignedBox2f& window) {
    return reachOfContour(choice.view->arrays.data(), stride, stride, Vector3f(0, 0, 0.1F),
                          Eigen::Matrix3f::Identity(), 0.02F, window)
        .length;
  };
  const float whole = length(kEverything);
  EXPECT_NEAR(length({Eigen::Vector2f(-9, -9), Eigen::Vector2f(0, 9)}), whole / 2, 0.1F * whole);
  EXPECT_EQ(length({Eigen::Vector2f(1, 1), Eigen::Vector2f(2, 2)}), 0);
}

}  // namespace
}  // namespace leap_object_tracker
