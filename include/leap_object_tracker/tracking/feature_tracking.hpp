#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/feature_measurement.hpp"
#include "leap_object_tracker/tracking/pose_belief.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// When features are looked for, whether they carry a pose, and when landmarks are learnt. With
/// Measurement::kContour, or without one of the eyes, it does nothing.
class FeatureTracking {
 public:
  /// @throw std::runtime_error if the map of landmarks cannot be read.
  FeatureTracking(const TrackerParams& params, const ObjectModel& object,
                  const RectifiedStereoCamera& camera);

  /// Another start: landmarks stay known, habits are forgotten.
  /// @param sure whether the orientation is that of the landmarks and not only one that looks alike
  void restart(bool sure);

  /// Whether orientation and landmarks may not belong together: absolute() is to be asked, and
  /// nothing is learnt.
  bool unsure() const { return unsure_; }

  /// Finds the features of a frame, if it is worth while.
  /// @param regions [px] where the object can be in each eye
  void observe(const RectifiedStereoFrame& frame, const std::array<cv::Rect, 2>& regions,
               const PoseBelief& belief);

  /// Whether this frame's features have a say.
  bool speak() const { return observed_; }
  /// Whether the contour is left out: Measurement::kFeature, once landmarks carried a pose.
  bool alone() const { return method_ == Measurement::kFeature && carried_; }

  /// Adds what the features say to the log-likelihoods of poses. From several threads.
  void addScores(const ParticlePose* poses, std::size_t count, float* log_likelihoods) const;
  double score(const Pose& camera_from_object) const;

  /// FeatureMeasurement::refine; the prior itself if the features are silent.
  PosePrior refine(const PosePrior& prior, const std::optional<Pose>& start = std::nullopt) const;

  /// Landmarks that lie where a pose puts them, as a share of those that leave no doubt; at most 1.
  double support(const Pose& camera_from_object) const;

  /// Whether landmarks that should be seen at a pose are not there, but something else is.
  /// @param contour_support as in RefinedPose
  bool contradict(const Pose& camera_from_object, double contour_support) const;

  /// Ends a frame. Landmarks are learnt only from poses that the tracker stands by.
  /// @param contour_support as in RefinedPose
  void conclude(const PoseBelief& belief, bool trusted, double contour_support);

  /// The equivalent of a found pose that the landmarks know, so that orientations mean the same
  /// after the object was lost; nothing if they do not know. From then on they are sure.
  std::optional<Pose> absolute(const RectifiedStereoFrame& frame,
                               const std::array<cv::Rect, 2>& regions, const Pose& found);

  /// What frames before told absolute() counts no more.
  void forgetVotes();

  /// The pose that landmarks tell near another, also where its contour is hidden; nothing if they
  /// do not know.
  std::optional<Pose> recall(const RectifiedStereoFrame& frame,
                             const std::array<cv::Rect, 2>& regions, const Pose& near);

  /// Whether a pose that was found, and that absolute() could not confirm, is of another thing of
  /// the same shape: of other texture, or of none where landmarks should be.
  bool refuse(const Pose& found) const;
  /// A frame in which all that was found was refused: after many in a row the landmarks are
  /// forgotten.
  void countRefusal();

  const LandmarkMap& landmarks() const { return measurement_.landmarks(); }
  const SignedDistance& distance() const { return measurement_.distance(); }

 private:
  double spotSigma(const PoseBelief& belief) const;
  bool usable(const RectifiedStereoFrame& frame) const;
  double rotationSigma(const PoseBelief& belief) const;
  bool wouldKnow(const Pose& camera_from_object) const;
  bool missing(const Pose& camera_from_object, const FeatureSupport& support) const;
  void keepWatch(const FeatureSupport& support, double contour_support);
  std::vector<Pose> equivalents(const Pose& pose) const;

  Measurement method_;
  bool two_eyes_;
  Symmetry symmetry_;
  double radius_;  ///< [m]
  FeatureMeasurement measurement_;
  bool observed_ = false;
  bool carried_ = false;
  bool unsure_ = false;
  std::vector<double> votes_;      ///< landmarks for each equivalent orientation while unsure
  Pose voted_ = Pose::Identity();  ///< the one of them that was found last
  double voters_ = 0;              ///< features that could have voted
  int doubts_ = 0;                 ///< frames with features since then
  int refusals_ = 0;               ///< in a row
  // Of Measurement::kAuto.
  int wait_ = 0;    ///< frames until features are looked for again
  int trial_ = 0;   ///< frames that features may yet fail to carry a pose
  int period_ = 0;  ///< frames to leave out after that
};

}  // namespace leap_object_tracker
