#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "leap_object_tracker/geometry/pose.hpp"
#include "leap_object_tracker/geometry/stereo_camera.hpp"
#include "leap_object_tracker/tracking/contour_model.hpp"
#include "leap_object_tracker/tracking/edge_field.hpp"
#include "leap_object_tracker/tracking/grey_model.hpp"
#include "leap_object_tracker/tracking/tracker_params.hpp"

namespace leap_object_tracker {

/// A pose moved by a twist along the fixed axes of the camera: translation added, rotation
/// multiplied from the left.
Pose movedInCamera(const Pose& camera_from_object, const Twist& camera_twist);
/// The twist with movedInCamera(from, twist) == to.
Twist cameraTwistBetween(const Pose& from, const Pose& to);

class LimbShift;

/// What is known of a pose before the image speaks: a Gaussian of the camera twist about `mean`.
struct PosePrior {
  Pose mean = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();  ///< inverse covariance; zero: nothing is known
};

/// How one eye supports a pose. Lengths count by the contrast that is to be expected.
struct EyeSupport {
  double visible = 0;    ///< [px] length of the contour inside the image
  double supported = 0;  ///< [px] of it, with an edge of the right direction at the right place
  double whole = 0;      ///< [px] length of the contour, inside the image or not
  double inside = 0;     ///< [px] of it inside the image

  double share() const { return visible > 0 ? supported / visible : 0; }
};

struct RefinedPose {
  Pose camera_from_object = Pose::Identity();
  Matrix6d information = Matrix6d::Zero();          ///< of the image alone, of the camera twist
  Matrix6d texture_information = Matrix6d::Zero();  ///< the share of it that texture gives
  /// Mean over the contour that was found of the squared Jacobian of its place across it [px^2], by
  /// the camera twist: how far the contour moves with the pose, whatever the noise.
  Matrix6d leverage = Matrix6d::Zero();
  std::array<EyeSupport, 2> eyes;
  std::optional<int> hidden_eye;  ///< from which something seems to hide the object
  double residual = 0;            ///< [px] robust standard deviation of the edges about the contour
  /// Mean square of the edges' distances from the contour, each over the variance that it was
  /// expected to have: the variance of unit weight (Foerstner and Wrobel 2016, sec. 4.2.3) of the
  /// information, but for the few degrees of freedom.
  double scatter = 0;
  double bright_inside =
      0;  ///< share of supported outline on whose inner side the image is brighter
  double log_likelihood = 0;  ///< sum over independent samples of the gain against chance [nats]
  double misfit = 0;          ///< [nats] of it, against lines too many or missing

  /// The same without regard to what the image shows besides [nats]: compares poses of different
  /// places. With what EyeAgreement says, of poses that were searched for.
  double evidence = 0;

  /// Share of the contour that lies inside the images.
  double insideShare() const {
    const double whole = eyes[0].whole + eyes[1].whole;
    return whole > 0 ? (eyes[0].inside + eyes[1].inside) / whole : 0;
  }

  /// Evidence for each pixel of contour that should be seen [nats/px].
  double strength() const {
    const double visible = eyes[0].visible + eyes[1].visible;
    return visible > 0 ? evidence / visible : 0;
  }

  /// Share of the contour that the eye supports which sees it best.
  double bestEyeSupport() const { return std::max(eyes[0].share(), eyes[1].share()); }

  /// Share of the contour that the eyes support, both together.
  double support() const {
    const double visible = eyes[0].visible + eyes[1].visible;
    return visible > 0 ? (eyes[0].supported + eyes[1].supported) / visible : 0;
  }

  /// The same without an eye from which something hides the object.
  double seenSupport() const {
    return hidden_eye ? eyes[static_cast<std::size_t>(1 - *hidden_eye)].share() : support();
  }
};

/// Moves a pose until its visible contour lies on sub-pixel edges of both eyes: Gauss-Newton over
/// one-dimensional searches along the contour's normals (RAPID, Harris and Stennett 1990; moving
/// edges, Comport et al. 2006), with Tukey weights and a Gaussian prior.
class PoseRefiner {
 public:
  PoseRefiner(const ContourParams& params, const RectifiedStereoCamera& camera);

  /// Where a pose goes, without asking what the image says about it there.
  /// @param ranges [px] half length of the search of each iteration
  /// @param exact views of both eyes to use instead of the model's, from a place close by
  /// @param ignored unit vector in the image: contour that looks this way does not move the pose;
  /// zero: all of it does
  Pose move(const ContourModel& model, const std::array<EdgeField, 2>& fields, const Pose& start,
            const PosePrior& prior, const Appearance& appearance, const std::vector<double>& ranges,
            const std::array<ContourView, 2>* exact = nullptr,
            const Eigen::Vector2f& ignored = Eigen::Vector2f::Zero()) const;

  /// Moves a pose and judges it there.
  /// @param ranges as above; none: only judges
  /// @param exact as above
  RefinedPose refine(const ContourModel& model, const std::array<EdgeField, 2>& fields,
                     const Pose& start, const PosePrior& prior, const Appearance& appearance,
                     const std::vector<double>& ranges,
                     const std::array<ContourView, 2>* exact = nullptr) const;

  /// Takes the looks of the object at a pose that can be trusted into `appearance`.
  /// @param exact as above
  void learn(const ContourModel& model, const std::array<EdgeField, 2>& fields, const Pose& pose,
             Appearance& appearance, const std::array<ContourView, 2>* exact = nullptr) const;

 private:
  struct Match;
  static void findClearances(std::size_t first, std::vector<Match>& matches);
  static std::array<double, 2> brightnessInside(const std::vector<Match>& matches);
  static std::optional<int> ignoreHiddenEye(std::vector<Match>& matches);
  static double robustScale(const std::vector<Match>& matches, double otherwise);
  RefinedPose judge(const ContourModel& model, const std::array<EdgeField, 2>& fields,
                    const Pose& pose, const Appearance& appearance, bool fitted_steps,
                    const std::array<ContourView, 2>* exact) const;
  void match(const ContourModel& model, const std::array<EdgeField, 2>& fields, const Pose& pose,
             const std::array<ContourView, 2>* exact, double range, const Appearance& appearance,
             bool fine, double crowded_range, std::vector<Match>& matches,
             std::array<EyeSupport, 2>& eyes) const;
  template <class Image>
  void fit(const Image& image, Match& match) const;

  ContourParams params_;
  RectifiedStereoCamera camera_;
  const LimbShift* limb_shift_;
};

/// What both eyes see of the contour at exactly this pose, where the model knows only views nearby;
/// nothing if it knows them all.
/// @param baseline [m] of the eyes
std::optional<std::array<ContourView, 2>> exactViews(const ContourModel& model,
                                                     const Pose& camera_from_object,
                                                     double baseline);

/// Refines once more on the contour of exactly this view, where the model knows only one nearby.
/// @param baseline [m] of the eyes
void refineExactly(const PoseRefiner& refiner, const ContourModel& model,
                   const std::array<EdgeField, 2>& fields, double baseline, const PosePrior& prior,
                   const Appearance& appearance, RefinedPose& refined);

}  // namespace leap_object_tracker
