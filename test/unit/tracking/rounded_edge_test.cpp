#include "tracking/rounded_edge.hpp"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>

#include "leap_object_tracker/tracking/edge_profile.hpp"

namespace leap_object_tracker {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kAngle = M_PI / 2;  // between the normals

/// Normals in the plane of x and z, at angles from the light along z.
Vector3f normalAt(double angle) {
  return {static_cast<float>(std::sin(angle)), 0, static_cast<float>(std::cos(angle))};
}

Vector3f shiftOf(double first, double radius) {
  return roundedCreaseShift(normalAt(first), normalAt(first + kAngle), Vector3f::UnitY(),
                            Vector3f::UnitZ(), static_cast<float>(radius));
}

/// Where fitProfile() sees the edge of a blurred image, from `from` on.
/// @param brightness of a place
template <class Brightness>
double fittedAt(const Brightness& brightness, double from, double blur) {
  std::array<float, 15> grey{};
  for (std::size_t i = 0; i < grey.size(); ++i) {
    double sum = 0, weights = 0;
    for (double u = -5; u < 5; u += 0.01) {
      const double weight = std::exp(-0.5 * u * u / (blur * blur));
      sum += weight * brightness(from + static_cast<double>(i) - 7 + u);
      weights += weight;
    }
    grey[i] = static_cast<float>(200 * sum / weights);
  }
  const auto edge = fitProfile(grey.data(), -7, static_cast<int>(grey.size()), blur, {});
  EXPECT_TRUE(edge);
  return edge ? edge->offset : 1e3;
}

/// Where fitProfile() sees the edge between faces that a circle joins, from where its outline is.
double seenAt(double first, double radius, double blur) {
  const double last = first + kAngle;
  const Vector3d corner(radius * std::sin(first + kAngle / 2) / std::cos(kAngle / 2), 0, 0);
  const Vector3d outline = corner + roundedOutlineShift(normalAt(first).cast<double>(),
                                                        normalAt(last).cast<double>(), radius);
  const auto brightness = [&](double x) {
    if (x < radius * std::sin(first)) return std::cos(first);
    if (x > radius * std::sin(last)) return std::cos(last);
    return std::sqrt(1 - x * x / (radius * radius));
  };
  return fittedAt(brightness, outline.x(), blur);
}

TEST(RoundedEdge, showsItsCreaseWhereABlurredProfileHasIt) {
  constexpr double kBlur = 0.95;  // [px], as lengths are here
  for (const double radius : {0.15, 0.3, 0.6})
    for (double first = 0; first > -0.65; first -= 0.1) {
      const Vector3f shift = shiftOf(first, radius);
      EXPECT_NEAR(static_cast<double>(shift.x()), seenAt(first, radius, kBlur), 0.02)
          << radius << ' ' << first;
      EXPECT_NEAR(static_cast<double>(shift.y()), 0, 1e-6);
    }
}

TEST(RoundedEdge, showsItsCreaseOnTheSideOfTheDarkerFace) {
  EXPECT_GT(shiftOf(-0.5, 1).x(), 0.2F);
  EXPECT_LT(shiftOf(-kAngle + 0.5, 1).x(), -0.2F);
}

TEST(RoundedEdge, showsItsCreaseInTheSamePlaceWhicheverFaceComesFirst) {
  const Vector3f a = normalAt(-0.4), b = normalAt(-0.4 + kAngle), light(0.1F, 0.3F, 0.95F);
  const Vector3f one = roundedCreaseShift(a, b, Vector3f::UnitY(), light.normalized(), 1);
  const Vector3f two = roundedCreaseShift(b, a, -Vector3f::UnitY(), light.normalized(), 1);
  EXPECT_LT((one - two).norm(), 1e-5F);
}

/// Where fitProfile() sees the outline that a circle makes of a sharp edge, from
/// roundedOutlineShift on, away from the body. The sight is along z; the face that is seen lies
/// `tilt` off it.
double outlineSeenAt(double tilt, double between, double light, double radius, double blur) {
  const Vector3d seen(std::sin(tilt), 0, std::cos(tilt));
  const Vector3d hidden(std::sin(tilt + between), 0, std::cos(tilt + between));
  const Vector3d corner = (seen + hidden) * (radius / (1 + seen.dot(hidden)));
  const double from = (corner + roundedOutlineShift(seen, hidden, radius)).x();
  const auto brightness = [&](double x) {  // of the place x off the circle's centre
    if (x > radius) return 0.0;
    return std::cos(std::max(tilt, std::asin(std::max(-1.0, x / radius))) - light);
  };
  return fittedAt(brightness, from, blur);
}

TEST(RoundedEdge, showsItsOutlineWhereABlurredProfileHasIt) {
  constexpr double kBlur = 0.95;
  for (const double radius : {0.2, 0.5})
    for (const double between : {M_PI / 2, 2 * M_PI / 3})
      for (const double light : {-0.3, 0.0, 0.3})
        for (double tilt = 0; tilt < 0.9; tilt += 0.2) {
          if (tilt + between < M_PI / 2) continue;
          const Vector3f to_light(static_cast<float>(std::sin(light)), 0,
                                  static_cast<float>(std::cos(light)));
          const Vector3f shown =
              roundedOutlineShown(normalAt(tilt), normalAt(tilt + between), Vector3f::UnitY(),
                                  Vector3f::UnitZ(), to_light, static_cast<float>(radius));
          EXPECT_NEAR(static_cast<double>(shown.x()),
                      outlineSeenAt(tilt, between, light, radius, kBlur), 0.03 * radius + 0.005)
              << radius << ' ' << between << ' ' << light << ' ' << tilt;
          EXPECT_NEAR(static_cast<double>(shown.z()), 0, 1e-6);
        }
}

TEST(RoundedEdge, showsItsOutlineInABoundedPlaceWhateverTheLight) {
  for (double light = -M_PI; light < M_PI; light += 0.1) {
    const Vector3f shown = roundedOutlineShown(
        normalAt(0.4), normalAt(0.4 + kAngle), Vector3f::UnitY(), Vector3f::UnitZ(),
        Vector3f(static_cast<float>(std::sin(light)), 0, static_cast<float>(std::cos(light))), 1);
    EXPECT_TRUE(shown.allFinite()) << light;
    EXPECT_LT(shown.norm(), 1) << light;
  }
}

TEST(RoundedEdge, ofFacesThatAreEquallyBrightHasAShiftWithinItsBounds) {
  for (double off = -0.02; off < 0.02; off += 0.0005) {
    const Vector3f shift = shiftOf(-kAngle / 2 + off, 1);
    EXPECT_TRUE(shift.allFinite()) << off;
    EXPECT_LE(shift.norm(), 4.001F) << off;
  }
}

TEST(RoundedEdge, ofOneSurfaceHasNoShift) {
  EXPECT_EQ(
      roundedCreaseShift(normalAt(0), normalAt(0.05), Vector3f::UnitY(), Vector3f::UnitZ(), 1),
      Vector3f::Zero());
  EXPECT_EQ(roundedOutlineShift(Vector3d::UnitX(), Vector3d::UnitX(), 1), Vector3d::Zero());
}

}  // namespace
}  // namespace leap_object_tracker
