#include "leap_object_tracker/tracking/pose_refiner.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "leap_object_tracker/tracking/edge_profile.hpp"
#include "leap_object_tracker/tracking/textured_surface.hpp"
#include "leap_optics.hpp"
#include "limb_shift.hpp"
#include "line_neighbours.hpp"
#include "rounded_edge.hpp"
#include "sampler.hpp"

namespace leap_object_tracker {
namespace {

constexpr double kNearest = 0.01;         // [m]
constexpr double kIndependentLength = 3;  // [px] of contour that one independent edge sample needs
constexpr double kSupportDistance = 1.5;  // [px]
constexpr float kVisibleSlope = 3;        // [noise] of an edge that is taken for one
constexpr int kLongestRange = 24;         // [px]
constexpr int kRegionReach = 5;           // [px] on either side of an outline that is looked at
constexpr float kRegionPull = 1.0F;       // of the region on the choice between edges
constexpr double kRegionWeight = 1.0;     // [px] beside an outline that speak independently
constexpr double kLearningRate = 0.1;     // a frame
constexpr double kMisfitWeight = 1.0;     // independent grey values of a profile
constexpr double kOutlineSpread = 0.4, kCreaseSpread = 0.6;  // [px]
// Against chance [nats]: an edge near an arbitrary place is seen about every third time, an outline
// nearly always, a crease often not.
constexpr double kMissedOutline = 1.5, kMissedCrease = 0.7;
// Of that, where the object is dark beside the outline, so that none may show, and where it is
// bright; as shares of the brightness beside the outline that is found.
constexpr double kMissedDark = 0.6, kMissedBright = 2;
constexpr double kDarkShare = 0.2, kBrightShare = 0.6;
constexpr float kInnerRoom = 5.5F;  // [px] to the next line that this brightness needs
// [px] that are searched however close the next line is: to move a pose, and to judge it, for which
// it does not matter which of the two an edge belongs to.
constexpr double kCrowdedRange = 0.75, kCrowdedReach = 1.6;
// [px] that a straight line has in the window of ContourLines, which gets every second point.
constexpr double kOneLine = ContourLines::kWindow / 2;
constexpr double kLeastExpected = 0.05;  // of the contrast, for a share of what shows
constexpr double kInnerContrast = 0.5;   // of an outline before another part of the body, likewise
constexpr double kSureContrast = 0.25;   // of the brightest, that an edge shows without fail
constexpr double kTextureRange = 4.5;    // [px] ranges below this look at the texture too
constexpr double kFine = 2.6;            // [px] ranges below this are searched by fitted steps
constexpr int kProfile = 7;              // [px] half length of a profile that steps are fitted to
constexpr double kLargestShift = 2;      // [px] of a fitted step
constexpr double kFittedShare = 0.625;   // of edge_sigma, that a fitted step errs by
constexpr int kShortProfile = 3;         // [px] the same, beside texture
constexpr double kNearestStep = 2, kFarthestStep = 5;  // [px] of texture, from the edge
constexpr double kTexturedNoise = 3;                   // [grey levels] that a fit leaves there
constexpr double kShortShare = 0.5;                    // of which a short one must leave no more
// [px^2] that smoothing, slopes by differences and bilinear interpolation add to its square.
constexpr double kSearchBlur = 1.9;
constexpr float kIgnoredCosine = 0.6F;
// [px] a pose whose last search was longer is not exact yet, and not worth fitted steps.
constexpr double kSettledRange = 3.5;
// Share of the contour that an eye finds: so little in one eye and so much in the other mean that
// something hides the object from the first.
constexpr double kHiddenShare = 0.4, kSeenShare = 0.7;
constexpr double kHiddenCost = 0.5;  // [nats] against each independent sample of a hidden eye
// [px] by how much the rounding and the gloss of an edge between two visible faces may move its
// image.
constexpr double kCreaseDoubt = 1.2;
constexpr double kRoundingDoubt = 0.5;  // of what is made up for of it
// Edges along one line share their errors: this share of the information of independent ones is
// left.
constexpr double kIndependentErrors = 0.4;

double tukeyWeight(double residual, double limit) {
  const double x = residual / limit;
  return std::abs(x) >= 1 ? 0 : (1 - x * x) * (1 - x * x);
}

SurfaceEvidence evidenceOf(const TexturedSurface* surface, const std::array<EdgeField, 2>& fields,
                           const Pose& pose) {
  return surface != nullptr ? surface->evidence(fields, pose) : SurfaceEvidence();
}

}  // namespace

Pose movedInCamera(const Pose& camera_from_object, const Twist& camera_twist) {
  Pose result = camera_from_object;
  result.translation() += camera_twist.head<3>();
  result.linear() = rotationFromVector(camera_twist.tail<3>()) * camera_from_object.linear();
  return result;
}

Twist cameraTwistBetween(const Pose& from, const Pose& to) {
  Twist twist;
  twist.head<3>() = to.translation() - from.translation();
  twist.tail<3>() = vectorFromRotation(to.linear() * from.linear().transpose());
  return twist;
}

/// How surely a contour between two faces shows. Faces are lit from beside the eyes, so that their
/// brightness goes with the cosine of the angle at which they are seen (Lambert); nothing can be
/// said of curved ones.
static double expectedContrast(const ContourPoint& point, const Eigen::Vector3f& to_light) {
  if (point.inner > 0) return kInnerContrast;
  float contrast = 0;
  for (const auto& face : point.faces)
    contrast += (&face == &point.faces[0] ? 1.0F : -1.0F) * std::max(0.0F, face.dot(to_light));
  const bool curved = point.faces[0].isZero() && point.faces[1].isZero();
  const double share =
      curved ? 1 : std::min(1.0, static_cast<double>(std::abs(contrast)) / kSureContrast);
  return share * share;
}

/// Signed step of the brightness along tangent x normal at a contour point, of a matt body in front
/// of the dark; of an outline towards the outside.
static float expectedStep(const ContourPoint& point, const Eigen::Vector3f& to_light) {
  constexpr float kLeastOutline = 0.15F, kLimb = 0.5F;
  const auto brightness = [&](std::size_t face) {
    return std::max(0.0F, point.faces[face].dot(to_light));
  };
  if (point.inner > 0) return 0;  // as bright as what lies behind
  if (point.limb > 0) return -kLimb;
  if (point.outline()) return -std::max(kLeastOutline, brightness(0) + brightness(1));
  return brightness(0) - brightness(1);
}

/// One contour point that was looked for in one eye.
struct PoseRefiner::Match {
  Twist jacobian;                 ///< of the offset along the normal, by the camera twist [px]
  double offset = 0;              ///< [px] from the contour to the edge, along the normal
  double variance = 1;            ///< [px^2]
  double samples = 0;             ///< independent ones that the point stands for
  double alone = 0;               ///< the same if no other line ran beside it
  double length = 0;              ///< [px]
  Eigen::Vector2f place, normal;  ///< [px], unit vector in the image
  float clearance = 0;            ///< [px] to the next line of the contour beside this one
  float step = 0;                 ///< expectedStep() along the normal, times the length
  float merged = 0;               ///< [px] along the normal to where lines on one place show
  float blended = 0;              ///< [px] the same for lines that blur together
  float before =
      -ContourLines::kFarthest;  ///< [px] where the next line against the normal is crossed
  float after = ContourLines::kFarthest;  ///< [px] the same along the normal
  int eye = 0;
  bool found = false;
  bool outline = false;
  bool limb = false;
  bool bright_inside = false;
  float inner = -1;     ///< [grey levels] beside an outline, on its inner side; negative: unknown
  double crowding = 0;  ///< [px] by which lines that blur together may move an edge
  float rounding = 0;   ///< [px] by which the rounding of a crease moves its image
  double noise = 0;     ///< [grey levels] that the fitted step left; zero: none was fitted
  /// Contrast that is to be expected, 1 enough to be seen, 0 none: for what is not seen to count.
  double expected = 1;
  float region = 0;  ///< [nats/px] by which the grey values speak for an outline here

  /// Weight among lines that the image does not tell apart.
  double visibility() const { return std::max(kLeastExpected, expected); }
};

/// How far another line of the contour runs beside each: an edge between the two belongs to the
/// nearer. Looks at the matches from `first` on.
void PoseRefiner::findClearances(std::size_t first, std::vector<Match>& matches) {
  thread_local ContourLines lines;
  lines.clear();
  for (std::size_t j = first; j < matches.size(); j += 2) {
    const Match& m = matches[j];
    lines.add(m.place.x(), m.place.y(), m.normal.x(), m.normal.y(), m.step,
              static_cast<float>(m.length * m.visibility()));
  }
  for (std::size_t i = first; i < matches.size(); i += 2) {
    const ContourLines::Neighbours beside = lines.neighbours((i - first) / 2);
    const auto middle = [](float moment, float sum, float limit) {
      return std::abs(sum) > 1e-3F ? std::clamp(moment / sum, -limit, limit) : 0.0F;
    };
    // Neighbours along the contour share it.
    for (std::size_t k = i; k < std::min(i + 2, matches.size()); ++k) {
      matches[k].before = beside.before;
      matches[k].after = beside.after;
      matches[k].clearance = std::min(-beside.before, beside.after);
      // Lines that the image does not tell apart are seen once, most of all the one that shows
      // best.
      const double own = std::max(kOneLine, matches[i].length) * matches[i].visibility();
      matches[k].samples *= std::min(1.0, own / static_cast<double>(beside.all));
      if (matches[k].limb) continue;
      matches[k].merged = middle(beside.same_moment, beside.same, ContourLines::kSameLine);
      matches[k].blended =
          beside.near * matches[i].step > 0 ? middle(beside.near_moment, beside.near, 1) : 0;
    }
  }
}

PoseRefiner::PoseRefiner(const ContourParams& params, const RectifiedStereoCamera& camera)
    : params_(params), camera_(camera), limb_shift_(&LimbShift::instance()) {}

void PoseRefiner::match(const ContourModel& model, const std::array<EdgeField, 2>& fields,
                        const Pose& pose, const std::array<ContourView, 2>* exact, double range,
                        const Appearance& appearance, bool fine, double crowded_range,
                        std::vector<Match>& matches, std::array<EyeSupport, 2>& eyes) const {
  matches.clear();
  const double focal = camera_.focal_length;
  std::array<float, 2 * (kLongestRange + kRegionReach) + 5> profile{}, slopes{};
  std::array<float, 2 * (kLongestRange + kRegionReach) + 6> ratios{};
  for (int eye = 0; eye < 2; ++eye) {
    const EdgeField& field = fields[static_cast<std::size_t>(eye)];
    eyes[static_cast<std::size_t>(eye)] = {};
    if (!field.seen()) continue;
    const Sampler<std::int16_t> sample(field, field.smooth(), 1 / 16.0F);
    const Sampler<std::uint8_t> raw(field, field.image(), 1.0F);
    const Eigen::Vector3d eye_place(eye == 0 ? 0 : camera_.baseline, 0, 0);
    const Eigen::Vector3d origin = pose.translation() - eye_place;
    const Eigen::Vector3d light(0.5 * camera_.baseline - eye_place.x(), 0, 0);
    ViewChoice choice;
    if (exact != nullptr)
      choice.view = &(*exact)[static_cast<std::size_t>(eye)];
    else
      choice = model.choose((-(pose.linear().transpose() * origin)).cast<float>());
    if (choice.view == nullptr) continue;
    Eigen::Matrix3d turn = Eigen::Matrix3d::Identity();
    turn(0, 0) = turn(1, 1) = choice.cosine;
    turn(0, 1) = -choice.sine;
    turn(1, 0) = choice.sine;
    const Eigen::Matrix3d rotation = pose.linear() * turn;

    const std::size_t first = matches.size();
    for (const ContourPoint& point : choice.view->points) {
      const Eigen::Vector3d arm = rotation * point.position.cast<double>();
      const Eigen::Vector3d at = origin + arm;
      if (at.z() < kNearest) continue;
      const double scale = focal / at.z(), x = at.x() / at.z(), y = at.y() / at.z();
      const double u = camera_.center_u + focal * x, v = camera_.center_v + focal * y;
      const Eigen::Vector3d along = rotation * point.tangent.cast<double>();
      const Eigen::Vector2d tangent(scale * (along.x() - x * along.z()),
                                    scale * (along.y() - y * along.z()));
      const double stretch = tangent.norm();
      if (stretch * point.length < 0.02) continue;  // seen end on
      auto& support = eyes[static_cast<std::size_t>(eye)];
      support.whole += stretch * point.length;
      // Off the image nothing is known.
      if (u < 1 || v < 1 || u > camera_.size.width - 3 || v > camera_.size.height - 3) continue;
      support.inside += stretch * point.length;
      Eigen::Vector2d normal(-tangent.y() / stretch, tangent.x() / stretch);
      Match match;
      match.eye = eye;
      match.length = stretch * point.length;
      match.outline = point.outline() && !(point.inner > 0);
      match.limb = point.limb > 0;
      const Eigen::Vector3f to_light =
          (rotation.transpose() * (light - at)).normalized().cast<float>();
      match.expected = expectedContrast(point, to_light);
      if (point.outline()) {
        const Eigen::Vector3d out = rotation * point.outward.cast<double>();
        if (normal.dot(Eigen::Vector2d(out.x() - x * out.z(), out.y() - y * out.z())) < 0)
          normal = -normal;
      }
      match.step = static_cast<float>(match.length) * expectedStep(point, to_light);
      const Eigen::Vector3d row =
          scale * Eigen::Vector3d(normal.x(), normal.y(), -normal.x() * x - normal.y() * y);
      match.jacobian << row, arm.cross(row);
      match.samples = match.alone = std::min(1.0, match.length / kIndependentLength);
      match.place = Eigen::Vector2f(static_cast<float>(u), static_cast<float>(v));
      if (point.limb > 0 && match.outline) {
        const double blur = std::sqrt(std::pow(kBlurU * normal.x(), 2) +
                                      std::pow(kBlurV * normal.y(), 2) + kSearchBlur);
        const double lit = static_cast<double>(point.outward.dot(to_light));
        const double spread =
            kLampSpacing / at.norm() * (rotation * point.outward.cast<double>()).x();
        const double shift =
            params_.limb_darkening * blur *
            limb_shift_->at(scale * static_cast<double>(point.limb) / blur, lit, spread);
        match.place -= static_cast<float>(shift) * normal.cast<float>();
      }
      match.normal = normal.cast<float>();
      const auto radius = static_cast<float>(params_.edge_radius);
      const bool hides = fine && !point.hidden.isZero();
      const bool crease = !point.outline() && !point.faces[0].isZero() && !point.faces[1].isZero();
      if (radius > 0 && (hides || crease)) {
        const Eigen::Vector3f lamps = (rotation.transpose() * lampsFrom(at, light)).cast<float>();
        const Eigen::Vector3f shift =
            crease
                ? roundedCreaseShift(point.faces[0], point.faces[1], point.tangent, lamps, radius)
                : roundedOutlineShown(point.faces[point.faces[0].isZero() ? 1 : 0], point.hidden,
                                      point.tangent, (rotation.transpose() * -at).cast<float>(),
                                      lamps, radius);
        const auto moved = static_cast<float>(row.dot(rotation * shift.cast<double>()));
        if (crease) match.rounding = moved;
        match.place += moved * match.normal;
      }
      matches.push_back(match);
    }

    findClearances(first, matches);
    for (std::size_t i = first; i < matches.size(); ++i) {
      Match& match = matches[i];
      const float fu = match.place.x(), fv = match.place.y();
      const float nu = match.normal.x(), nv = match.normal.y();
      const float clearance = match.clearance;
      const double own_range = std::min(range, std::max(crowded_range, 0.5 * clearance));
      const int reach = std::min(kLongestRange, static_cast<int>(std::ceil(own_range)));

      // Grey values along the normal; the part inside the region only.
      const bool region = match.outline && appearance.grey.known();
      const int span = std::max(4, reach + (region ? kRegionReach : 2));
      int low = -span, high = span;
      const auto inside = [&](int k) {
        return sample.contains(fu + static_cast<float>(k) * nu, fv + static_cast<float>(k) * nv);
      };
      while (low <= 0 && !inside(low)) ++low;
      while (high >= 0 && !inside(high)) --high;
      if (low <= -2 && high >= 2) {
        for (int k = low; k <= high; ++k)
          profile[static_cast<std::size_t>(k + span)] =
              sample(fu + static_cast<float>(k) * nu, fv + static_cast<float>(k) * nv);
        for (int k = low + 1; k < high; ++k)
          slopes[static_cast<std::size_t>(k + span)] =
              0.5F * (profile[static_cast<std::size_t>(k + span + 1)] -
                      profile[static_cast<std::size_t>(k + span - 1)]);
        // Grey values like the object's on the inner side and like the surroundings' on the outer.
        if (region) {
          ratios[static_cast<std::size_t>(low + span)] = 0;
          for (int k = low; k <= high; ++k)
            ratios[static_cast<std::size_t>(k + span + 1)] =
                ratios[static_cast<std::size_t>(k + span)] +
                appearance.grey.logRatio(profile[static_cast<std::size_t>(k + span)]);
        }
        const auto regionAt = [&](int k) {
          const auto mean = [&](int from, int to) {  // of [from, to)
            from = std::max(from, low), to = std::min(to, high + 1);
            return from >= to ? 0.0F
                              : (ratios[static_cast<std::size_t>(to + span)] -
                                 ratios[static_cast<std::size_t>(from + span)]) /
                                    static_cast<float>(to - from);
          };
          return 0.5F * (mean(k - kRegionReach, k - 1) - mean(k + 2, k + 1 + kRegionReach));
        };
        if (region) match.region = regionAt(0);
        if (match.outline && low <= -4 && match.before < -kInnerRoom)
          match.inner = (profile[static_cast<std::size_t>(span - 2)] +
                         profile[static_cast<std::size_t>(span - 3)] +
                         profile[static_cast<std::size_t>(span - 4)]) /
                        3;
        float best = 0;
        // Lines closer than the blur of the image pull each other's edges.
        match.crowding = std::max(0.0, 0.25 * (4.0 - clearance));
        const float blur = static_cast<float>(std::max(1.0, 0.5 * own_range));
        for (int k = std::max(low + 2, -reach); k <= std::min(high - 2, reach); ++k) {
          const float* slope = &slopes[static_cast<std::size_t>(k + span)];
          const float size = std::abs(*slope), sign = std::copysign(1.0F, *slope);
          const float before = slope[-1], after = slope[1];
          if (sign * before >= size || sign * after > size) continue;
          const float weakest =
              kVisibleSlope * field.slopeNoise(profile[static_cast<std::size_t>(k + span)]);
          if (size < weakest) continue;
          const float bend = sign * before - 2 * size + sign * after;
          const float place =
              static_cast<float>(k) + (bend < 0 ? 0.5F * sign * (before - after) / bend : 0.0F);
          if (std::abs(place) > own_range) continue;
          float value = std::sqrt(size) * std::exp(-0.5F * place * place / (blur * blur));
          // Towards the outside an outline darkens where the object is brighter than what is
          // behind.
          const bool brighter_inside = *slope < 0;
          if (region)
            value *= std::exp(kRegionPull * regionAt(k));
          else if (match.outline)
            value *= static_cast<float>(brighter_inside ? appearance.bright_inside
                                                        : 1 - appearance.bright_inside);
          if (value <= best) continue;
          best = value;
          match.found = true;
          match.offset = place;
          match.bright_inside = brighter_inside;
          match.variance = params_.edge_sigma * params_.edge_sigma + std::pow(weakest / size, 2) +
                           std::pow(match.crowding, 2) +
                           (match.outline ? 0.0 : kCreaseDoubt * kCreaseDoubt);
        }
        if (match.found) {
          // The edge must run along the contour: its slope lies across.
          const float eu = fu + static_cast<float>(match.offset) * nu;
          const float ev = fv + static_cast<float>(match.offset) * nv;
          if (sample.contains(eu - nv - nu, ev + nu - nv) &&
              sample.contains(eu + nv + nu, ev - nu + nv) &&
              sample.contains(eu - nv + nu, ev + nu + nv) &&
              sample.contains(eu + nv - nu, ev - nu - nv)) {
            const float across = sample(eu + nu, ev + nv) - sample(eu - nu, ev - nv);
            const float along_edge = sample(eu - nv, ev + nu) - sample(eu + nv, ev - nu);
            if (std::abs(along_edge) > 0.8F * std::abs(across)) match.found = false;
          }
        }
      }
      match.offset -= static_cast<double>(match.blended);
      if (fine && match.found && !match.limb) fit(raw, match);
      auto& support = eyes[static_cast<std::size_t>(eye)];
      support.visible += match.expected * match.length;
      if (match.found && std::abs(match.offset) < kSupportDistance)
        support.supported += match.expected * match.length;
    }
  }
}

/// [grey levels] beside the outline that each eye found, on its inner side: the median; zero if
/// little was found.
std::array<double, 2> PoseRefiner::brightnessInside(const std::vector<Match>& matches) {
  constexpr std::size_t kFewest = 6;
  std::array<double, 2> brightness{};
  thread_local std::vector<float> inner;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    inner.clear();
    for (const Match& m : matches)
      if (m.found && m.inner >= 0 && m.eye == static_cast<int>(eye)) inner.push_back(m.inner);
    if (inner.size() < kFewest) continue;
    const auto middle = inner.begin() + static_cast<std::ptrdiff_t>(inner.size() / 2);
    std::nth_element(inner.begin(), middle, inner.end());
    brightness[eye] = static_cast<double>(*middle);
  }
  return brightness;
}

/// Edges in an eye from which something hides the object are of something else: they do not move
/// the pose.
std::optional<int> PoseRefiner::ignoreHiddenEye(std::vector<Match>& matches) {
  std::array<double, 2> found{}, all{};
  for (const Match& m : matches) {
    const auto eye = static_cast<std::size_t>(m.eye);
    all[eye] += m.expected * m.samples;
    if (m.found) found[eye] += m.expected * m.samples;
  }
  for (std::size_t eye = 0; eye < 2; ++eye) {
    if (found[eye] >= kHiddenShare * all[eye] || found[1 - eye] <= kSeenShare * all[1 - eye])
      continue;
    for (Match& m : matches)
      if (m.eye == static_cast<int>(eye)) m.found = false;
    return static_cast<int>(eye);
  }
  return std::nullopt;
}

/// [px] standard deviation of the edges' offsets, by their median; `otherwise` if few were found.
double PoseRefiner::robustScale(const std::vector<Match>& matches, double otherwise) {
  thread_local std::vector<double> sizes;
  sizes.clear();
  for (const Match& m : matches)
    if (m.found) sizes.push_back(std::abs(m.offset));
  if (sizes.size() < 6) return otherwise;
  const auto middle = sizes.begin() + static_cast<std::ptrdiff_t>(sizes.size() / 2);
  std::nth_element(sizes.begin(), middle, sizes.end());
  return std::max(0.25, 1.4826 * *middle);
}

/// Replaces the place of the steepest slope by that of a fitted step.
template <class Image>
void PoseRefiner::fit(const Image& image, Match& match) const {
  const float fu = match.place.x(), fv = match.place.y();
  const float nu = match.normal.x(), nv = match.normal.y();
  const auto inside = [&](int k) {
    return image.contains(fu + static_cast<float>(k) * nu, fv + static_cast<float>(k) * nv);
  };
  int first = 0, last = 0;
  while (first > -kProfile && inside(first - 1)) --first;
  while (last < kProfile && inside(last + 1)) ++last;
  if (!inside(0)) return;
  std::array<float, 2 * kProfile + 1> grey;
  for (int k = first; k <= last; ++k)
    grey[static_cast<std::size_t>(k - first)] =
        image(fu + static_cast<float>(k) * nu, fv + static_cast<float>(k) * nv);
  const double blur = std::sqrt(std::pow(kBlurU * nu, 2) + std::pow(kBlurV * nv, 2));
  const auto before = static_cast<double>(match.before), after = static_cast<double>(match.after);
  const auto fitBetween = [&](int from, int to, double next_before, double next_after) {
    return fitProfile(grey.data() + (from - first), from, to - from + 1, blur,
                      {next_before, next_after});
  };
  auto edge = fitBetween(first, last, before, after);
  if (!edge) return;
  match.noise = edge->noise;
  // Texture beside the edge: a step of its own, or less of it.
  if (edge->noise > kTexturedNoise) {
    const auto consider = [&](const std::optional<ProfileEdge>& other) {
      if (other && other->noise < kShortShare * match.noise && other->variance < edge->variance)
        edge = other;
    };
    for (double step = kNearestStep; step <= kFarthestStep; ++step) {
      if (before < -step - 1) consider(fitBetween(first, last, -step, after));
      if (!match.outline && after > step + 1) consider(fitBetween(first, last, before, step));
    }
    if (match.outline)
      for (const auto& [from, to] :
           {std::pair(-kShortProfile, last), std::pair(first, kShortProfile),
            std::pair(-kShortProfile, kShortProfile)})
        if (from >= first && to <= last) consider(fitBetween(from, to, before, after));
  }
  if (std::abs(edge->offset) > kLargestShift) return;
  match.offset = edge->offset - static_cast<double>(match.merged);
  match.variance = std::pow(kFittedShare * params_.edge_sigma, 2) + edge->variance +
                   std::pow(kRoundingDoubt * static_cast<double>(match.rounding), 2);
}

Pose PoseRefiner::move(const ContourModel& model, const std::array<EdgeField, 2>& fields,
                       const Pose& start, const PosePrior& prior, const Appearance& appearance,
                       const std::vector<double>& ranges, const std::array<ContourView, 2>* exact,
                       const Eigen::Vector2f& ignored) const {
  Pose pose = start;
  thread_local std::vector<Match> matches;
  std::array<EyeSupport, 2> eyes;
  for (const double range : ranges) {
    match(model, fields, pose, exact, range, appearance, range < kFine, kCrowdedRange, matches,
          eyes);
    ignoreHiddenEye(matches);
    if (!ignored.isZero())
      for (Match& m : matches) {
        const float alike = m.normal.dot(ignored);
        if ((m.outline ? alike : std::abs(alike)) > kIgnoredCosine) m.found = false;
      }
    const double deviation = robustScale(matches, range);
    const double limit =
        std::min(range + 1, 4.685 * std::max(deviation, kFittedShare * params_.edge_sigma));
    // Edges that lie farther off than their noise says share a wrong pose, not wrong edges.
    const double inflation = std::max(1.0, deviation / params_.edge_sigma);
    Matrix6d information = prior.information;
    const Twist from_mean = cameraTwistBetween(prior.mean, pose);
    Twist gradient = -prior.information * from_mean;
    Matrix6d damping = Matrix6d::Zero();
    damping.diagonal() << 1, 1, 1, 1e-3, 1e-3, 1e-3;
    for (const Match& m : matches) {
      if (!m.found) continue;
      const double weight =
          tukeyWeight(m.offset, limit) * m.samples / (m.variance * inflation * inflation);
      information.noalias() += weight * m.jacobian * m.jacobian.transpose();
      gradient += weight * m.offset * m.jacobian;
    }
    if (range < kTextureRange) {
      const SurfaceEvidence texture = evidenceOf(appearance.texture, fields, pose);
      information += texture.information;
      gradient += texture.gradient;
    }
    // Directions that neither edges nor prior bind stay where they are.
    const Twist step = (information + damping).ldlt().solve(gradient);
    if (!step.allFinite()) break;
    Twist limited = step;
    const double turn = limited.tail<3>().norm();
    if (turn > 0.35) limited *= 0.35 / turn;
    pose = normalized(movedInCamera(pose, limited));
  }
  return pose;
}

RefinedPose PoseRefiner::refine(const ContourModel& model, const std::array<EdgeField, 2>& fields,
                                const Pose& start, const PosePrior& prior,
                                const Appearance& appearance, const std::vector<double>& ranges,
                                const std::array<ContourView, 2>* exact) const {
  const Pose pose = move(model, fields, start, prior, appearance, ranges, exact);
  return judge(model, fields, pose, appearance, ranges.empty() || ranges.back() < kSettledRange,
               exact);
}

/// What the image says about a pose.
/// @param fitted_steps whether edges are placed by fitted steps or by the steepest slope
RefinedPose PoseRefiner::judge(const ContourModel& model, const std::array<EdgeField, 2>& fields,
                               const Pose& pose, const Appearance& appearance, bool fitted_steps,
                               const std::array<ContourView, 2>* exact) const {
  RefinedPose result;
  result.camera_from_object = pose;
  thread_local std::vector<Match> matches;
  const double last_range = 2.5;
  match(model, fields, pose, exact, last_range, appearance, fitted_steps, kCrowdedReach, matches,
        result.eyes);
  const std::optional<int> hidden = result.hidden_eye = ignoreHiddenEye(matches);
  const double deviation = robustScale(matches, last_range);
  result.residual = deviation;
  double bright = 0, judged = 0, found = 0, squares = 0;
  const std::array<double, 2> typical = brightnessInside(matches);
  for (const Match& m : matches) {
    if (hidden == m.eye) {
      result.log_likelihood -= m.expected * m.samples * kHiddenCost;
      continue;
    }
    double missed = m.expected * (m.outline ? kMissedOutline : kMissedCrease);
    if (m.outline && !m.found && typical[static_cast<std::size_t>(m.eye)] > 0) {
      // A face too narrow to be looked at is as bright as it is turned to the lamps.
      const double share =
          m.inner >= 0 ? static_cast<double>(m.inner) / typical[static_cast<std::size_t>(m.eye)]
                       : static_cast<double>(std::abs(m.step)) / m.length;
      missed *= kMissedDark +
                (kMissedBright - kMissedDark) *
                    std::clamp((share - kDarkShare) / (kBrightShare - kDarkShare), 0.0, 1.0);
    }
    double gain = -missed;
    if (m.found) {
      const double weight =
          tukeyWeight(m.offset, 4.685 * std::max(deviation, kFittedShare * params_.edge_sigma));
      result.information.noalias() += kIndependentErrors * weight * m.samples / m.variance *
                                      m.jacobian * m.jacobian.transpose();
      found += weight * m.samples;
      squares += weight * m.samples * m.offset * m.offset / m.variance;
      result.leverage.noalias() += weight * m.samples * m.jacobian * m.jacobian.transpose();
      if (m.outline && std::abs(m.offset) < kSupportDistance) {
        judged += m.length;
        if (m.bright_inside) bright += m.length;
      }
      const double spread = std::hypot(m.outline ? kOutlineSpread : kCreaseSpread, m.crowding);
      gain = std::max(gain, 1 - 0.5 * std::pow(m.offset / spread, 2));
    }
    // A narrow or dark face says nothing against the outline that it ends at.
    const double heard = m.alone * (m.region < 0 ? m.expected : 1);
    result.log_likelihood +=
        m.samples * gain + kRegionWeight * heard * static_cast<double>(m.region);
  }
  if (found > 0) {
    result.leverage /= found;
    result.scatter = squares / found;
  }
  result.evidence = result.log_likelihood;
  // Lines that the model lacks or has too many spoil the fits; points without a fit do not count.
  // It is the outline that weighs them: poses that show more creases are not worse for it.
  double misfit = 0, fitted = 0, all = 0;
  for (const Match& m : matches) {
    if (m.outline) all += m.expected * m.alone;
    if (m.noise <= 0) continue;
    fitted += m.samples;
    misfit += m.samples * std::log(std::clamp(m.noise, 1.0, 20.0));
  }
  if (fitted > 0) result.misfit = kMisfitWeight * all * misfit / fitted;
  result.log_likelihood -= result.misfit;
  const SurfaceEvidence texture = evidenceOf(appearance.texture, fields, pose);
  result.texture_information = texture.information;
  result.information += texture.information;
  result.log_likelihood += texture.log_likelihood;
  result.bright_inside = judged > 0 ? bright / judged : 0.5;
  return result;
}

void PoseRefiner::learn(const ContourModel& model, const std::array<EdgeField, 2>& fields,
                        const Pose& pose, Appearance& appearance,
                        const std::array<ContourView, 2>* exact) const {
  thread_local std::vector<Match> matches;
  std::array<EyeSupport, 2> eyes;
  match(model, fields, pose, exact, 2.0, appearance, false, kCrowdedRange, matches, eyes);
  GreyModel::Histogram inside{}, outside{};
  double bright = 0, judged = 0;
  for (const Match& m : matches) {
    if (!m.outline || !m.found || std::abs(m.offset) > kSupportDistance) continue;
    judged += m.length;
    if (m.bright_inside) bright += m.length;
    const EdgeField& field = fields[static_cast<std::size_t>(m.eye)];
    const Sampler<std::uint8_t> grey(field, field.image(), 1.0F);
    for (int k = 2; k < 2 + kRegionReach; ++k)
      for (const int side : {-1, 1}) {
        const float u = m.place.x() + static_cast<float>(side * k) * m.normal.x();
        const float v = m.place.y() + static_cast<float>(side * k) * m.normal.y();
        if (!grey.contains(u, v)) continue;
        (side < 0 ? inside : outside)[static_cast<std::size_t>(
            GreyModel::bin(static_cast<std::uint8_t>(grey(u, v))))] += 1;
      }
  }
  if (judged <= 0) return;
  appearance.grey.learn(inside, outside, kLearningRate);
  appearance.bright_inside = std::clamp(
      appearance.bright_inside + 0.1 * (bright / judged - appearance.bright_inside), 0.2, 0.95);
}

std::optional<std::array<ContourView, 2>> exactViews(const ContourModel& model,
                                                     const Pose& camera_from_object,
                                                     double baseline) {
  std::array<std::optional<ContourView>, 2> views;
  tbb::parallel_for(std::size_t{0}, std::size_t{2}, [&](std::size_t eye) {
    Eigen::Vector3d origin = camera_from_object.translation();
    if (eye == 1) origin.x() -= baseline;
    views[eye] = model.exactView(-(camera_from_object.linear().transpose() * origin));
  });
  if (!views[0] || !views[1]) return std::nullopt;
  return std::array<ContourView, 2>{*std::move(views[0]), *std::move(views[1])};
}

void refineExactly(const PoseRefiner& refiner, const ContourModel& model,
                   const std::array<EdgeField, 2>& fields, double baseline, const PosePrior& prior,
                   const Appearance& appearance, RefinedPose& refined) {
  const auto exact = exactViews(model, refined.camera_from_object, baseline);
  if (exact)
    refined = refiner.refine(model, fields, refined.camera_from_object, prior, appearance, {3, 2.5},
                             &*exact);
}

}  // namespace leap_object_tracker
