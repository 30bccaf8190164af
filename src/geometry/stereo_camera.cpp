#include "leap_object_tracker/geometry/stereo_camera.hpp"

#include <cmath>
#include <limits>

namespace leap_object_tracker {
namespace {

constexpr double kNoAnswer = std::numeric_limits<double>::quiet_NaN();
constexpr int kMostIterations = 50;

/// Coefficients with missing ones as zero, as OpenCV reads them.
struct Coefficients {
  explicit Coefficients(const std::vector<double>& values) : values_(values) {}
  double operator[](std::size_t i) const { return i < values_.size() ? values_[i] : 0.0; }
  const std::vector<double>& values_;
};

/// Ray to distorted normalised coordinates (OpenCV's model, k1 k2 p1 p2 k3 k4 k5 k6).
Eigen::Vector2d distortRational(const Coefficients& d, const Eigen::Vector2d& ray) {
  const double x = ray.x(), y = ray.y(), t = ray.squaredNorm();
  const double radial =
      (1 + t * (d[0] + t * (d[1] + t * d[4]))) / (1 + t * (d[5] + t * (d[6] + t * d[7])));
  return {x * radial + 2 * d[2] * x * y + d[3] * (t + 2 * x * x),
          y * radial + d[2] * (t + 2 * y * y) + 2 * d[3] * x * y};
}

/// Ray to distorted normalised coordinates (OpenCV's fisheye model, Kannala and Brandt 2006).
Eigen::Vector2d distortEquidistant(const Coefficients& d, const Eigen::Vector2d& ray) {
  const double radius = ray.norm();
  if (radius < 1e-12) return ray;
  const double theta = std::atan(radius), t = theta * theta;
  return ray * (theta * (1 + t * (d[0] + t * (d[1] + t * (d[2] + t * d[3])))) / radius);
}

/// Normalised raw coordinates to ray: the direction that the Leap's stored polynomial serves,
/// k1 k2 k3 / k4 k5 k6, p1 p2.
Eigen::Vector2d rayOfLeap(const Coefficients& d, const Eigen::Vector2d& raw) {
  const double x = raw.x(), y = raw.y(), t = raw.squaredNorm();
  const double radial =
      (1 + t * (d[0] + t * (d[1] + t * d[2]))) / (1 + t * (d[3] + t * (d[4] + t * d[5])));
  const double p1 = d[6], p2 = d[7];
  return {x * radial + 2 * p1 * x * y + p2 * (t + 2 * x * x),
          y * radial + p1 * (t + 2 * y * y) + 2 * p2 * x * y};
}

/// Solves forward(x) = target by Newton's method with a numeric Jacobian and step halving.
template <class Forward>
Eigen::Vector2d solve(const Forward& forward, const Eigen::Vector2d& target,
                      const Eigen::Vector2d& start) {
  Eigen::Vector2d x = start;
  Eigen::Vector2d error = forward(x) - target;
  for (int i = 0; i < kMostIterations; ++i) {
    if (error.norm() < 1e-11) return x;
    constexpr double kStep = 1e-6;
    Eigen::Matrix2d jacobian;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d ahead = x + kStep * Eigen::Vector2d::Unit(k);
      const Eigen::Vector2d behind = x - kStep * Eigen::Vector2d::Unit(k);
      jacobian.col(k) = (forward(ahead) - forward(behind)) / (2 * kStep);
    }
    const Eigen::Vector2d step = jacobian.inverse() * error;
    double scale = 1;
    for (int half = 0; half < 12; ++half, scale /= 2) {
      const Eigen::Vector2d candidate = x - scale * step;
      const Eigen::Vector2d candidate_error = forward(candidate) - target;
      if (candidate_error.norm() < error.norm()) {
        x = candidate;
        error = candidate_error;
        break;
      }
      if (half == 11) return error.norm() < 1e-8 ? x : Eigen::Vector2d(kNoAnswer, kNoAnswer);
    }
  }
  return error.norm() < 1e-8 ? x : Eigen::Vector2d(kNoAnswer, kNoAnswer);
}

/// Length of a raw vector of given ray length under a radial map, by bisection: a start for solve()
/// that cannot leave the lens.
template <class RadiusMap>
double invertRadius(const RadiusMap& map, double target, double largest) {
  double low = 0, high = largest;
  if (map(high) < target) return high;
  for (int i = 0; i < 40; ++i) {
    const double middle = (low + high) / 2;
    (map(middle) < target ? low : high) = middle;
  }
  return (low + high) / 2;
}

}  // namespace

Eigen::Vector2d rayFromPixel(const CameraCalibration& camera, const Eigen::Vector2d& pixel) {
  const Eigen::Vector2d raw((pixel.x() - camera.cx) / camera.fx,
                            (pixel.y() - camera.cy) / camera.fy);
  const Coefficients d(camera.distortion);
  switch (camera.distortion_model) {
    case DistortionModel::kNone:
      return raw;
    case DistortionModel::kLeapInverse:
      return rayOfLeap(d, raw);
    case DistortionModel::kEquidistant: {
      if (raw.norm() < 1e-12) return raw;
      const double radius = invertRadius(
          [&](double r) {
            return distortEquidistant(d, {r, 0}).x();
          },
          raw.norm(), 30.0);
      return raw * (radius / raw.norm());
    }
    case DistortionModel::kPlumbBob:
    case DistortionModel::kRationalPolynomial: {
      if (raw.norm() < 1e-12) return raw;
      const double radius = invertRadius(
          [&](double r) {
            const double t = r * r;
            return r * (1 + t * (d[0] + t * (d[1] + t * d[4]))) /
                   (1 + t * (d[5] + t * (d[6] + t * d[7])));
          },
          raw.norm(), 6.0);
      return solve([&](const Eigen::Vector2d& ray) { return distortRational(d, ray); }, raw,
                   raw * (radius / raw.norm()));
    }
  }
  return {kNoAnswer, kNoAnswer};
}

Eigen::Vector2d pixelFromRay(const CameraCalibration& camera, const Eigen::Vector2d& ray) {
  const Coefficients d(camera.distortion);
  Eigen::Vector2d raw(kNoAnswer, kNoAnswer);
  switch (camera.distortion_model) {
    case DistortionModel::kNone:
      raw = ray;
      break;
    case DistortionModel::kPlumbBob:
    case DistortionModel::kRationalPolynomial:
      raw = distortRational(d, ray);
      break;
    case DistortionModel::kEquidistant:
      raw = distortEquidistant(d, ray);
      break;
    case DistortionModel::kLeapInverse: {
      const double length = ray.norm();
      if (length < 1e-12) {
        raw = solve([&](const Eigen::Vector2d& at) { return rayOfLeap(d, at); }, ray, ray);
        break;
      }
      constexpr double kLensEdge = 3.6;  // the radial part is monotone to 3.5
      const double radius = invertRadius(
          [&](double r) {
            const double t = r * r;
            return r * (1 + t * (d[0] + t * (d[1] + t * d[2]))) /
                   (1 + t * (d[3] + t * (d[4] + t * d[5])));
          },
          length, kLensEdge);
      if (radius >= kLensEdge) return {kNoAnswer, kNoAnswer};
      raw = solve([&](const Eigen::Vector2d& at) { return rayOfLeap(d, at); }, ray,
                  ray * (radius / length));
      break;
    }
  }
  return {camera.cx + camera.fx * raw.x(), camera.cy + camera.fy * raw.y()};
}

}  // namespace leap_object_tracker
