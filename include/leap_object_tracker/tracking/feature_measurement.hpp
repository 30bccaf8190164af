#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/signed_distance.hpp"
#include "leap_object_tracker/tracking/feature_extractor.hpp"
#include "leap_object_tracker/tracking/feature_kernel.hpp"
#include "leap_object_tracker/tracking/feature_landmarks.hpp"
#include "leap_object_tracker/tracking/feature_params.hpp"
#include "leap_object_tracker/tracking/measurement_model.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"

namespace leap_object_tracker {

/// What the features of one frame say about a pose near another: sums over all features.
struct FeatureSupport {
  Matrix6d information = Matrix6d::Zero();           ///< of the camera twist (pose_refiner.hpp)
  Twist gradient = Twist::Zero();                    ///< information * step = gradient
  Matrix6d landmark_information = Matrix6d::Zero();  ///< the landmarks' part of it
  Twist landmark_gradient = Twist::Zero();
  double log_likelihood = 0;   ///< as of score() [nats]
  double surface_points = 0;   ///< how many of the features lie on the surface
  double landmark_points = 0;  ///< how many lie on their landmarks
};

/// Scores poses by the points in space that both eyes see: those that show a known landmark by
/// their distance from it, the others by their distance from the surface. Each point may also be of
/// something else, so that a point far from the object neither helps nor harms.
class FeatureMeasurement {
 public:
  FeatureMeasurement(const FeatureParams& params, const ObjectModel& object,
                     const RectifiedStereoCamera& camera,
                     CornerDetector detector = CornerDetector::kFast);

  /// Features of a frame where the object is expected.
  /// @param predicted camera_from_object before this frame: where to look, not how to score
  /// @param uncertainty [m] standard deviation of where a point of the object is
  void observe(const RectifiedStereoFrame& frame, const std::array<cv::Rect, 2>& regions,
               const Pose& predicted, double uncertainty);

  /// Takes the last frame's features for another prediction of about the same roll.
  void expect(const Pose& predicted, double uncertainty);

  /// Log-likelihood ratio of each pose against "no feature is of the object". May be called from
  /// several threads.
  void score(const ParticlePose* poses, std::size_t count, float* log_likelihood) const;

  /// The same of one pose, with the Gauss-Newton step towards a better one.
  FeatureSupport support(const Pose& camera_from_object) const;

  /// The pose that explains features and prior best (Gauss-Newton), and what both together know of
  /// it: a prior for the contour (PoseRefiner), or the posterior of features alone. What landmarks
  /// tell is bounded by how well they are known as a whole (Schmidt 1966: an error that is
  /// considered and not estimated).
  /// @param start where to begin; without one: at the mean of the prior
  PosePrior refine(const PosePrior& prior, const std::optional<Pose>& start = std::nullopt) const;

  /// Sticks the features of the last frame to the object. Only for a pose to stand by.
  /// @param position_sigma [m], rotation_sigma [rad] how well the pose is known
  void learn(const Pose& camera_from_object, double position_sigma, double rotation_sigma);

  /// The pose from landmarks alone, wherever it is, of the features of the last frame.
  std::optional<Pose> locate() const;

  const std::vector<StereoFeature>& features() const { return features_; }
  const FeatureExtractor::Counts& counts() const { return extractor_.counts(); }
  const SignedDistance& distance() const { return distance_; }
  LandmarkMap& landmarks() { return landmarks_; }
  const LandmarkMap& landmarks() const { return landmarks_; }

 private:
  /// A feature with what scoring needs, in single precision.
  struct Point {
    Eigen::Vector3f in_camera;
    float variance = 0;           ///< [m^2] along the ray from the eye
    Eigen::Vector3f landmark;     ///< [m] object frame
    Eigen::Matrix3f information;  ///< [1/m^2] of the distance from the landmark
    bool has_landmark = false;
    float peak = 0;  ///< log density of a perfect match over that of an outlier
  };
  void makePoints();
  Matrix6d mapCovariance(const Pose& camera_from_object) const;

  FeatureParams params_;
  SignedDistance distance_;
  double radius_;              ///< [m]
  Eigen::Vector3d free_axis_;  ///< of the object's symmetry; zero: none
  FeatureExtractor extractor_;
  LandmarkMap landmarks_;
  std::vector<StereoFeature> features_;
  std::vector<int> matches_;
  std::vector<bool> on_surface_;
  std::vector<Point> points_;
  FeatureArrays arrays_;  ///< the same for the scoring of many poses
};

}  // namespace leap_object_tracker
