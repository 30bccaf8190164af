#pragma once

#include <optional>
#include <vector>

#include "leap_object_tracker/geometry/symmetry.hpp"
#include "leap_object_tracker/tracking/contour_measurement.hpp"
#include "leap_object_tracker/tracking/contour_model.hpp"
#include "leap_object_tracker/tracking/pose_refiner.hpp"
#include "leap_object_tracker/tracking/shaded_view.hpp"

namespace leap_object_tracker {

/// Bodies that look nearly the same turned over or round, such as a mug upside down: the likeliest
/// turned pose is held against the one that is tracked, by contour and shading, and takes its place
/// once it has been clearly better over several looks (Wald, "Sequential tests of statistical
/// hypotheses", 1945, with the gain of one look bounded: looks share their errors).
class TurnedRivals {
 public:
  /// The models must outlive this. @param baseline [m] of the eyes
  TurnedRivals(const Symmetry& symmetry, const ContourModel& model, const PoseRefiner& refiner,
               const ShadedView& shaded_view, double baseline);

  void forget();

  /// One look at the last frame.
  /// @param turned poses at the place of `pose` in which the object looks nearly the same
  /// @param young whether the pose stands since few frames only, on hardly more than one look
  /// @return the pose to take instead, refined; nothing while `pose` stands
  std::optional<Pose> look(const Pose& pose, const std::vector<Pose>& turned,
                           const ContourMeasurement& measurement, const Appearance& appearance,
                           bool young);

 private:
  std::vector<RefinedPose> likeliest(const Pose& pose, const std::vector<Pose>& turned,
                                     const ContourMeasurement& measurement,
                                     const Appearance& appearance) const;

  Symmetry symmetry_;
  double baseline_;
  const ContourModel* model_;
  const PoseRefiner* refiner_;
  const ShadedView* shaded_view_;
  std::optional<Pose> rival_;  ///< object_from_object of the likeliest turned pose
  double lead_ = 0;            ///< [nats] by which it was better, over all looks
};

}  // namespace leap_object_tracker
