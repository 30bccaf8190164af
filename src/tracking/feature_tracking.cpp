#include "leap_object_tracker/tracking/feature_tracking.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kNoDoubt = 15;        // landmarks that leave no doubt of a pose
constexpr double kWorthWhile = 6;      // landmarks for which features are looked for
constexpr int kTextured = 12;          // features on the surface that are worth a trial
constexpr int kWellKnownSide = 12;     // landmarks that would be recognised
constexpr double kKnownShare = 0.2;    // of the features on the surface
constexpr double kRecallSigma = 0.02;  // [m]
constexpr int kPatience = 5;           // frames
constexpr int kFirstPeriod = 8;        // frames
constexpr int kLongestPeriod = 64;
constexpr double kSameRoll = 0.35;      // [rad] that descriptors stand
constexpr int kFreeTurns = 12;          // tried about a free axis
constexpr double kSamePlace = 0.008;    // [m] between the pose of the contour and of landmarks
constexpr double kSameRotation = 0.35;  // [rad]
constexpr double kFoundSigma = 0.003;   // [m]

}  // namespace

FeatureTracking::FeatureTracking(const TrackerParams& params, const ObjectModel& object,
                                 const RectifiedStereoCamera& camera)
    : method_(params.measurement),
      two_eyes_(params.eyes == Eyes::kBoth),
      symmetry_(object.symmetry),
      radius_(radiusOf(object.mesh)),
      measurement_(params.feature, object, camera) {
  if (!params.feature.map_file.empty())
    measurement_.landmarks().load(params.feature.map_file, object.name);
  restart();
}

void FeatureTracking::restart() {
  observed_ = carried_ = false;
  active_ = true;
  patience_ = kPatience;
  wait_ = 0;
  period_ = kFirstPeriod;
}

double FeatureTracking::rotationSigma(const PoseBelief& belief) const {
  // Where features may be expected, not how well the spin is known that nothing shows.
  Eigen::Matrix3d covariance = belief.poseCovariance().bottomRightCorner<3, 3>();
  if (symmetry_.hasFreeAxis()) {
    const Eigen::Vector3d axis = belief.pose.linear() * symmetry_.free_axis;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - axis * axis.transpose();
    covariance = (across * covariance * across).eval();
  }
  return std::sqrt(std::max(0.0, covariance.diagonal().maxCoeff()));
}

double FeatureTracking::spotSigma(const PoseBelief& belief) const {
  const Twist deviation = belief.poseCovariance().diagonal().cwiseMax(0).cwiseSqrt();
  return std::hypot(deviation.head<3>().maxCoeff(), radius_ * deviation.tail<3>().maxCoeff());
}

bool FeatureTracking::usable(const RectifiedStereoFrame& frame) const {
  return method_ != Measurement::kContour && two_eyes_ && !frame.left.empty() &&
         !frame.right.empty();
}

void FeatureTracking::observe(const RectifiedStereoFrame& frame,
                              const std::array<cv::Rect, 2>& regions, const PoseBelief& belief) {
  observed_ = false;
  if (!usable(frame)) return;
  if (method_ == Measurement::kAuto && !active_ && --wait_ > 0) return;
  measurement_.observe(frame, regions, belief.pose, spotSigma(belief));
  observed_ = true;
}

void FeatureTracking::addScores(const ParticlePose* poses, std::size_t count,
                                float* log_likelihoods) const {
  if (!observed_) return;
  thread_local std::vector<float> own;
  own.resize(count);
  measurement_.score(poses, count, own.data());
  for (std::size_t i = 0; i < count; ++i) log_likelihoods[i] += own[i];
}

double FeatureTracking::score(const Pose& camera_from_object) const {
  if (!observed_) return 0;
  const ParticlePose pose = toParticlePose(camera_from_object);
  float value = 0;
  measurement_.score(&pose, 1, &value);
  return static_cast<double>(value);
}

PosePrior FeatureTracking::refine(const PosePrior& prior, const std::optional<Pose>& start) const {
  return observed_ ? measurement_.refine(prior, start) : prior;
}

double FeatureTracking::support(const Pose& camera_from_object) const {
  if (!observed_) return 0;
  return std::min(1.0, measurement_.support(camera_from_object).landmark_points / kNoDoubt);
}

bool FeatureTracking::wouldKnow(const Pose& camera_from_object) const {
  return measurement_.landmarks().expected(camera_from_object) >= kWellKnownSide;
}

bool FeatureTracking::contradict(const Pose& camera_from_object) const {
  if (!observed_ || !wouldKnow(camera_from_object)) return false;
  const FeatureSupport support = measurement_.support(camera_from_object);
  const double on_surface = support.surface_points + support.landmark_points;
  return on_surface >= kTextured && support.landmark_points < kKnownShare * on_surface;
}

std::optional<Pose> FeatureTracking::recall(const RectifiedStereoFrame& frame,
                                            const std::array<cv::Rect, 2>& regions,
                                            const Pose& near) {
  if (!usable(frame) || !wouldKnow(near)) return std::nullopt;
  measurement_.observe(frame, regions, near, kRecallSigma);
  return measurement_.locate();
}

void FeatureTracking::conclude(const PoseBelief& belief, bool trusted) {
  if (!observed_) return;
  const FeatureSupport support = measurement_.support(belief.pose);
  if (method_ == Measurement::kAuto) keepWatch(support);
  if (!trusted) return;
  const Twist deviation = belief.poseCovariance().diagonal().cwiseMax(0).cwiseSqrt();
  measurement_.learn(belief.pose, deviation.head<3>().maxCoeff(), rotationSigma(belief));
  if (support.landmark_points >= kWorthWhile) carried_ = true;
}

void FeatureTracking::keepWatch(const FeatureSupport& support) {
  if (support.landmark_points >= kWorthWhile) {
    active_ = true;
    patience_ = kPatience;
    period_ = kFirstPeriod;
    return;
  }
  if (!active_ && support.surface_points >= kTextured) {
    active_ = true;
    patience_ = kPatience;
  }
  if (active_ && --patience_ > 0) return;
  active_ = false;
  wait_ = period_;
  period_ = std::min(2 * period_, kLongestPeriod);
}

/// Orientations that look the same; a few of a free axis.
std::vector<Pose> FeatureTracking::equivalents(const Pose& pose) const {
  std::vector<Pose> poses;
  const int turns = symmetry_.hasFreeAxis() ? kFreeTurns : 1;
  for (const auto& rotation : symmetry_.rotations)
    for (int turn = 0; turn < turns; ++turn) {
      Pose equivalent = pose;
      equivalent.linear() = pose.linear() * rotation;
      if (turn > 0)
        equivalent.linear() =
            equivalent.linear() *
            Eigen::AngleAxisd(2 * M_PI * turn / turns, symmetry_.free_axis).toRotationMatrix();
      poses.push_back(equivalent);
    }
  return poses;
}

std::optional<Pose> FeatureTracking::absolute(const RectifiedStereoFrame& frame,
                                              const std::array<cv::Rect, 2>& regions,
                                              const Pose& found) {
  if (!usable(frame) || measurement_.landmarks().landmarks().empty()) return std::nullopt;
  // Descriptors depend on how the camera is rolled against the views that landmarks were learnt in.
  std::vector<double> rolls;
  for (const Pose& pose : equivalents(found)) {
    const double roll = measurement_.landmarks().rollOf(pose.linear());
    const bool known = std::any_of(rolls.begin(), rolls.end(), [&](double other) {
      return std::abs(std::remainder(roll - other, 2 * M_PI)) < kSameRoll;
    });
    if (known) continue;
    rolls.push_back(roll);
    measurement_.observe(frame, regions, pose, kFoundSigma);
    const std::optional<Pose> located = measurement_.locate();
    if (!located) continue;
    const Pose equivalent = nearestEquivalent(found, *located, symmetry_);
    if ((located->translation() - found.translation()).norm() < kSamePlace &&
        angleBetween(located->linear(), equivalent.linear()) < kSameRotation)
      return equivalent;
  }
  return std::nullopt;
}

}  // namespace leap_object_tracker
