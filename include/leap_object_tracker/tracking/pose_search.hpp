#pragma once

#include <array>
#include <functional>
#include <optional>
#include <utility>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/geometry/stereo_frame.hpp"
#include "leap_object_tracker/tracking/bright_regions.hpp"
#include "leap_object_tracker/tracking/contour_kernel.hpp"
#include "leap_object_tracker/tracking/contour_model.hpp"
#include "leap_object_tracker/tracking/contour_reach.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"
#include "leap_object_tracker/tracking/eye_agreement.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/shaded_view.hpp"
#include "leap_object_tracker/tracking/surface_places.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// A pose that was searched for.
struct FoundPose {
  RefinedPose refined;
  std::optional<Pose> rival;  ///< the likeliest there that is more than 10 deg or 10 mm away
  /// [nats] by which it is less likely, infinite without one: little of a body that looks nearly
  /// the same another way.
  double lead = 0;
};

/// Finds an object anywhere in the working volume, in one frame.
///
/// 1. Places: stable bright or dark regions (findBrightRegions) whose size fits the object; depth
///    from the same region in the other eye, else from the region's area. Or surfaces that both
///    eyes see (SurfacePlaces), with one eye all that has edges enough (placesAmongEdges).
/// 2. Orientations: an even set over SO(3) (super-Fibonacci spirals, Alexa 2022), one of each class
///    of equivalent ones, shifted and scaled to the reach of each region in both eyes; scored by
///    the blunt contour likelihood and by that reach. The best are fitted to it in all six
///    directions. At a surface or among edges: the same set at and beside its place, scored by the
///    contour alone.
/// 3. The best ones move in random steps that shrink; before and after that they are refined on
///    sub-pixel edges, and ranked by their contour and by how the eyes agree on the texture inside
///    it (EyeAgreement).
/// 4. The best of each place, its turned ones and what else was found there are compared on the
///    contour of their exact views and by their shading.
class PoseSearch {
 public:
  PoseSearch(const TrackerParams& params, const ObjectModel& object, const ContourModel& model,
             const RectifiedStereoCamera& camera);

  /// Where find() looks.
  enum class Where {
    kBrightRegions,  ///< what is brighter than all around it
    kDarkRegions,    ///< what is darker, as before a lit wall
    kSurfaces,       ///< surfaces that both eyes see, with one eye places among edges; bright
                     ///< regions if there are none
  };

  struct Query {
    Where where = Where::kBrightRegions;
    std::optional<Pose> near;      ///< camera_from_object near which to look as well
    std::vector<Pose> candidates;  ///< likewise, to be compared with what is found
  };

  /// @param enough asked about the best pose of one place after the other, at most three: whether
  /// to look no further
  /// @return the pose at which it said so, else the best one; nothing if no place looks like the
  /// object.
  std::optional<FoundPose> find(const RectifiedStereoFrame& frame, const Query& query,
                                const std::function<bool(const FoundPose&)>& enough);

  /// A pose refined and judged on the last frame as those that find() compares.
  RefinedPose judge(const Pose& camera_from_object) const;

  /// Takes the looks of the object at a pose in the last frame into `appearance`.
  void learn(const Pose& camera_from_object, Appearance& appearance) const;

  /// Poses at the same place in which the object looks nearly as at this one: turned over, or round
  /// its axes.
  std::vector<Pose> turned(const Pose& camera_from_object) const;

  const ShadedView& shadedView() const { return shaded_view_; }

  int orientations() const { return static_cast<int>(orientations_.size()); }

 private:
  struct Hypothesis {
    ParticlePose pose;
    float score = 0;
    std::size_t place = 0;
  };
  /// Where the object may be, and the regions that it then fills.
  struct Place {
    Eigen::Vector3d point;  ///< [m]
    double doubt = 0;
    std::array<std::optional<BrightRegion>, 2> regions;  ///< by eye
  };

  std::vector<Hypothesis> startsAtRegions(const std::vector<Place>& places) const;
  std::vector<Hypothesis> startsAtSurfaces(const RectifiedStereoFrame& frame) const;
  std::vector<Hypothesis> startsAmongEdges() const;
  void addOriented(const Eigen::Vector3d& place, const Eigen::Matrix3d& facing, std::size_t index,
                   std::vector<Hypothesis>& hypotheses) const;
  std::vector<Place> findPlaces(const RectifiedStereoFrame& frame, bool dark) const;
  /// Origin and rotation of the object as one eye sees them.
  std::pair<Eigen::Vector3f, Eigen::Matrix3f> seenFrom(const ParticlePose& pose,
                                                       std::size_t eye) const;
  float contourLength(const ParticlePose& pose, std::size_t eye, int points) const;
  BrightRegion::Extents reachInImage(const ParticlePose& pose, std::size_t eye) const;
  BrightRegion::Extents apart(const BrightRegion& region, const BrightRegion::Extents& reach) const;
  float hullDoubt(const BrightRegion::Extents& reach, const BrightRegion& region) const;
  std::optional<Pose> fitToRegions(const Pose& pose, const Place& place) const;
  Pose shapedToRegions(const Pose& start, const Place& place) const;
  void shape(std::vector<Hypothesis>& hypotheses, const std::vector<Place>& places) const;
  std::vector<Hypothesis> distinct(std::vector<Hypothesis>& hypotheses, std::size_t count,
                                   double apart) const;
  double reachOf(const Pose& pose) const;
  void compareEyes(RefinedPose& refined) const;
  void toAgreeingDepth(RefinedPose& refined) const;
  bool areWithin(double apart, const Pose& a, const Pose& b) const;
  RefinedPose refineByOwnLooks(const Pose& pose, const std::vector<double>& ranges,
                               const std::array<ContourView, 2>* exact = nullptr) const;
  void settle(RefinedPose& refined) const;
  FoundPose bestTurned(const RefinedPose& pose, const std::vector<Pose>& rivals) const;
  void scoreAll(std::vector<Hypothesis>& hypotheses, int points, const std::array<GainMap, 2>& maps,
                const std::vector<Place>& places) const;
  const std::array<GainMap, 2>& mapsFor(double depth, int sharpening = 0) const;

  TrackerParams params_;
  RectifiedStereoCamera camera_;
  const ContourModel* model_;
  PoseRefiner refiner_;
  ShadedView shaded_view_;
  EyeAgreement agreement_;
  ShadowArea shadow_;  ///< of the object from all sides
  SurfacePlaces surface_places_;
  std::vector<Eigen::Vector3d> pivots_;  ///< [m] of turned()
  std::vector<float> hull_;              ///< [m] outermost vertices: all x, y, z
  Eigen::AlignedBox2f window_;           ///< of the image, over the focal length
  Symmetry symmetry_;
  std::vector<Eigen::Matrix3d> turns_;
  std::vector<Eigen::Matrix3d> orientations_;
  std::array<EdgeField, 2> fields_;
  std::array<std::array<GainMap, 2>, 4> maps_;  ///< by cell size 1, 2, 4, 8 px; by eye
  std::uint64_t calls_ = 0;
};

}  // namespace leap_object_tracker
