#include "leap_object_tracker/leap/distortion_fit.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace leap_object_tracker {
namespace {

constexpr int kColumns = 41, kRows = 31;  // of the grid of pixels
constexpr int kMostIterations = 100;
constexpr int kUnknowns = 12;  // fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6
using Unknowns = Eigen::Matrix<double, kUnknowns, 1>;

bool isRadial(int unknown) { return unknown >= 4 && unknown != 6 && unknown != 7; }

/// Inverse of the Leap's radial part, a start for the fit.
constexpr double kStart[8] = {0.9364419, 0.3558145, 0,         0,
                              0.0067608, 0.7389058, 0.3630318, 0.0180686};

struct Sample {
  Eigen::Vector2d ray;
  Eigen::Vector2d pixel;
};

CameraCalibration withUnknowns(CameraCalibration camera, const Unknowns& x) {
  camera.fx = x[0];
  camera.fy = x[1];
  camera.cx = x[2];
  camera.cy = x[3];
  camera.distortion_model = DistortionModel::kRationalPolynomial;
  camera.distortion.assign(x.data() + 4, x.data() + kUnknowns);
  return camera;
}

/// Differences [px]; binned rows count as the rows that they stand for.
Eigen::VectorXd residuals(const CameraCalibration& camera, const std::vector<Sample>& samples,
                          double row_weight) {
  Eigen::VectorXd r(2 * samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) {
    const Eigen::Vector2d difference = pixelFromRay(camera, samples[i].ray) - samples[i].pixel;
    r[2 * i] = difference.x();
    r[2 * i + 1] = difference.y() * row_weight;
  }
  return r;
}

std::vector<Sample> sampleGrid(const CameraCalibration& camera) {
  std::vector<Sample> samples;
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column) {
      const Eigen::Vector2d pixel((camera.size.width - 1.0) * column / (kColumns - 1),
                                  (camera.size.height - 1.0) * row / (kRows - 1));
      const Eigen::Vector2d ray = rayFromPixel(camera, pixel);
      if (ray.allFinite()) samples.push_back({ray, pixel});
    }
  return samples;
}

}  // namespace

DistortionFit fitRationalPolynomial(const CameraCalibration& camera, FitFreedom freedom) {
  const std::vector<Sample> samples = sampleGrid(camera);
  const double row_weight = camera.fx / camera.fy;
  Unknowns x;
  x << camera.fx, camera.fy, camera.cx, camera.cy,
      Eigen::Map<const Eigen::Matrix<double, 8, 1>>(kStart);

  const auto residualsAt = [&](const Unknowns& at) {
    return residuals(withUnknowns(camera, at), samples, row_weight);
  };
  Eigen::VectorXd r = residualsAt(x);
  double damping = 1e-3;
  for (int i = 0; i < kMostIterations && damping < 1e9; ++i) {
    Eigen::MatrixXd jacobian(r.size(), kUnknowns);
    for (int k = 0; k < kUnknowns; ++k) {
      if (freedom == FitFreedom::kRadialPart && !isRadial(k)) {
        jacobian.col(k).setZero();
        continue;
      }
      const double step = 1e-6 * std::max(1.0, std::abs(x[k]));
      jacobian.col(k) =
          (residualsAt(x + step * Unknowns::Unit(k)) - residualsAt(x - step * Unknowns::Unit(k))) /
          (2 * step);
    }
    Eigen::MatrixXd normal = jacobian.transpose() * jacobian;
    const Unknowns gradient = jacobian.transpose() * r;
    normal.diagonal() *= 1 + damping;
    normal.diagonal().array() += 1e-12;  // unknowns that are held keep a solvable system
    const Unknowns candidate = x - normal.ldlt().solve(gradient);
    const Eigen::VectorXd candidate_r = residualsAt(candidate);
    if (candidate_r.allFinite() && candidate_r.squaredNorm() < r.squaredNorm()) {
      const bool converged = r.squaredNorm() - candidate_r.squaredNorm() < 1e-9 * r.squaredNorm();
      x = candidate;
      r = candidate_r;
      damping = std::max(damping / 5, 1e-9);
      if (converged) break;
    } else {
      damping *= 10;
    }
  }
  DistortionFit fit;
  fit.camera = withUnknowns(camera, x);
  double sum = 0;
  for (Eigen::Index i = 0; i < r.size(); i += 2) {
    const double squared = r[i] * r[i] + r[i + 1] * r[i + 1];
    sum += squared;
    fit.largest = std::max(fit.largest, std::sqrt(squared));
  }
  fit.rms = std::sqrt(2 * sum / static_cast<double>(r.size()));
  return fit;
}

}  // namespace leap_object_tracker
