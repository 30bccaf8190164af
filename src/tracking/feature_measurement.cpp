#include "leap_object_tracker/tracking/feature_measurement.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kRange = 0.03;         // [m] over which a point of something else may lie anywhere
constexpr double kNearestDepth = 0.02;  // [m]
constexpr double kLeastReach = 0.003;   // [m] in which the landmark of a feature is looked for
constexpr double kLocateTolerance = 0.002;  // [m]
constexpr int kIterations = 10;             // of Gauss-Newton, at most
constexpr double kStill = 1e-5;             // [m] a smaller step is the last
constexpr double kTrusted = 0.5;            // probability that a feature belongs to the object

/// log(1 + exp(x))
double softplus(double x) { return std::max(x, 0.0) + std::log1p(std::exp(-std::abs(x))); }
double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d matrix;
  matrix << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return matrix;
}

}  // namespace

FeatureMeasurement::FeatureMeasurement(const FeatureParams& params, const ObjectModel& object,
                                       const RectifiedStereoCamera& camera, CornerDetector detector)
    : params_(params),
      distance_(object),
      radius_(radiusOf(object.mesh)),
      free_axis_(object.symmetry.free_axis),
      extractor_(params, camera, detector),
      landmarks_(params.landmarks) {}

void FeatureMeasurement::observe(const RectifiedStereoFrame& frame,
                                 const std::array<cv::Rect, 2>& regions, const Pose& predicted,
                                 double uncertainty) {
  FeatureWindow window;
  window.regions = regions;
  const double reach = radius_ + 3 * uncertainty;
  window.nearest = std::max(kNearestDepth, predicted.translation().z() - reach);
  window.farthest = std::max(2 * kNearestDepth, predicted.translation().z() + reach);
  window.roll = landmarks_.rollOf(predicted.linear());
  features_ = extractor_.extract(frame, window);
  expect(predicted, uncertainty);
}

void FeatureMeasurement::expect(const Pose& predicted, double uncertainty) {
  landmarks_.match(features_, predicted, std::max(kLeastReach, 3 * uncertainty), matches_);
  makePoints();
}

void FeatureMeasurement::makePoints() {
  points_.clear();
  arrays_.clear();
  // Densities of a mixture: of the object, or anywhere within the range.
  const double odds = (1 - params_.outlier_share) / params_.outlier_share;
  for (std::size_t i = 0; i < features_.size(); ++i) {
    const StereoFeature& feature = features_[i];
    Point point;
    point.in_camera = feature.point_in_camera.cast<float>();
    const double model_variance = params_.model_sigma * params_.model_sigma;
    const Eigen::Vector3d ray = feature.point_in_camera.normalized();
    const double variance = ray.dot(feature.covariance * ray) + model_variance;
    point.variance = static_cast<float>(variance);
    point.peak = static_cast<float>(std::log(odds * kRange / std::sqrt(2 * M_PI * variance)));
    if (matches_[i] >= 0) {
      const Landmark& landmark = landmarks_.landmarks()[static_cast<std::size_t>(matches_[i])];
      // The landmark's own variance is the same in all directions, so that no rotation enters.
      const Eigen::Matrix3d covariance =
          feature.covariance + (landmark.variance + model_variance) * Eigen::Matrix3d::Identity();
      point.has_landmark = true;
      point.landmark = landmark.position;
      point.information = covariance.inverse().cast<float>();
      const double volume = std::pow(2 * M_PI, 1.5) * std::sqrt(covariance.determinant());
      point.peak = static_cast<float>(std::log(odds * std::pow(kRange, 3) / volume));
    }
    points_.push_back(point);
    if (point.has_landmark)
      arrays_.addLandmark(point.in_camera, point.landmark, point.information, point.peak);
    else
      arrays_.addSurfacePoint(point.in_camera, point.variance, point.peak);
  }
  arrays_.pad();
}

void FeatureMeasurement::score(const ParticlePose* poses, std::size_t count,
                               float* log_likelihood) const {
  scoreFeatures(arrays_, distance_, static_cast<float>(params_.independent_share), poses, count,
                log_likelihood);
}

FeatureSupport FeatureMeasurement::support(const Pose& camera_from_object) const {
  FeatureSupport sums;
  const Eigen::Matrix3d& rotation = camera_from_object.linear();
  for (const Point& point : points_) {
    const Eigen::Vector3d arm = point.in_camera.cast<double>() - camera_from_object.translation();
    if (point.has_landmark) {
      const Eigen::Vector3d turned = rotation * point.landmark.cast<double>();
      const Eigen::Vector3d apart = arm - turned;
      const Eigen::Matrix3d weight = point.information.cast<double>();
      const double exponent = point.peak - 0.5 * apart.dot(weight * apart);
      const double belongs = sigmoid(exponent);
      Eigen::Matrix<double, 3, 6> jacobian;  // of the landmark's place by the camera twist
      jacobian << Eigen::Matrix3d::Identity(), -skew(turned);
      sums.landmark_information += belongs * jacobian.transpose() * weight * jacobian;
      sums.landmark_gradient += belongs * jacobian.transpose() * weight * apart;
      sums.log_likelihood += softplus(exponent);
      sums.landmark_points += belongs;
    } else {
      Eigen::Vector3f slope;
      const double distance = distance_((rotation.transpose() * arm).cast<float>(), slope);
      const Eigen::Vector3d normal = rotation * slope.cast<double>();
      const double exponent = point.peak - 0.5 * distance * distance / point.variance;
      const double belongs = sigmoid(exponent);
      Twist jacobian;  // of minus the distance by the camera twist
      jacobian << normal, arm.cross(normal);
      sums.information += belongs / point.variance * jacobian * jacobian.transpose();
      sums.gradient += belongs / point.variance * distance * jacobian;
      sums.log_likelihood += softplus(exponent);
      sums.surface_points += belongs;
    }
  }
  sums.landmark_information *= params_.independent_share;
  sums.landmark_gradient *= params_.independent_share;
  sums.information = params_.independent_share * sums.information + sums.landmark_information;
  sums.gradient = params_.independent_share * sums.gradient + sums.landmark_gradient;
  sums.log_likelihood *= params_.independent_share;
  return sums;
}

/// Of the camera twist that all landmarks may be off by.
Matrix6d FeatureMeasurement::mapCovariance(const Pose& camera_from_object) const {
  const Eigen::Vector3d axis = camera_from_object.linear() * free_axis_;
  Matrix6d covariance = Matrix6d::Zero();
  covariance.topLeftCorner<3, 3>().diagonal().setConstant(std::pow(params_.map_position_sigma, 2));
  covariance.bottomRightCorner<3, 3>() = std::pow(params_.map_rotation_sigma_deg * M_PI / 180, 2) *
                                         (Eigen::Matrix3d::Identity() - axis * axis.transpose());
  return covariance;
}

PosePrior FeatureMeasurement::refine(const PosePrior& prior,
                                     const std::optional<Pose>& start) const {
  PosePrior posterior = prior;
  if (start) posterior.mean = *start;
  for (int i = 0; i < kIterations; ++i) {
    const FeatureSupport sums = support(posterior.mean);
    // (information^-1 + map covariance)^-1, also where the information is singular.
    const Matrix6d blur =
        Matrix6d::Identity() + sums.landmark_information * mapCovariance(posterior.mean);
    const Eigen::PartialPivLU<Matrix6d> bounded(blur);
    const Matrix6d landmark_information = bounded.solve(sums.landmark_information);
    const Twist landmark_gradient = bounded.solve(sums.landmark_gradient);
    const Twist from_prior = cameraTwistBetween(prior.mean, posterior.mean);
    posterior.information = prior.information + sums.information - sums.landmark_information +
                            0.5 * (landmark_information + landmark_information.transpose());
    const Twist gradient = sums.gradient - sums.landmark_gradient + landmark_gradient;
    const Twist step =
        posterior.information.ldlt().solve(Twist(gradient - prior.information * from_prior));
    if (!step.allFinite()) return prior;
    posterior.mean = normalized(movedInCamera(posterior.mean, step));
    if (step.head<3>().norm() < kStill && step.tail<3>().norm() < kStill / radius_) break;
  }
  return posterior;
}

void FeatureMeasurement::learn(const Pose& camera_from_object, double position_sigma,
                               double rotation_sigma) {
  const Pose object_from_camera = camera_from_object.inverse();
  on_surface_.assign(features_.size(), false);
  for (std::size_t i = 0; i < features_.size(); ++i) {
    const Point& point = points_[i];
    const Eigen::Vector3f spot = (object_from_camera * features_[i].point_in_camera).cast<float>();
    const float distance = distance_(spot);
    on_surface_[i] = distance * distance < 9 * point.variance;
    if (!point.has_landmark) continue;
    const Eigen::Vector3d apart =
        features_[i].point_in_camera - camera_from_object * point.landmark.cast<double>();
    if (sigmoid(point.peak - 0.5 * apart.dot(point.information.cast<double>() * apart)) < kTrusted)
      on_surface_[i] = false;
  }
  const double turn = radius_ * rotation_sigma;
  landmarks_.learn(features_, matches_, on_surface_, camera_from_object,
                   position_sigma * position_sigma + turn * turn);
}

std::optional<Pose> FeatureMeasurement::locate() const {
  return landmarks_.locate(features_, kLocateTolerance);
}

}  // namespace leap_object_tracker
