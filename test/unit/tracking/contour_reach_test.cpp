#include "leap_object_tracker/tracking/contour_reach.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "leap_object_tracker/tracking/contour_model.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3f;

const Eigen::AlignedBox2f kEverything(Eigen::Vector2f(-1e3F, -1e3F), Eigen::Vector2f(1e3F, 1e3F));

TEST(PointReach, isThatOfTheFarthestPoint) {
  constexpr std::size_t kCount = 48;
  Eigen::Matrix<float, kCount, 3> points;
  for (Eigen::Index i = 0; i < points.rows(); ++i)
    points.row(i) << 0.03F * std::sin(1.7F * static_cast<float>(i)),
        0.02F * std::cos(2.9F * static_cast<float>(i)),
        0.04F * std::sin(4.1F * static_cast<float>(i));
  const Eigen::Matrix3f rotation =
      Eigen::AngleAxisf(0.7F, Vector3f(1, 2, 3).normalized()).toRotationMatrix();
  const Vector3f origin(0.03F, -0.02F, 0.12F);
  const PointReach reach = reachOfPoints(points.data(), kCount, origin, rotation, 0.02F);
  for (int k = 0; k < BrightRegion::kDirections; ++k) {
    const float angle =
        static_cast<float>(2 * M_PI) * static_cast<float>(k) / BrightRegion::kDirections;
    float most = -1e9F;
    const auto extent = [&](Eigen::Index i) {
      const Vector3f at = origin + rotation * points.row(i).transpose();
      return (std::cos(angle) * at.x() + std::sin(angle) * at.y()) / at.z();
    };
    for (Eigen::Index i = 0; i < points.rows(); ++i) most = std::max(most, extent(i));
    EXPECT_NEAR(reach.extents[k], most, 1e-5F);
    EXPECT_NEAR(extent(reach.farthest[k]), most, 1e-5F);
  }
}

TEST(PointReach, staysFiniteBesideTheEye) {
  std::array<float, 48> corners{};  // of a cube of 30 mm, each twice
  for (std::size_t i = 0; i < 16; ++i)
    for (std::size_t axis = 0; axis < 3; ++axis)
      corners[16 * axis + i] = (i >> axis & 1) != 0 ? 0.015F : -0.015F;
  const auto reach = [&](float depth) {
    return reachOfPoints(corners.data(), 16, Vector3f(0, 0, depth), Eigen::Matrix3f::Identity(),
                         0.02F)
        .extents[0];
  };
  EXPECT_NEAR(reach(0.05F), 0.015F / 0.035F, 1e-5F);
  EXPECT_NEAR(reach(0.03F), 0.015F / 0.02F, 1e-5F) << "its near face is 15 mm away";
  EXPECT_NEAR(reach(-0.1F), 0.015F / 0.02F, 1e-5F) << "it is behind the eye";
}

TEST(ContourLength, isThatOfItsPoints) {
  const ContourModel model(makePrimitive("box", Shape::kBox, {0.02, 0.04, 0.06}), 96);
  const Eigen::Matrix3f rotation =
      Eigen::AngleAxisf(0.7F, Vector3f(1, 2, 3).normalized()).toRotationMatrix();
  const Vector3f origin(0.03F, -0.02F, 0.12F);
  const ViewChoice choice = model.choose(-(rotation.transpose() * origin));
  ASSERT_NE(choice.view, nullptr);
  const auto stride = static_cast<std::size_t>(model.points());
  const float* values = choice.view->arrays.data();
  for (const std::size_t count : {std::size_t{32}, stride}) {
    float length = 0;
    for (std::size_t i = 0; i < count; ++i) {
      const auto column = [&](std::size_t first) {
        return Vector3f(values[first * stride + i], values[(first + 1) * stride + i],
                        values[(first + 2) * stride + i]);
      };
      const Vector3f at = origin + rotation * column(0), along = rotation * column(3);
      const Eigen::Vector2f slope = at.head<2>() / at.z();
      length += (along.head<2>() - slope * along.z()).norm() / at.z();
    }
    EXPECT_NEAR(contourLengthInside(values, stride, count, origin, rotation, 0.02F, kEverything),
                length, 1e-4F * length);
  }
}

TEST(ContourLength, isThatInsideTheWindow) {
  const ContourModel model(makePrimitive("cube", Shape::kBox, {0.03, 0.03, 0.03}), 96);
  const ViewChoice choice = model.choose(Vector3f(0, 0, -0.1F));
  ASSERT_NE(choice.view, nullptr);
  const auto stride = static_cast<std::size_t>(model.points());
  const auto length = [&](const Eigen::AlignedBox2f& window) {
    return contourLengthInside(choice.view->arrays.data(), stride, stride, Vector3f(0, 0, 0.1F),
                               Eigen::Matrix3f::Identity(), 0.02F, window);
  };
  const float whole = length(kEverything);
  EXPECT_NEAR(length({Eigen::Vector2f(-9, -9), Eigen::Vector2f(0, 9)}), whole / 2, 0.1F * whole);
  EXPECT_EQ(length({Eigen::Vector2f(1, 1), Eigen::Vector2f(2, 2)}), 0);
}

}  // namespace
}  // namespace leap_object_tracker
