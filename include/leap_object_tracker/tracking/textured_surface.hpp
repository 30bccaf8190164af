#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <unordered_set>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"

namespace leap_object_tracker {

/// What the texture of a body says of a pose.
struct SurfaceEvidence {
  Matrix6d information = Matrix6d::Zero();  ///< of the camera twist (movedInCamera)
  Twist gradient = Twist::Zero();           ///< of log_likelihood, by the camera twist
  double log_likelihood = 0;                ///< [nats]
};

struct SurfaceSample;

/// The texture of an object, aligned densely with both images and learned while it is tracked.
///
/// Before anything is learned, the eyes are compared: whatever the texture, a place of a matt
/// surface is as bright in both (direct alignment of a static stereo pair, as Engel, Stueckler and
/// Cremers, "Large-scale direct SLAM with stereo cameras", IROS 2015, section III-B, with the
/// body's own surface for the depth). Then each eye is compared with the learned brightness of
/// each place under Lambert shading by the three lamps. Residuals l - a r have Student's
/// t-distribution; the gain a is a plane over the image, fitted at each pose.
class TexturedSurface {
 public:
  TexturedSurface(const ObjectModel& object, const RectifiedStereoCamera& camera);
  ~TexturedSurface();
  TexturedSurface(TexturedSurface&&) noexcept;

  /// Another object, or another side of it that was taken for this one.
  void forget();

  /// Starts a frame: chooses the places that a pose turns towards both eyes. Silhouettes, hidden
  /// surfaces and edges of the body are kept off: what lies beside them moves, or glosses. Objects
  /// that show no texture are looked at now and then only, those that are said to have none never.
  void look(const std::array<EdgeField, 2>& fields, const Pose& camera_from_object);

  /// What the chosen places say of a pose near that of look(); zero if there are too few. From
  /// several threads.
  SurfaceEvidence evidence(const std::array<EdgeField, 2>& fields,
                           const Pose& camera_from_object) const;

  /// Share of the learned places in sight that look as learned at a pose; zero if too few are in
  /// sight to carry a pose.
  double support(const std::array<EdgeField, 2>& fields, const Pose& camera_from_object) const;

  /// Learns the brightness of what is in sight, from a pose near that of look() that can be
  /// trusted.
  void learn(const std::array<EdgeField, 2>& fields, const Pose& camera_from_object);

 private:
  struct SurfacePlace {
    Eigen::Vector3f point;   ///< [m] in the object's frame
    Eigen::Vector3f normal;  ///< unit vector, outwards
  };
  struct Spot {
    int u, v;     ///< [px] in the left eye's view
    float slope;  ///< [grey levels/px]
  };
  struct Learned;
  struct Views;
  bool knows() const;
  bool bothSee(int u, int v) const;
  void findTexture(const std::array<EdgeField, 2>& fields);
  void sample(const EdgeField& field, int eye, const std::vector<std::size_t>& indices,
              const Pose& camera_from_object, std::vector<SurfaceSample>& samples) const;
  void compareInSight(const std::array<EdgeField, 2>& fields, int eye,
                      const Pose& camera_from_object, std::vector<SurfaceSample>& samples) const;
  static void update(Learned& place, float brightness, float noise);
  SurfaceEvidence compareEyes(const std::array<EdgeField, 2>& fields,
                              const Pose& camera_from_object) const;
  SurfaceEvidence compareWithKnown(const std::array<EdgeField, 2>& fields,
                                   const Pose& camera_from_object) const;

  RectifiedStereoCamera camera_;
  std::optional<bool> said_;  ///< whether the object is textured
  std::vector<Eigen::Vector3f> vertices_;
  std::vector<std::array<std::uint32_t, 3>> triangles_;
  std::unique_ptr<Views> views_;          ///< of this frame
  std::vector<Spot> spots_;               ///< textured, the strongest of each cell
  std::vector<SurfacePlace> new_places_;  ///< textured, in sight
  std::vector<std::size_t> in_sight_;     ///< of the learned ones
  std::vector<Learned> learned_;
  std::unordered_set<std::uint64_t> cells_;  ///< that have a learned place
  float cell_ = 0;                           ///< [m] their size
  float smooth_ = 0, textured_ = 0;          ///< [px] of the surface, over the last looks
  int idle_ = 0;                             ///< frames without a look
};

}  // namespace leap_object_tracker
