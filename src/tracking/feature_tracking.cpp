#include "leap_object_tracker/tracking/feature_tracking.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace leap_object_tracker {
namespace {

constexpr double kNoDoubt = 15;         // landmarks that leave no doubt of a pose
constexpr double kWorthWhile = 6;       // landmarks that carry a pose
constexpr int kWellKnownSide = 20;      // landmarks of which some would be recognised
constexpr double kNotSeen = 3;          // fewer are as good as none
constexpr std::size_t kTextured = 12;   // features of something that has texture
constexpr double kFewOfKnown = 0.2;     // features where that share of landmarks should be
constexpr double kClearContour = 0.75;  // share of it, above which features have little to add
constexpr double kHiddenContour = 0.6;  // share of it
constexpr int kTrial = 5;               // frames
constexpr int kReminder = 8;            // frames between looks at features that are not needed
constexpr int kFirstPeriod = 16;        // frames
constexpr int kLongestPeriod = 64;      // frames
constexpr int kRefusals = 25;           // frames
constexpr double kRecallSigma = 0.01;   // [m]
constexpr double kSameRoll = 0.15;      // [rad] that descriptors stand
constexpr int kFreeTurns = 12;          // tried about a free axis
constexpr double kSameRotation = 0.35;  // [rad]
constexpr double kFoundSigma = 0.002;   // [m]
constexpr double kFoundTurn = 0.15;     // [rad]
constexpr double kVoteKept = 0.8;       // of earlier frames
constexpr double kEnoughVotes = 15;     // landmarks of the best, all frames together
constexpr double kRecognised = 0.17;    // of the features, as landmarks
constexpr double kRecalled = 10;        // landmarks
constexpr double kClearlyFewer = 0.55;  // of the votes for the best

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
  restart(false);
}

void FeatureTracking::restart(bool sure) {
  observed_ = carried_ = false;
  forgetVotes();
  unsure_ = !sure && !measurement_.landmarks().landmarks().empty();
  doubts_ = 0;
  wait_ = 0;
  trial_ = kTrial;
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
  if (method_ == Measurement::kAuto && --wait_ > 0) return;
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

/// Whether none of the landmarks is there, of a side that is known well.
bool FeatureTracking::missing(const Pose& camera_from_object, const FeatureSupport& support) const {
  return support.landmark_points < kNotSeen && wouldKnow(camera_from_object);
}

bool FeatureTracking::contradict(const Pose& camera_from_object, double contour_support) const {
  return observed_ && !unsure_ &&
         (measurement_.features().size() >= kTextured || contour_support < kHiddenContour) &&
         missing(camera_from_object, measurement_.support(camera_from_object));
}

bool FeatureTracking::refuse(const Pose& found) const {
  const auto features = static_cast<double>(measurement_.features().size());
  const std::vector<Pose> poses = equivalents(found);
  return std::any_of(poses.begin(), poses.end(), [&](const Pose& pose) {
    const double expected = measurement_.landmarks().expected(pose);
    return expected >= kWellKnownSide &&
           (features >= static_cast<double>(kTextured) || features < kFewOfKnown * expected);
  });
}

void FeatureTracking::countRefusal() {
  if (++refusals_ < kRefusals) return;
  refusals_ = 0;
  forgetVotes();
  measurement_.landmarks().clear();
}

void FeatureTracking::forgetVotes() {
  votes_.clear();
  voters_ = 0;
}

std::optional<Pose> FeatureTracking::recall(const RectifiedStereoFrame& frame,
                                            const std::array<cv::Rect, 2>& regions,
                                            const Pose& near) {
  if (!usable(frame) || !wouldKnow(near)) return std::nullopt;
  measurement_.observe(frame, regions, near, kRecallSigma);
  const std::optional<Pose> located = measurement_.locate();
  if (!located) return std::nullopt;
  measurement_.expect(*located, kFoundSigma);
  const double landmarks = measurement_.support(*located).landmark_points;
  const auto features = static_cast<double>(measurement_.features().size());
  if (landmarks < std::max(kRecalled, kRecognised * features)) return std::nullopt;
  return located;
}

void FeatureTracking::conclude(const PoseBelief& belief, bool trusted, double contour_support) {
  if (!observed_) {
    // What hides the contour may leave enough of the texture.
    if (contour_support < kHiddenContour) wait_ = std::min(wait_, 1);
    return;
  }
  const FeatureSupport support = measurement_.support(belief.pose);
  if (missing(belief.pose, support))
    wait_ = 0;
  else
    keepWatch(support, contour_support);
  if (!trusted) return;
  refusals_ = 0;
  if (unsure_ && measurement_.features().size() >= kTextured && ++doubts_ > kRefusals) {
    // The matches of this frame are of the old map.
    measurement_.landmarks().clear();
    unsure_ = false;
    return;
  }
  if (unsure_) return;
  const Twist deviation = belief.poseCovariance().diagonal().cwiseMax(0).cwiseSqrt();
  measurement_.learn(belief.pose, deviation.head<3>().maxCoeff(), rotationSigma(belief));
  if (support.landmark_points >= kWorthWhile) carried_ = true;
}

/// When to look for features next: at once while they carry the pose and have something to add, now
/// and then while they are few and the contour says all, ever more rarely while they do not carry
/// it.
void FeatureTracking::keepWatch(const FeatureSupport& support, double contour_support) {
  wait_ = 0;
  if (support.landmark_points >= kWorthWhile) {
    trial_ = kTrial;
    period_ = kFirstPeriod;
    const bool enough = support.landmark_points < kNoDoubt && contour_support > kClearContour;
    if (enough && !symmetry_.hasFreeAxis()) wait_ = kReminder;
  } else if (--trial_ <= 0) {
    wait_ = period_;
    period_ = std::min(2 * period_, kLongestPeriod);
    trial_ = 1;
    if (support.surface_points >= static_cast<double>(kTextured)) trial_ = kTrial;
  }
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
  // In the order of the frames before, so that votes add up.
  voted_ = votes_.empty() ? found : nearestEquivalent(found, voted_, symmetry_);
  const std::vector<Pose> poses = equivalents(voted_);
  std::vector<Pose> refined = poses;
  votes_.resize(poses.size(), 0);
  voters_ *= kVoteKept;
  PosePrior prior;
  prior.information.diagonal() << Eigen::Vector3d::Constant(1 / (kFoundSigma * kFoundSigma)),
      Eigen::Vector3d::Constant(1 / (kFoundTurn * kFoundTurn));
  // Descriptors depend on how the camera is rolled against the views that landmarks were learnt in.
  std::vector<std::size_t> left(poses.size());
  std::iota(left.begin(), left.end(), std::size_t{0});
  while (!left.empty()) {
    const double roll = measurement_.landmarks().rollOf(poses[left.front()].linear());
    measurement_.observe(frame, regions, poses[left.front()], kFoundSigma);
    if (left.size() == poses.size()) voters_ += static_cast<double>(measurement_.features().size());
    const auto rest = std::stable_partition(left.begin(), left.end(), [&](std::size_t i) {
      const double other = measurement_.landmarks().rollOf(poses[i].linear());
      return std::abs(std::remainder(other - roll, 2 * M_PI)) < kSameRoll;
    });
    for (auto i = left.begin(); i != rest; ++i) {
      measurement_.expect(poses[*i], kFoundSigma);
      prior.mean = poses[*i];
      refined[*i] = measurement_.refine(prior).mean;
      votes_[*i] = kVoteKept * votes_[*i] + measurement_.support(refined[*i]).landmark_points;
    }
    left.erase(left.begin(), rest);
  }
  const auto best =
      static_cast<std::size_t>(std::max_element(votes_.begin(), votes_.end()) - votes_.begin());
  if (votes_[best] < std::max(kEnoughVotes, kRecognised * voters_)) return std::nullopt;
  for (std::size_t i = 0; i < poses.size(); ++i)
    if (votes_[i] > kClearlyFewer * votes_[best] &&
        angleBetween(refined[i].linear(), refined[best].linear()) > kSameRotation)
      return std::nullopt;
  unsure_ = false;
  forgetVotes();  // of this search, not of the next one
  return nearestEquivalent(found, refined[best], symmetry_);
}

}  // namespace leap_object_tracker
