#pragma once

#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/tracking/feature_extractor.hpp"

namespace leap_object_tracker {

/// A spot on the object's surface that can be told from others.
struct Landmark {
  Eigen::Vector3f position;  ///< [m] object frame
  Eigen::Vector3f view;      ///< unit vector from the spot to the eye, object frame
  FeatureDescriptor descriptor;
  float variance = 0;  ///< [m^2] of the position, each axis
  int seen = 1;        ///< frames it was matched in
  int missed = 0;      ///< frames it should have been seen in, since it was last
};

/// What is known of an object's texture.
class LandmarkMap {
 public:
  explicit LandmarkMap(int capacity) : capacity_(capacity) {}

  /// How far descriptors shall be turned [rad] for an orientation of the object, so that a spot
  /// looks the same however the camera is rolled: the turn against the nearest of the known
  /// directions of view.
  double rollOf(const Eigen::Matrix3d& camera_from_object) const;

  /// The landmark that each feature shows, or -1: near the place where a pose puts the feature,
  /// seen from a similar direction, of like descriptor, and no other nearly as like.
  /// @param reach [m] how far the place may be off
  void match(const std::vector<StereoFeature>& features, const Pose& camera_from_object,
             double reach, std::vector<int>& matches) const;

  /// How many landmarks, all seen a few times, a pose turns towards the eye.
  int expected(const Pose& camera_from_object) const;

  /// Takes the features of a trusted pose: known landmarks become more exact, new ones are added,
  /// those that are never seen again make room. `matches` is of match(), or -1 where the caller
  /// found a match to be wrong; `on_surface` says which features lie on the object.
  /// @param pose_variance [m^2] what the pose adds to the variance of a feature's place
  void learn(const std::vector<StereoFeature>& features, const std::vector<int>& matches,
             const std::vector<bool>& on_surface, const Pose& camera_from_object,
             double pose_variance);

  /// The pose that brings the most features onto landmarks of like descriptor (RANSAC over three
  /// pairs, Fischler and Bolles 1981; pose of three pairs by Umeyama 1991). Repeatable.
  /// @return nothing if fewer than 8 pairs agree within `tolerance` [m]
  std::optional<Pose> locate(const std::vector<StereoFeature>& features, double tolerance) const;

  const std::vector<Landmark>& landmarks() const { return landmarks_; }
  void clear();

  /// @throw std::runtime_error naming the file, also for a map of another object.
  void save(const std::string& path, const std::string& object_name) const;
  void load(const std::string& path, const std::string& object_name);

 private:
  /// A direction that the object was seen from, with the roll of its descriptors.
  struct View {
    Eigen::Matrix3d camera_from_object;
    double roll = 0;  ///< [rad]
  };
  const View* nearestView(const Eigen::Matrix3d& camera_from_object, double& angle) const;
  void makeRoom();

  int capacity_;
  std::vector<Landmark> landmarks_;
  std::vector<bool> seen_;  ///< in the frame that is learnt from
  std::vector<View> views_;
};

}  // namespace leap_object_tracker
