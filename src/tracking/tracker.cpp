#include "leap_object_tracker/tracking/tracker.hpp"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "leap_object_tracker/tracking/contour_measurement.hpp"
#include "leap_object_tracker/tracking/feature_tracking.hpp"
#include "leap_object_tracker/tracking/mirrored_poses.hpp"
#include "leap_object_tracker/tracking/particle_budget.hpp"
#include "leap_object_tracker/tracking/particle_filter.hpp"
#include "leap_object_tracker/tracking/pose_belief.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/pose_search.hpp"
#include "leap_object_tracker/tracking/textured_surface.hpp"
#include "leap_object_tracker/tracking/turned_rivals.hpp"
#include "tracking/best_first.hpp"

namespace leap_object_tracker {
namespace {

using Clock = std::chrono::steady_clock;

double millisecondsSince(Clock::time_point start) {
  return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

constexpr double kLongestStep = 0.25;     // [s] longer gaps count as this long
constexpr int kHypotheses = 4;            // refined a frame
constexpr double kPoorFit = 0.45;         // [px] of the edges' residual
constexpr double kWorseFit = 1.25;        // times the residual of the frames before
constexpr int kMoreHypotheses = 16;       // refined then
constexpr int kSides = 6;                 // left out in turn then
constexpr std::size_t kCandidates = 300;  // of the particles, to be refined
constexpr double kCommonPixels = 0.04;    // [px] of calibration
constexpr double kCommonLines = 5;        // of the contour that err each for itself
constexpr double kCommonShape = 3e-5;     // [m] of the object's shape
// RefinedPose::scatter of poses that err as their information says. It is not 1, as lines share
// errors that the fit takes up and no residual shows.
constexpr double kUsualScatter = 0.4;
constexpr double kLeastScatter = 0.1, kMostScatter = 5;  // of it
constexpr double kScatterRate = 0.1;                     // a frame
constexpr double kUnknownSpin = 0.25;                    // [rad] of a free axis that nothing binds
constexpr double kDoubtShare = 0.3;     // of the particles, drawn as if the last pose were wrong
constexpr double kDoubtReach = 4;       // [px] by which it then lies off
constexpr double kLeastTurn = 0.15;     // [rad] of a least bound direction that is doubtful
constexpr double kFarthestTurn = 0.4;   // [rad] of one that nothing binds
constexpr double kClearlyBetter = 8;    // [nats] by which such a pose must be better
constexpr double kDoubtCost = 5;        // [nats] against a pose that says so
constexpr double kNearMisfit = 0.3;     // of RefinedPose::misfit, between poses close to each other
constexpr double kMirroredMargin = 2;   // [nats] by which a mirrored pose must be better
constexpr double kLeastSupport = 0.40;  // share of the contour to stand by a pose
constexpr double kLeastExactSupport = 0.28;  // the same, if what is seen lies exactly on edges
constexpr double kLearningSupport = 0.7;     // of a pose at which the object's looks are learned
constexpr int kFirstFrames = 8;   // after a start, in which turned poses are looked at every time
constexpr int kYoungFrames = 80;  // the same, often
constexpr int kYoungPeriod = 2, kOldPeriod = 12;  // [frames]
constexpr double kTrustedLandmarks = 0.5;  // share of landmarks that make turned poses needless
constexpr double kTextureSupport = 0.6;    // share of the learned texture, to stand by a pose
constexpr double kTextureLearningSupport = 0.78;  // of a pose at which texture is learned
// Of the covariance of the contour alone: what is left after so many frames of learning, of errors
// that are much alike from frame to frame.
constexpr double kLearnedError = 0.4;
constexpr int kSettled = 4;               // such frames after a start before it is
constexpr double kExact = 0.5;            // [px]
constexpr double kLittleSupport = 0.45;   // which does not outweigh evidence against the pose
constexpr double kUnbrokenSupport = 0.9;  // of a track that missing landmarks do not end
constexpr double kNothingLeft = 0.15;     // support at which the object is lost at once
constexpr int kPatience = 3;              // frames below it before the object counts as lost
constexpr double kFoundSupport = 0.68;    // share of the contour that a found pose must have
constexpr double kSureStart = 0.80;       // support that needs no other frame to prove itself
constexpr double kRefoundSupport = 0.6;   // the same, close to where the object was last
constexpr double kRefoundReach = 0.03;    // [m]
// Less is enough where the object was a moment ago, and nobody else looks like it there.
constexpr double kSameReach = 0.015, kSameTurn = 0.35;  // [m], [rad]
constexpr double kSameSupport = 0.48, kSameStrength = 0.12;
constexpr double kFoundStrength = 0.1, kRefoundStrength = 0.05;  // [nats/px] likewise
constexpr double kFaintStrength = 0.1;  // [nats/px] of a pose that does not last
constexpr double kProvenStrength = 0.3, kLeastStrength = 0.2;  // [nats/px] once, and until then
constexpr double kFoundInside = 0.3;       // share of the contour inside the images
constexpr double kLeastEvidence = 60;      // [nats] of a start: chance brings about as much
constexpr double kLeastOfOneEye = 100;     // [nats] where no other eye can contradict
constexpr double kClearStrength = 0.6;     // [nats/px] of a small one that needs less
constexpr double kSameSurface = 0.1;       // of the radius, by which a body may differ from itself
constexpr double kClearLead = 20;          // [nats] of a start over the same body turned otherwise
constexpr double kClearLeadOfMesh = 40;    // of one whose contour is modelled less exactly
constexpr double kCompelling = 160;        // [nats] of evidence that chance does not bring about
constexpr double kCompelledSupport = 0.6;  // and what then is enough
constexpr double kCompelledInside = 0.15;  // likewise
constexpr double kClearEvidence = 80, kClearSupport = 0.75;  // the same, of a pose well supported
constexpr double kSureSupport = 0.7;                 // below it the search is asked for its opinion
constexpr int kFirstOpinion = 6, kLastOpinion = 96;  // [frames] between two of them
constexpr double kOpinionMargin = 20;                // [nats] by which another pose must be better
constexpr double kOpinionSupport = 0.15;             // and have more support
constexpr double kLostSpread = 0.005;     // [m] of a pose without support that is given up at once
constexpr double kLandmarkSupport = 0.6;  // FeatureTracking::support to stand by a pose
constexpr float kOutsideVolume = 1000;    // [nats] against a pose outside the working volume
constexpr int kNearFrames = 30;  // for which a lost object is looked for near its last pose
constexpr double kRecallPositionSigma = 0.01;  // [m]
constexpr double kRecallRotationSigma = 0.3;   // [rad]
// Of what is found once more so soon the velocity is known, unless it is higher.
constexpr double kFoundAgain = 0.15;               // [s]
constexpr double kBlurring = 1;                    // [m/s]
constexpr double kFastest = 4, kFastestTurn = 20;  // [m/s], [rad/s]
constexpr double kFoundPositionSigma = 0.003;      // [m]
constexpr double kFoundRotationSigma = 0.05;       // [rad]

/// [nats] by which a prior speaks against a pose.
double surprise(const PosePrior& prior, const Pose& pose) {
  const Twist shift = cameraTwistBetween(prior.mean, pose);
  return 0.5 * shift.dot(prior.information * shift);
}

void check(bool right, const char* message) {
  if (!right) throw std::invalid_argument(message);
}

}  // namespace

class Tracker::Impl {
 public:
  Impl(const TrackerParams& params, const ObjectModel& object, const RectifiedStereoCamera& camera)
      : params_(params),
        object_(object),
        camera_(camera),
        model_(object, params.contour.points, params.contour.edge_radius,
               params.contour.cache_folder),
        filter_(params.filter),
        budget_(params.filter),
        measurement_(params.contour, params.eyes, camera),
        refiner_(params.contour, camera),
        mirrored_(object),
        surface_(object, camera),
        features_(params, object_, camera),
        search_(params, object_, model_, camera),
        rivals_(object_.symmetry, model_, refiner_, search_.shadedView(), camera.baseline),
        arena_(std::max(1, params.threads)) {
    check(camera.focal_length > 0 && camera.baseline > 0 && camera.size.area() > 0,
          "tracker: the camera needs a focal length, a baseline and a size");
    check(!object.mesh.vertices.empty(), "tracker: the object has no mesh");
    Eigen::Vector3d low = object.mesh.vertices.front(), high = low;
    for (const auto& vertex : object.mesh.vertices) {
      low = low.cwiseMin(vertex);
      high = high.cwiseMax(vertex);
    }
    for (int corner = 0; corner < 8; ++corner)
      corners_[static_cast<std::size_t>(corner)] = Eigen::Vector3d(
          (corner & 1) != 0 ? high.x() : low.x(), (corner & 2) != 0 ? high.y() : low.y(),
          (corner & 4) != 0 ? high.z() : low.z());
  }

  void start(const Pose& camera_from_object) {
    begin(beliefAt(camera_from_object, params_.start.position_sigma,
                   params_.start.rotation_sigma_deg * M_PI / 180),
          false);
    proven_ = true;  // somebody knows
    beginLooks(Appearance{}.bright_inside);
    report_.state = TrackerState::kTracking;
    confirming_ = on_probation_ = false;
    last_seen_.reset();
    remembered_.reset();
    last_found_.reset();
    last_stamp_.reset();
  }

  void search() {
    report_.state = TrackerState::kSearching;
    unclear_.clear();
    remembered_.reset();
    last_found_.reset();
    last_stamp_.reset();
    last_seen_.reset();
    confirming_ = on_probation_ = false;
  }

  void stop() {
    report_ = {};
    last_stamp_.reset();
  }

  std::optional<PoseEstimate> track(const RectifiedStereoFrame& frame,
                                    const std::optional<Pose>& fixed_from_camera) {
    std::optional<PoseEstimate> estimate;
    arena_.execute([&] { estimate = trackInArena(frame, fixed_from_camera); });
    return estimate;
  }

  void saveLandmarks(const std::string& path) const {
    features_.landmarks().save(path, object_.name);
  }

  const TrackerParams params_;
  const ObjectModel object_;
  const RectifiedStereoCamera camera_;
  const ContourModel model_;
  TrackerReport report_;
  ParticleFilter filter_;

 private:
  std::optional<PoseEstimate> trackInArena(const RectifiedStereoFrame& frame,
                                           const std::optional<Pose>& fixed_from_camera) {
    report_.edges_ms = report_.filter_ms = report_.search_ms = 0;
    report_.unclear = false;
    if (report_.state == TrackerState::kIdle) return std::nullopt;

    Pose camera_motion = cameraMotion(fixed_from_camera);
    if (last_found_)
      last_found_->camera_from_object = camera_motion * last_found_->camera_from_object;
    if (report_.state != TrackerState::kTracking && !confirming_) {
      lookFor(frame, camera_motion);
      if (!confirming_ || !found_sure_) return std::nullopt;
      camera_motion.setIdentity();  // the pose is that of this frame
    }
    const auto begun = Clock::now();
    predict(frame.stamp, camera_motion);
    double particles_ms = millisecondsSince(begun);

    auto started = Clock::now();
    std::array<cv::Rect, 2> where = regions(belief_);
    if (features_.unsure()) {
      if (const auto known = features_.absolute(frame, where, belief_.pose))
        belief_.pose = *known, initializeFilter();
    }
    features_.observe(frame, where, belief_);
    if (!features_.alone()) {
      measurement_.observe(frame, where);
      if (params_.measurement != Measurement::kContour) {
        surface_.look(measurement_.fields(), belief_.pose);
        appearance_.texture = &surface_;
      }
    }
    report_.edges_ms = millisecondsSince(started);

    started = Clock::now();
    filter_.inject(kDoubtShare, belief_.pose, belief_.poseCovariance() + doubt(belief_.pose),
                   belief_.velocity, belief_.velocityCovariance());
    scoreParticles();
    particles_ms += millisecondsSince(started);
    const RefinedPose refined = features_.alone() ? refineByFeatures() : refineBest();
    const bool on_trial = on_probation_ && !confirming_;
    takeOver(refined);
    // It may have moved farther than was expected of what was only just found.
    if (on_trial && report_.state == TrackerState::kLost)
      return trackInArena(frame, fixed_from_camera);
    if (report_.state == TrackerState::kTracking && weak_frames_ == 0) considerTurned();
    if (report_.state == TrackerState::kTracking) askForSecondOpinion(frame);
    report_.filter_ms = millisecondsSince(started);
    budget_.record(report_.particles, particles_ms, millisecondsSince(begun) - particles_ms);

    if (report_.state != TrackerState::kTracking) return std::nullopt;
    PoseEstimate estimate;
    estimate.stamp = frame.stamp;
    estimate.camera_from_object = belief_.pose;
    estimate.covariance = covarianceToReport();
    estimate.support = report_.support;
    return estimate;
  }

  /// Searches one frame; a pose that is supported must prove itself in the next one.
  void lookFor(const RectifiedStereoFrame& frame, const Pose& camera_motion) {
    const auto started = Clock::now();
    if (last_seen_) last_seen_ = camera_motion * *last_seen_;
    if (recall(frame, camera_motion)) {
      report_.search_ms = millisecondsSince(started);
      return;
    }
    std::optional<Pose> known;
    bool accepted = false, refused = false;
    const bool unconfirmed = anew_ && features_.unsure();
    const auto enough = [&](const FoundPose& candidate) {
      if (!goodStart(candidate.refined)) return false;
      const Pose pose = asLastSeen(candidate.refined.camera_from_object);
      known = features_.absolute(frame, regionsAbout(pose), pose);
      const bool same = sameAsLast(candidate.refined);
      const bool other = !known && !same && last_seen_ && !unconfirmed &&
                         !fastSinceFound(pose, frame.stamp) && features_.refuse(pose);
      refused = refused || other;
      // The object is there, but nobody knows which way: until it shows, there is no pose.
      accepted = !other && (known || isClear(candidate) || same);
      report_.unclear = !other && !accepted;
      if (report_.unclear) unclear_ = {candidate.refined.camera_from_object, *candidate.rival};
      return !other;
    };
    // What is as bright as its surroundings makes no region; in a lit room it may be the darker
    // one.
    constexpr std::array<PoseSearch::Where, 4> kTurns{
        PoseSearch::Where::kBrightRegions, PoseSearch::Where::kSurfaces,
        PoseSearch::Where::kDarkRegions, PoseSearch::Where::kSurfaces};
    PoseSearch::Query query;
    query.where = kTurns[static_cast<std::size_t>(frames_lost_) % kTurns.size()];
    query.near = last_seen_;
    for (const Pose& pose : unclear_) query.candidates.push_back(camera_motion * pose);
    unclear_.clear();
    const std::optional<FoundPose> found = search_.find(frame, query, enough);
    report_.search_ms = millisecondsSince(started);
    report_.support = found ? found->refined.support() : 0;
    if (!accepted) {
      if (refused) features_.countRefusal();
      if (++frames_lost_ > kNearFrames)
        last_seen_.reset(), report_.state = TrackerState::kSearching;
      return;
    }
    // Another body may look the same: one that was tracked before must be seen better, or in the
    // same place.
    const RefinedPose& start = found->refined;
    const bool same = sameAsLast(start), first = !remembered_;
    found_sure_ =
        same || (report_.support >= kSureStart &&
                 (first || (start.evidence >= kCompelling && start.strength() >= kProvenStrength)));
    on_probation_ = found_sure_ && !same && !first;
    anew_ = !known && (!last_seen_ || unconfirmed);
    takeUp(known.value_or(asLastSeen(start.camera_from_object)), frame.stamp, known.has_value());
    beginLooks(std::clamp(start.bright_inside, 0.3, 0.9));
    search_.learn(belief_.pose, appearance_);
  }

  /// Whether the object is seen, if only in part, where it was last.
  bool sameAsLast(const RefinedPose& found) const {
    const Pose& pose = found.camera_from_object;
    return last_seen_ && (pose.translation() - last_seen_->translation()).norm() < kSameReach &&
           angleBetween(pose.linear(), last_seen_->linear(), object_.symmetry) < kSameTurn &&
           found.support() >= kSameSupport && found.strength() >= kSameStrength;
  }

  /// Whether a pose that was searched for may be the object's.
  bool goodStart(const RefinedPose& found) const {
    if (sameAsLast(found)) return true;
    const bool near =
        last_seen_ &&
        (found.camera_from_object.translation() - last_seen_->translation()).norm() < kRefoundReach;
    // What was tracked before is known to show, but for what hides it where it was.
    const bool elsewhere = remembered_ && !near;
    if (found.evidence >= kCompelling)
      return found.support() >= (elsewhere ? kFoundSupport : kCompelledSupport) &&
             found.insideShare() >= kCompelledInside;
    const double least = params_.eyes == Eyes::kBoth ? kLeastEvidence : kLeastOfOneEye;
    if (!near && found.evidence < least && found.strength() < kClearStrength) return false;
    return found.support() >= (near ? kRefoundSupport : kFoundSupport) &&
           found.strength() >= (near ? kRefoundStrength : kFoundStrength) &&
           found.insideShare() >= kFoundInside;
  }

  /// Whether the image tells a found pose from those in which the body would be elsewhere.
  bool isClear(const FoundPose& found) const {
    if (found.lead >= (object_.shape == Shape::kMesh ? kClearLeadOfMesh : kClearLead)) return true;
    const Pose turn = found.refined.camera_from_object.inverse() * *found.rival;
    const double slack = kSameSurface * model_.radius();
    return std::all_of(object_.mesh.vertices.begin(), object_.mesh.vertices.end(),
                       [&](const Eigen::Vector3d& vertex) {
                         return std::abs(features_.distance()((turn * vertex).cast<float>())) <
                                slack;
                       });
  }

  Pose asLastSeen(const Pose& pose) const {
    return last_seen_ ? nearestEquivalent(pose, *last_seen_, object_.symmetry) : pose;
  }

  /// While much of the contour is missing, something may hide the object, or it may be elsewhere:
  /// the search tells, more and more seldom as long as it agrees.
  void askForSecondOpinion(const RectifiedStereoFrame& frame) {
    if (features_.alone() || report_.support >= kSureSupport ||
        features_.support(belief_.pose) > kTrustedLandmarks || texture_support_ > kTextureSupport) {
      frames_to_opinion_ = opinion_period_ = kFirstOpinion;
      return;
    }
    if (--frames_to_opinion_ > 0) return;
    frames_to_opinion_ = opinion_period_ = std::min(2 * opinion_period_, kLastOpinion);
    const auto started = Clock::now();
    std::optional<RefinedPose> own;
    std::optional<Pose> known;
    bool better = false;
    PoseSearch::Query query;
    query.near = belief_.pose;
    const std::optional<FoundPose> found =
        search_.find(frame, query, [&](const FoundPose& candidate) {
          if (!own) own = search_.judge(belief_.pose);
          const RefinedPose& other = candidate.refined;
          if (!goodStart(other) || !isClear(candidate) ||
              other.support() < own->support() + kOpinionSupport ||
              other.log_likelihood < own->log_likelihood + kOpinionMargin)
            return false;
          const Pose pose = asLastSeen(other.camera_from_object);
          known = features_.absolute(frame, regionsAbout(pose), pose);
          better = known || !features_.refuse(pose);
          return better;
        });
    features_.forgetVotes();
    report_.search_ms = millisecondsSince(started);
    if (!better) return;
    takeUp(known.value_or(asLastSeen(found->refined.camera_from_object)), frame.stamp,
           known.has_value());
    report_.state = TrackerState::kLost;
  }

  /// Looks for landmarks where the object was last, whatever hides its contour.
  bool recall(const RectifiedStereoFrame& frame, const Pose& camera_motion) {
    if (!remembered_) return false;
    remembered_ = camera_motion * *remembered_;
    const PoseBelief belief = beliefAt(*remembered_, kRecallPositionSigma, kRecallRotationSigma);
    const std::optional<Pose> known = features_.recall(frame, regions(belief), belief.pose);
    found_sure_ = on_probation_ = false;
    if (known) takeUp(*known, frame.stamp, true);
    return known.has_value();
  }

  /// Of what was found a moment ago and is found again.
  std::optional<Twist> velocitySinceFound(const Pose& pose, Stamp stamp) const {
    if (!last_found_) return std::nullopt;
    const double dt = seconds(stamp - last_found_->stamp);
    const Twist moved = cameraTwistBetween(last_found_->camera_from_object, pose);
    if (dt <= 0 || dt > kFoundAgain || moved.head<3>().norm() > kFastest * dt ||
        moved.tail<3>().norm() > kFastestTurn * dt)
      return std::nullopt;
    return moved / dt;
  }

  /// Whether motion may blur landmarks beyond recognition.
  bool fastSinceFound(const Pose& pose, Stamp stamp) const {
    const auto velocity = velocitySinceFound(pose, stamp);
    return velocity && !last_found_->where_it_was && velocity->head<3>().norm() > kBlurring;
  }

  /// A pose that must prove itself in the next frame.
  void takeUp(const Pose& pose, Stamp stamp, bool sure) {
    PoseBelief belief = beliefAt(pose, kFoundPositionSigma, kFoundRotationSigma);
    if (const auto velocity = velocitySinceFound(pose, stamp)) belief.velocity = *velocity;
    const bool where_it_was =
        last_seen_ && (pose.translation() - last_seen_->translation()).norm() < kSameReach;
    last_found_ = Found{stamp, pose, where_it_was};
    begin(belief, sure);
    last_stamp_ = stamp;
    confirming_ = true;
  }

  /// Forgets what belongs to an earlier track.
  void begin(const PoseBelief& belief, bool sure) {
    belief_ = belief;
    initializeFilter();
    features_.restart(sure);
    if (!sure) surface_.forget();
    learned_frames_ = 0;
    texture_support_ = 0;
    usual_residual_ = 0;
    scatter_ = 1;
    frames_to_opinion_ = opinion_period_ = kFirstOpinion;
    weak_frames_ = faint_frames_ = 0;
    leverage_.setZero();
    learned_error_.setZero();
    fresh_ = true;
    proven_ = sure;
  }

  /// Nothing is known yet of how the object looks.
  void beginLooks(double bright_inside) {
    tracked_frames_ = 0;
    rivals_.forget();
    appearance_ = {};
    appearance_.bright_inside = bright_inside;
  }

  void initializeFilter() {
    filter_.initialize(belief_.pose, belief_.poseCovariance(), belief_.velocity,
                       belief_.velocityCovariance());
  }

  Pose cameraMotion(const std::optional<Pose>& fixed_from_camera) {
    Pose motion = Pose::Identity();
    if (fixed_from_camera && last_fixed_from_camera_)
      motion = fixed_from_camera->inverse() * *last_fixed_from_camera_;
    last_fixed_from_camera_ = fixed_from_camera;
    return motion;
  }

  void predict(Stamp stamp, const Pose& camera_motion) {
    double dt = 0;
    if (last_stamp_) dt = std::clamp(seconds(stamp - *last_stamp_), 0.0, kLongestStep);
    last_stamp_ = stamp;
    belief_.predict(params_.motion, dt, camera_motion);
    const Twist pixels = doubt(belief_.pose).diagonal().cwiseSqrt() / kDoubtReach;
    filter_.setCount(
        budget_.count(belief_.poseCovariance().diagonal().cwiseMax(0).cwiseSqrt(), 2 * pixels));
    filter_.predict(params_.motion, dt, camera_motion);
  }

  /// Where the object can be in each eye: the projected bounding box and three deviations around
  /// it.
  std::array<cv::Rect, 2> regions(const PoseBelief& belief) const {
    std::array<cv::Rect, 2> regions;
    const cv::Rect whole(cv::Point(), camera_.size);
    const double depth = std::max(0.02, belief.pose.translation().z() - model_.radius());
    const Twist deviation = belief.poseCovariance().diagonal().cwiseMax(0).cwiseSqrt();
    const double spread = deviation.head<2>().maxCoeff() + deviation.z() * 0.5 +
                          model_.radius() * std::min(0.3, deviation.tail<3>().maxCoeff());
    const double margin =
        std::min(80.0, 10 + 2.5 * camera_.focal_length * spread / std::max(0.04, depth));
    for (std::size_t eye = 0; eye < 2; ++eye) {
      double low_u = 1e9, low_v = 1e9, high_u = -1e9, high_v = -1e9;
      for (const auto& corner : corners_) {
        Eigen::Vector3d point = belief.pose * corner;
        if (eye == 1) point.x() -= camera_.baseline;
        point.z() = std::max(point.z(), 0.015);
        const Eigen::Vector2d pixel = camera_.leftPixel(point);
        low_u = std::min(low_u, pixel.x());
        high_u = std::max(high_u, pixel.x());
        low_v = std::min(low_v, pixel.y());
        high_v = std::max(high_v, pixel.y());
      }
      const auto rounded = [&](double value, double extra) {
        return static_cast<int>(std::clamp(value + extra, -10000.0, 10000.0));
      };
      const cv::Point first(rounded(low_u, -margin) & ~7, rounded(low_v, -margin) & ~7);
      const cv::Point last((rounded(high_u, margin) | 7) + 1, (rounded(high_v, margin) | 7) + 1);
      regions[eye] = cv::Rect(first, last) & whole;
    }
    return regions;
  }

  /// Likewise, of a pose that was just found.
  std::array<cv::Rect, 2> regionsAbout(const Pose& pose) const {
    return regions(beliefAt(pose, kFoundPositionSigma, kFoundRotationSigma));
  }

  Matrix6d covarianceToReport() const {
    Matrix6d covariance =
        scatter_ * belief_.poseCovariance() + common(belief_.pose) + learned_error_;
    if (!object_.symmetry.hasFreeAxis()) return covariance;
    const Eigen::Vector3d axis = belief_.pose.linear() * object_.symmetry.free_axis;
    const double spin = axis.dot(covariance.bottomRightCorner<3, 3>() * axis);
    constexpr double kUniform = M_PI * M_PI / 3;
    if (spin > kUnknownSpin * kUnknownSpin && spin < kUniform)
      covariance.bottomRightCorner<3, 3>() += (kUniform - spin) * axis * axis.transpose();
    return covariance;
  }

  /// Square of the unit twist about the free axis.
  Matrix6d freeSpin(const Pose& pose) const {
    Twist spin = Twist::Zero();
    spin.tail<3>() = pose.linear() * object_.symmetry.free_axis;
    return spin * spin.transpose();
  }

  /// Covariance of what frames do not average out: errors of calibration [px] and of the object's
  /// own measures and edges [m].
  Matrix6d common(const Pose& pose) const {
    const double depth = std::max(0.03, pose.translation().z());
    const double error = std::hypot(kCommonPixels * depth / camera_.focal_length, kCommonShape);
    if (!leverage_.isZero()) {
      // Of so many lines, each is off by an error of its own.
      const double pixels = error * camera_.focal_length / depth;
      Twist most;
      most << Eigen::Vector3d::Constant(0.2 * depth), Eigen::Vector3d::Constant(0.3);
      Matrix6d information = leverage_ * (kCommonLines / (pixels * pixels));
      information.diagonal() += most.cwiseAbs2().cwiseInverse();
      if (object_.symmetry.hasFreeAxis())  // the contour does not show it
        information += std::pow(model_.radius() / error, 2) * freeSpin(pose);
      return information.inverse();
    }
    const double along = error * std::clamp(0.5 * depth / model_.radius(), 1.0, 5.0);
    const double turn = error / model_.radius();
    Twist deviation;
    deviation << error, error, along, turn, turn, turn;
    return deviation.cwiseAbs2().asDiagonal();
  }

  /// Covariance of what the contour erred by while the texture was learned: the texture keeps it.
  Matrix6d errorOfLearning(const RefinedPose& refined) const {
    if (refined.texture_information.isZero()) return Matrix6d::Zero();
    Twist most;
    most << Eigen::Vector3d::Constant(0.005), Eigen::Vector3d::Constant(0.1);
    Matrix6d contour = refined.information - refined.texture_information;
    contour.diagonal() += most.cwiseAbs2().cwiseInverse();
    if (object_.symmetry.hasFreeAxis()) contour += 1e6 * freeSpin(refined.camera_from_object);
    return kLearnedError * contour.inverse();
  }

  /// Covariance of a pose that fits the image only nearly: a few pixels in every direction.
  Matrix6d doubt(const Pose& pose) const {
    const double depth = std::max(0.03, pose.translation().z());
    const double reach = kDoubtReach * depth / camera_.focal_length;  // [m]
    const double turn = std::min(0.2, reach / model_.radius());
    const double along = std::min(0.1 * depth, reach * depth / model_.radius());
    Twist deviation;
    deviation << reach, reach, along, turn, turn, turn;
    return deviation.cwiseAbs2().asDiagonal();
  }

  /// From starts close to the best pose.
  std::vector<RefinedPose> refineAll(const std::vector<Pose>& starts,
                                     const PosePrior& prior) const {
    std::vector<RefinedPose> refined(starts.size());
    tbb::parallel_for(std::size_t{0}, refined.size(), [&](std::size_t i) {
      refined[i] = refiner_.refine(model_, measurement_.fields(), starts[i], prior, appearance_,
                                   {5, 3.5, 2.5});
    });
    return refined;
  }

  /// The image hardly tells a pose from others along the direction that moves its contour least:
  /// one of those takes its place if it is clearly better.
  template <class Score>
  void tryLeastBound(const PosePrior& prior, const Score& score, RefinedPose& best) const {
    Twist scale;  // rotations as what they move
    scale << Eigen::Vector3d::Ones(), Eigen::Vector3d::Constant(1 / model_.radius());
    Matrix6d leverage = scale.asDiagonal() * best.leverage * scale.asDiagonal();
    if (object_.symmetry.hasFreeAxis())
      leverage += leverage.trace() * freeSpin(best.camera_from_object);
    const Eigen::SelfAdjointEigenSolver<Matrix6d> solver(leverage);
    const double turn =
        kDoubtReach / std::sqrt(std::max(1e-9, solver.eigenvalues()[0])) / model_.radius();
    // Farther than that, the image says nothing of it.
    if (best.leverage.isZero() || turn < kLeastTurn || turn > kFarthestTurn) return;
    const Twist step = turn * model_.radius() * scale.asDiagonal() * solver.eigenvectors().col(0);
    const std::vector<RefinedPose> tried =
        refineAll({movedInCamera(best.camera_from_object, step),
                   movedInCamera(best.camera_from_object, Twist(-step))},
                  prior);
    const RefinedPose& better = score(tried[1]) > score(tried[0]) ? tried[1] : tried[0];
    if (score(better) > score(best) + kClearlyBetter) best = better;
  }

  /// Where a face or an axis looks the other way, the image is nearly the same.
  template <class Score>
  void tryMirrored(const PosePrior& prior, const Score& score, RefinedPose& best) const {
    for (const RefinedPose& other : refineAll(mirrored_.of(best.camera_from_object), prior))
      if (score(other) > score(best) + kMirroredMargin) best = other;
  }

  void scoreParticles() {
    using Sharpness = ContourMeasurement::Sharpness;
    const auto scorer = [&](Sharpness sharpness) {
      return [this, sharpness](const ParticlePose* poses, std::size_t count, float* out) {
        if (features_.alone())
          std::fill(out, out + count, 0.0F);
        else
          measurement_.score(model_, sharpness, poses, count, out);
        if (sharpness == Sharpness::kSharp || features_.alone())
          features_.addScores(poses, count, out);
        for (std::size_t i = 0; i < count; ++i) {
          const float depth = poses[i].translation[2];
          if (!(depth > params_.volume.nearest && depth < params_.volume.farthest))
            out[i] -= kOutsideVolume;
        }
      };
    };
    for (int layer = 0; layer + 1 < params_.filter.layers; ++layer)
      filter_.anneal(scorer(Sharpness::kBlunt), 0.2, 0.4);
    filter_.weigh(scorer(Sharpness::kSharp));
    report_.effective_share = filter_.effectiveShare();
    report_.particles = filter_.count();
  }

  /// Refines the prediction and the best particles that differ from each other; the one that
  /// explains image and prediction best wins.
  RefinedPose refineBest() {
    const PosePrior prior{belief_.pose, belief_.poseCovariance().inverse()};
    const PosePrior doubted{belief_.pose,
                            (belief_.poseCovariance() + doubt(belief_.pose)).inverse()};
    const auto expected = [&](const Pose& pose) {
      return surprise(prior, pose) < kDoubtCost + surprise(doubted, pose);
    };
    const PosePrior with_features = features_.refine(prior);
    std::vector<Pose> starts{belief_.pose};
    const auto& scores = filter_.logLikelihoods();
    const std::size_t candidates = std::min<std::size_t>(scores.size(), kCandidates);
    putBestFirst(scores, candidates, order_);
    for (std::size_t i = 0; i < candidates && starts.size() < kHypotheses; ++i) {
      const Pose pose = toPose(filter_.poses()[order_[i]]);
      const bool near = std::any_of(starts.begin() + 1, starts.end(), [&](const Pose& other) {
        return (pose.translation() - other.translation()).norm() < 0.15 * model_.radius() &&
               angleBetween(pose.linear(), other.linear()) < 0.15;
      });
      if (i == 0 || !near) starts.push_back(pose);
    }

    // The prediction first; particles that would only lead to the same place are left out.
    std::vector<RefinedPose> refined(starts.size());
    const auto refine = [&](std::size_t i) {
      refined[i] = refiner_.refine(
          model_, measurement_.fields(), starts[i], expected(starts[i]) ? prior : doubted,
          appearance_,
          i == 0 && !fresh_ ? std::vector<double>{6, 4, 2.5} : std::vector<double>{8, 5, 3, 2.5});
    };
    RefinedPose by_features;
    const auto refineByBoth = [&] {
      by_features = refiner_.refine(model_, measurement_.fields(), with_features.mean,
                                    with_features, appearance_, {6, 4, 2.5});
    };
    // With what features add and without, should they be of something else.
    if (features_.speak())
      tbb::parallel_invoke([&] { refine(0); }, refineByBoth);
    else
      refine(0);
    const Pose& first = refined[0].camera_from_object;
    const double depth = std::max(0.03, first.translation().z());
    const double same = 2.5 / (camera_.focal_length / depth);  // [m] that 2.5 px stand for
    starts.erase(std::remove_if(starts.begin() + 1, starts.end(),
                                [&](const Pose& start) {
                                  return (start.translation() - first.translation()).norm() <
                                             std::max(2 * same, 0.1 * model_.radius()) &&
                                         angleBetween(start.linear(), first.linear(),
                                                      object_.symmetry) <
                                             2 * same / model_.radius();
                                }),
                 starts.end());
    refined.resize(starts.size());
    tbb::parallel_for(std::size_t{1}, starts.size(), refine);

    const auto score = [&](const RefinedPose& candidate) {
      return candidate.log_likelihood + (1 - kNearMisfit) * candidate.misfit +
             features_.score(candidate.camera_from_object) -
             std::min(surprise(prior, candidate.camera_from_object),
                      kDoubtCost + surprise(doubted, candidate.camera_from_object));
    };
    RefinedPose best = refined[0];
    for (const RefinedPose& candidate : refined)
      if (score(candidate) > score(best)) best = candidate;
    if (usual_residual_ > 0 && best.residual > std::max(kPoorFit, kWorseFit * usual_residual_)) {
      // Edges that scatter belong to something else in part: more particles, closer to each other.
      const std::size_t tried = starts.size();
      starts.push_back(best.camera_from_object);
      // Depth is known least.
      const double along = std::sqrt(doubt(belief_.pose)(2, 2)) / belief_.pose.translation().z();
      for (const double share : {-1.0, -0.5, 0.5, 1.0}) {
        starts.push_back(belief_.pose);
        starts.back().translation() *= 1 + share * along;
      }
      for (std::size_t i = 0; i < candidates && starts.size() < tried + kMoreHypotheses; ++i) {
        const Pose pose = toPose(filter_.poses()[order_[i]]);
        if (std::none_of(starts.begin(), starts.end(), [&](const Pose& other) {
              return (pose.translation() - other.translation()).norm() < 0.06 * model_.radius() &&
                     angleBetween(pose.linear(), other.linear()) < 0.06;
            }))
          starts.push_back(pose);
      }
      // What comes close to the object from one side may have caught that side's contour.
      const std::size_t sided = starts.size();
      starts.resize(sided + kSides, belief_.pose);
      refined.resize(starts.size());
      tbb::parallel_for(tried, starts.size(), [&](std::size_t i) {
        if (i >= sided) {
          const double angle = 2 * M_PI * static_cast<double>(i - sided) / kSides;
          const Eigen::Vector2f side(static_cast<float>(std::cos(angle)),
                                     static_cast<float>(std::sin(angle)));
          starts[i] = refiner_.move(model_, measurement_.fields(), starts[i], doubted, appearance_,
                                    {8, 5, 3}, nullptr, side);
        }
        refined[i] =
            refiner_.refine(model_, measurement_.fields(), starts[i], doubted, appearance_,
                            i < sided ? std::vector<double>{8, 5, 3} : std::vector<double>{4, 3});
      });
      for (const RefinedPose& candidate : refined)
        if (score(candidate) > score(best)) best = candidate;
    }
    tryLeastBound(doubted, score, best);
    tryMirrored(doubted, score, best);
    // Where both lead to one place, features know more: the turn that the contour does not show.
    const auto agree = [&](const Pose& a, const Pose& b) {
      const double pixel = same / 2.5;
      return (a.translation() - b.translation()).norm() < pixel &&
             angleBetween(a.linear(), b.linear(), object_.symmetry) < pixel / model_.radius();
    };
    const bool use_features =
        features_.speak() && (score(by_features) >= score(best) ||
                              agree(by_features.camera_from_object, best.camera_from_object));
    if (use_features) best = by_features;
    const auto makeExact = [&](RefinedPose& pose) {
      refineExactly(refiner_, model_, measurement_.fields(), camera_.baseline,
                    use_features                        ? with_features
                    : expected(pose.camera_from_object) ? prior
                                                        : doubted,
                    appearance_, pose);
    };
    // What the contour of a view nearby prefers to the prediction must be better on its own, too.
    RefinedPose as_predicted = refined[0];
    if (use_features || agree(as_predicted.camera_from_object, best.camera_from_object)) {
      makeExact(best);
    } else {
      tbb::parallel_invoke([&] { makeExact(best); }, [&] { makeExact(as_predicted); });
      if (score(as_predicted) > score(best)) best = as_predicted;
    }
    if (!expected(best.camera_from_object)) belief_.widen(doubt(belief_.pose));
    if (use_features) best.information += with_features.information - prior.information;
    return best;
  }

  void learnScatter(double scatter) {
    if (scatter <= 0) return;  // points alone
    const double share = std::clamp(scatter / kUsualScatter, kLeastScatter, kMostScatter);
    scatter_ += (fresh_ ? 1 : kScatterRate) * (share - scatter_);
  }

  /// The pose of features and prediction; of two starts the one that explains both best.
  RefinedPose refineByFeatures() const {
    const PosePrior prior{belief_.pose, belief_.poseCovariance().inverse()};
    const auto& scores = filter_.logLikelihoods();
    const auto best_particle = std::max_element(scores.begin(), scores.end()) - scores.begin();
    const PosePrior ahead = features_.refine(prior);
    const PosePrior elsewhere =
        features_.refine(prior, toPose(filter_.poses()[static_cast<std::size_t>(best_particle)]));
    const auto score = [&](const Pose& pose) {
      return features_.score(pose) - surprise(prior, pose);
    };
    const PosePrior& posterior = score(elsewhere.mean) > score(ahead.mean) ? elsewhere : ahead;
    RefinedPose refined;
    refined.camera_from_object = posterior.mean;
    refined.information = posterior.information - prior.information;
    return refined;
  }

  /// Now and then the tracked pose is held against its turned ones.
  void considerTurned() {
    if (!object_.symmetry.trivial()) return;  // its likenesses are known
    ++tracked_frames_;
    const int period = tracked_frames_ <= kFirstFrames  ? 1
                       : tracked_frames_ < kYoungFrames ? kYoungPeriod
                                                        : kOldPeriod;
    if (tracked_frames_ % period != 0 || features_.support(belief_.pose) > kTrustedLandmarks)
      return;
    Appearance plain = appearance_;
    plain.texture = nullptr;  // of the side that is taken for the seen one
    const auto better = rivals_.look(belief_.pose, search_.turned(belief_.pose), measurement_,
                                     plain, tracked_frames_ <= kFirstFrames);
    if (!better) return;
    const PoseBelief old = belief_;
    surface_.forget();
    belief_ = beliefAt(*better, kFoundPositionSigma, kFoundRotationSigma);
    belief_.velocity = old.velocity;
    initializeFilter();
    tracked_frames_ = kFirstFrames;  // as young again
    last_seen_ = remembered_ = belief_.pose;
  }

  void takeOver(const RefinedPose& refined) {
    const double landmark_support = features_.support(refined.camera_from_object);
    report_.support = features_.alone() ? landmark_support : refined.seenSupport();
    texture_support_ =
        features_.alone() ? 0 : surface_.support(measurement_.fields(), refined.camera_from_object);
    // What was never seen clearly since the start may be something else.
    const bool compelling =
        refined.evidence >= kCompelling ||
        (refined.evidence >= kClearEvidence && report_.support >= kClearSupport);
    const double strength = features_.alone() || compelling ? kProvenStrength : refined.strength();
    proven_ = proven_ || strength >= kProvenStrength || landmark_support >= kLandmarkSupport;
    const bool carried =
        landmark_support >= kLandmarkSupport || texture_support_ >= kTextureSupport;
    const bool contour_alone = !carried && !refined.hidden_eye;
    faint_frames_ = strength < kFaintStrength && contour_alone ? faint_frames_ + 1 : 0;
    const bool faint = faint_frames_ >= kPatience;
    const bool refuted = strength < 0 && report_.support < kLittleSupport && contour_alone;
    // No other body takes the place of one whose contour is all there from frame to frame.
    const bool unbroken =
        !confirming_ && !on_probation_ && weak_frames_ == 0 && report_.support >= kUnbrokenSupport;
    const bool supported =
        !faint && !refuted &&
        (proven_ || strength >= kLeastStrength || (confirming_ && sameAsLast(refined))) &&
        (unbroken || !features_.contradict(refined.camera_from_object, refined.bestEyeSupport())) &&
        (report_.support >= kLeastSupport || carried ||
         (report_.support >= kLeastExactSupport && refined.residual < kExact && !confirming_));
    if (confirming_ || on_probation_) {
      const bool again = !confirming_;
      if (again) on_probation_ = false;
      confirming_ = false;
      frames_lost_ = 0;
      if ((report_.support < (compelling ? kCompelledSupport : kFoundSupport) ||
           strength < kLeastStrength) &&
          landmark_support < kLandmarkSupport && !sameAsLast(refined)) {
        if (again) report_.state = TrackerState::kLost;
        return;
      }
    }
    if (supported) {
      leverage_ = refined.leverage;
      learnScatter(refined.scatter);
      learned_error_ = errorOfLearning(refined);
      belief_.update(refined.camera_from_object, refined.information);
      usual_residual_ = usual_residual_ > 0
                            ? usual_residual_ + 0.1 * (refined.residual - usual_residual_)
                            : refined.residual;
      if (!features_.alone() && report_.support > kLearningSupport)
        refiner_.learn(model_, measurement_.fields(), belief_.pose, appearance_);
      if (report_.support > kTextureLearningSupport && ++learned_frames_ > kSettled)
        surface_.learn(measurement_.fields(), belief_.pose);
      weak_frames_ = 0;
      last_seen_ = remembered_ = belief_.pose;
      report_.state = TrackerState::kTracking;
    } else if (++weak_frames_ >= kPatience || faint ||
               (report_.support < kNothingLeft && !features_.alone()) ||
               belief_.poseCovariance().topLeftCorner<3, 3>().diagonal().maxCoeff() >
                   kLostSpread * kLostSpread) {
      report_.state = TrackerState::kLost;
      frames_lost_ = 0;
    }
    features_.conclude(belief_, supported, refined.seenSupport());
    fresh_ = false;
    filter_.resample(params_.filter.resample_below);
    if (supported)
      filter_.inject(0.5, belief_.pose, belief_.poseCovariance(), belief_.velocity,
                     belief_.velocityCovariance());
  }

  ParticleBudget budget_;
  ContourMeasurement measurement_;
  PoseRefiner refiner_;
  MirroredPoses mirrored_;
  TexturedSurface surface_;
  FeatureTracking features_;
  PoseSearch search_;
  TurnedRivals rivals_;
  tbb::task_arena arena_;
  std::array<Eigen::Vector3d, 8> corners_;
  PoseBelief belief_;
  int tracked_frames_ = 0;  ///< since the last start
  std::optional<Stamp> last_stamp_;
  std::optional<Pose> last_fixed_from_camera_;
  Appearance appearance_;
  std::vector<std::uint32_t> order_;  ///< of the particles, the best ones first
  int weak_frames_ = 0;
  int faint_frames_ = 0;       ///< in a row, with hardly any evidence for the pose
  double usual_residual_ = 0;  ///< [px]
  double scatter_ = 1;         ///< RefinedPose::scatter of the frames before, over the usual one
  Matrix6d leverage_ = Matrix6d::Zero();       ///< of the last supported pose
  Matrix6d learned_error_ = Matrix6d::Zero();  ///< likewise
  int frames_to_opinion_ = kFirstOpinion, opinion_period_ = kFirstOpinion;
  int frames_lost_ = 0;
  int learned_frames_ = 0;  ///< in which texture could be learned
  double texture_support_ = 0;
  bool fresh_ = false;
  bool proven_ = false;        ///< seen clearly since the start
  bool confirming_ = false;    ///< the last search found something
  bool found_sure_ = false;    ///< and needs no other frame to be believed
  bool on_probation_ = false;  ///< it was, and must prove itself in the next one
  bool anew_ = false;          ///< found from nothing, not in an orientation that landmarks know
  std::optional<Pose> last_seen_;   ///< where the object was when the tracker stood by it
  std::optional<Pose> remembered_;  ///< the same, for as long as it takes
  std::vector<Pose> unclear_;       ///< that the last frame did not tell apart
  struct Found {
    Stamp stamp;
    Pose camera_from_object;
    bool where_it_was;  ///< when it was lost, so that it does not fly
  };
  std::optional<Found> last_found_;  ///< by a search or by landmarks
};

Tracker::Tracker(const TrackerParams& params, const ObjectModel& object,
                 const RectifiedStereoCamera& camera)
    : impl_(std::make_unique<Impl>(params, object, camera)) {}
Tracker::~Tracker() = default;
Tracker::Tracker(Tracker&&) noexcept = default;
Tracker& Tracker::operator=(Tracker&&) noexcept = default;

void Tracker::start(const Pose& camera_from_object) { impl_->start(camera_from_object); }
void Tracker::search() { impl_->search(); }
void Tracker::stop() { impl_->stop(); }

std::optional<PoseEstimate> Tracker::track(const RectifiedStereoFrame& frame,
                                           const std::optional<Pose>& fixed_from_camera) {
  return impl_->track(frame, fixed_from_camera);
}

const TrackerReport& Tracker::report() const { return impl_->report_; }

void Tracker::saveLandmarks(const std::string& path) const { impl_->saveLandmarks(path); }

std::vector<Pose> Tracker::particles() const {
  std::vector<Pose> poses;
  if (impl_->report_.state == TrackerState::kIdle) return poses;
  poses.reserve(impl_->filter_.poses().size());
  for (const auto& particle : impl_->filter_.poses()) poses.push_back(toPose(particle));
  return poses;
}

const ObjectModel& Tracker::object() const { return impl_->object_; }
const RectifiedStereoCamera& Tracker::camera() const { return impl_->camera_; }
const TrackerParams& Tracker::params() const { return impl_->params_; }

std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> Tracker::contour(
    const Pose& camera_from_object, int eye) const {
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> pieces;
  Pose pose = camera_from_object;
  if (eye == 1) pose.translation().x() -= impl_->camera_.baseline;
  const Eigen::Vector3d place = -(pose.linear().transpose() * pose.translation());
  const ViewChoice choice = impl_->model_.choose(place.cast<float>());
  if (choice.view == nullptr) return pieces;
  pose.linear() = pose.linear() * Eigen::AngleAxisd(std::atan2(choice.sine, choice.cosine),
                                                    Eigen::Vector3d::UnitZ());
  for (const ContourPoint& point : choice.view->points) {
    const Eigen::Vector3d half = 0.5 * (point.length * point.tangent).cast<double>();
    const Eigen::Vector3d a = pose * (point.position.cast<double>() - half);
    const Eigen::Vector3d b = pose * (point.position.cast<double>() + half);
    if (a.z() > 0.005 && b.z() > 0.005)
      pieces.emplace_back(impl_->camera_.leftPixel(a), impl_->camera_.leftPixel(b));
  }
  return pieces;
}

}  // namespace leap_object_tracker
