#include <Eigen/Dense>
#include <cmath>
#include <vector>

#include "leap_object_tracker/simulation/simulator.hpp"

namespace leap_object_tracker {
namespace {

using Vector12 = Eigen::Matrix<double, 12, 1>;  // fx fy cx cy, k1 k2 p1 p2 k3 k4 k5 k6

struct Sample {
  Eigen::Vector2d ray;
  Eigen::Vector2d pixel;
  double weight;
};

/// OpenCV's rational model.
Eigen::Vector2d project(const Vector12& m, const Eigen::Vector2d& ray) {
  const double x = ray.x(), y = ray.y(), t = ray.squaredNorm();
  const double radial =
      (1 + t * (m[4] + t * (m[5] + t * m[8]))) / (1 + t * (m[9] + t * (m[10] + t * m[11])));
  return {m[2] + m[0] * (x * radial + 2 * m[6] * x * y + m[7] * (t + 2 * x * x)),
          m[3] + m[1] * (y * radial + m[6] * (t + 2 * y * y) + 2 * m[7] * x * y)};
}

constexpr double kCentralSlope = 1.2;  // tan of 50 deg

/// A grid over the image; weights fall towards the rim, where objects are not tracked.
std::vector<Sample> samplesOf(const LeapLens& lens) {
  std::vector<Sample> samples;
  constexpr int kColumns = 64, kRows = 48;
  for (int i = 0; i <= kColumns; ++i)
    for (int j = 0; j <= kRows; ++j) {
      const Eigen::Vector2d pixel((lens.mode().width - 1.0) * i / kColumns,
                                  (lens.mode().height - 1.0) * j / kRows);
      const Eigen::Vector2d ray = lens.rawRay(pixel.x(), pixel.y());
      const double slope = ray.norm() / kCentralSlope;
      samples.push_back({ray, pixel, 1 / (1 + slope * slope * slope * slope)});
    }
  return samples;
}

/// Errors in pixels of the 480-row grid, so that rows and columns weigh the same.
Eigen::VectorXd errorsOf(const Vector12& model, const std::vector<Sample>& samples,
                         double rows_per_pixel) {
  Eigen::VectorXd errors(2 * static_cast<Eigen::Index>(samples.size()));
  Eigen::Index row = 0;
  for (const auto& sample : samples) {
    const Eigen::Vector2d error = project(model, sample.ray) - sample.pixel;
    errors[row++] = sample.weight * error.x();
    errors[row++] = sample.weight * rows_per_pixel * error.y();
  }
  return errors;
}

/// Levenberg and Marquardt with a numeric Jacobian.
CameraCalibration fitEye(const LeapLens& lens, double& rms, double& largest) {
  const std::vector<Sample> samples = samplesOf(lens);
  const double rows = lens.mode().rowsPerPixel();
  Vector12 model;
  model << lens.fx(), lens.fy(), lens.cx(), lens.cy(), 0.9364419, 0.3558145, 0, 0, 0.0067608,
      0.7389058, 0.3630318, 0.0180686;
  Eigen::VectorXd errors = errorsOf(model, samples, rows);
  double damping = 1e-3;
  constexpr int kIterations = 100;
  for (int i = 0; i < kIterations; ++i) {
    Eigen::MatrixXd jacobian(errors.size(), 12);
    for (int k = 0; k < 12; ++k) {
      const double step = 1e-6 * std::max(1.0, std::abs(model[k]));
      Vector12 ahead = model, behind = model;
      ahead[k] += step;
      behind[k] -= step;
      jacobian.col(k) =
          (errorsOf(ahead, samples, rows) - errorsOf(behind, samples, rows)) / (2 * step);
    }
    Eigen::Matrix<double, 12, 12> normal = jacobian.transpose() * jacobian;
    const Vector12 gradient = jacobian.transpose() * errors;
    normal.diagonal() *= 1 + damping;
    const Vector12 candidate = model - normal.ldlt().solve(gradient);
    const Eigen::VectorXd candidate_errors = errorsOf(candidate, samples, rows);
    if (candidate_errors.squaredNorm() < errors.squaredNorm()) {
      model = candidate;
      errors = candidate_errors;
      damping = std::max(1e-12, damping / 5);
    } else {
      damping *= 4;
    }
  }

  double sum = 0;
  int count = 0;
  largest = 0;
  for (const auto& sample : samples) {
    if (sample.ray.norm() > kCentralSlope) continue;
    Eigen::Vector2d error = project(model, sample.ray) - sample.pixel;
    error.y() *= rows;
    sum += error.squaredNorm();
    largest = std::max(largest, error.norm());
    ++count;
  }
  rms = std::sqrt(sum / count);

  CameraCalibration camera;
  camera.size = cv::Size(lens.mode().width, lens.mode().height);
  camera.fx = model[0];
  camera.fy = model[1];
  camera.cx = model[2];
  camera.cy = model[3];
  camera.distortion_model = DistortionModel::kRationalPolynomial;
  camera.distortion.assign(model.data() + 4, model.data() + 12);
  camera.rectified_from_raw = lens.rectifiedFromRaw();
  return camera;
}

}  // namespace

FittedCalibration fitCalibration(const LeapUnit& unit, const SensorMode& mode) {
  FittedCalibration fitted;
  fitted.calibration.baseline = unit.baseline;
  fitted.calibration.left = fitEye(LeapLens(unit.left, mode), fitted.left_rms, fitted.left_largest);
  fitted.calibration.right =
      fitEye(LeapLens(unit.right, mode), fitted.right_rms, fitted.right_largest);
  return fitted;
}

}  // namespace leap_object_tracker
