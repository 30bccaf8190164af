#include "leap_object_tracker/tracking/pose_search.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <opencv2/imgproc.hpp>

#include "leap_object_tracker/tracking/edge_places.hpp"
#include "tracking/random.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kOrientations = 1200;  // about 23 deg apart over all of SO(3)
constexpr std::size_t kMostPlaces = 10;
constexpr double kWorstArea = 1.4;  // log of the ratio to the object's largest or least shadow
constexpr double kDoubtOfOneEye = 0.5, kDoubtOfClosing = 0.1;
constexpr double kTrustOfContrast = 0.3;   // a doubling of the thresholds that a region stands
constexpr std::size_t kTurned = 24;        // of the turned poses that are refined
constexpr float kNearest = 0.01F;          // [m] of any part of a pose
constexpr int kHullDirections = 100;       // in which the outermost vertices of the body are taken
constexpr float kFewestDirections = 6;     // in which a region's reach must be known
constexpr double kLeastInside = 0.6;       // of the area of a body that the border cuts
constexpr float kLeastGrowth = 0.7F;       // of the projection, to fit a region or texture
constexpr float kHullSpread = 1.5F;        // [px] of a region's reach
constexpr float kWorstHull = 3;            // [nats] of one direction
constexpr float kIndependentHull = 0.25F;  // share of directions that speak independently
constexpr std::size_t kShaped = 400;       // hypotheses of a place whose outline is fitted to it
constexpr int kShapeSteps = 5;
constexpr float kShapeShift = 0.3F;        // of the depth, by which it may move in one step
constexpr float kShapeTurn = 0.3F;         // [rad] likewise
constexpr int kCoarsePoints = 32;          // of the contour, for the first look
constexpr std::size_t kLikelyPlaces = 3;   // first by how well their region fits
constexpr std::size_t kKeptAtLikely = 30;  // hypotheses of such a place that move on
constexpr std::size_t kKeptElsewhere = 8;
constexpr int kChildren = 20;  // random steps of each, a round
constexpr int kRounds = 4;
constexpr std::size_t kRefinedAtLikely = 5, kRefinedElsewhere = 1;  // moved and unmoved ones
constexpr std::size_t kPromising = 16;    // poses that are refined to the end
constexpr double kReach = 0.2;            // of a pose's error, as a share of the object's radius
constexpr std::size_t kAsked = 3;         // places whose best pose is offered
constexpr double kHopelessSupport = 0.5;  // of a pose that turning it will not save
constexpr double kClearTexture = 30;      // [nats] of the eyes' agreement that may move a pose
constexpr double kLeastInImages = 0.1;    // of the contour of a pose
constexpr double kHopelessToMove = 0.2;   // the same, of a pose not refined to the end
constexpr std::size_t kExactlySeen = 8;   // of the turned poses that are compared at last
constexpr double kShadedReach = 60;       // [nats] by which their contour may be worse
constexpr double kSame = 0.05;            // [rad], and of the radius, of poses that are the same
constexpr double kApartTurn = M_PI / 18;  // [rad] of poses that differ for sure
constexpr double kApart = 0.01;           // [m]
constexpr float kIndependentShare = 1 / 3.0F;  // samples per pixel of contour
// Of the best score that so much contour could have: less speaks against a pose. Without it, views
// that show more contour would win.
constexpr float kToBeExpected = 0.65F;
constexpr std::size_t kMostSurfaces = 40;  // where a body may be
constexpr double kSurfaceStep = 0.35;      // of the body's size, to the poses beside such a place
constexpr std::size_t kKeptAtSurface = 10, kRefinedAtSurface = 3;
constexpr std::size_t kMostOriented = 400'000;  // poses at places among edges
constexpr std::size_t kAmongEdges = 24;         // such places that are looked at more closely
constexpr double kApartAmongEdges = 0.7;        // of the body's size, between these
constexpr std::size_t kKeptAmongEdges = 4;      // hypotheses at all but the likeliest
// Number of the place of the pose to look near: of no other.
constexpr std::size_t kNear = std::numeric_limits<std::size_t>::max();
constexpr EdgeKernel kBlunt{3.0F, 3.0F};

/// Even set over SO(3) (Alexa, "Super-Fibonacci spirals", CVPR 2022, algorithm 1).
std::vector<Eigen::Matrix3d> evenRotations(int count) {
  constexpr double kPhi = 1.4142135623730951, kPsi = 1.533751168755204288118041;
  std::vector<Eigen::Matrix3d> rotations;
  for (int i = 0; i < count; ++i) {
    const double s = i + 0.5, r = std::sqrt(s / count), big = std::sqrt(1 - s / count);
    const double alpha = 2 * M_PI * s / kPhi, beta = 2 * M_PI * s / kPsi;
    rotations.push_back(Eigen::Quaterniond(big * std::cos(beta), r * std::sin(alpha),
                                           r * std::cos(alpha), big * std::sin(beta))
                            .normalized()
                            .toRotationMatrix());
  }
  return rotations;
}

/// Orientations are laid out as seen along the ray to a place.
Eigen::Matrix3d facingTo(const Eigen::Vector3d& place) {
  return Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), place).toRotationMatrix();
}

/// One of each class of orientations that look the same.
std::vector<Eigen::Matrix3d> distinctRotations(const Symmetry& symmetry, int count) {
  std::vector<Eigen::Matrix3d> kept;
  if (symmetry.hasFreeAxis()) {
    // Only the direction of the axis matters: as many as there are 15 deg caps on a sphere.
    const int directions = 240;
    for (int i = 0; i < directions; ++i)
      kept.push_back(
          Eigen::Quaterniond::FromTwoVectors(symmetry.free_axis, evenDirection(i, directions))
              .toRotationMatrix());
    return kept;
  }
  for (const auto& rotation : evenRotations(count)) {
    const double trace = rotation.trace();
    const bool nearest = std::all_of(
        symmetry.rotations.begin(), symmetry.rotations.end(),
        [&](const Eigen::Matrix3d& g) { return (rotation * g).trace() <= trace + 1e-9; });
    if (nearest) kept.push_back(rotation);
  }
  return kept;
}

/// Turns after which a body may look nearly the same: upside down, and round its axes.
std::vector<Eigen::Matrix3d> turnsToTry(const Symmetry& symmetry) {
  std::vector<Eigen::Matrix3d> turns;
  const auto add = [&](const Eigen::Matrix3d& turn) {
    // The axes of all poses that look the same.
    for (const Eigen::Matrix3d& same : symmetry.rotations) {
      const Eigen::Matrix3d all = same * turn;
      const auto alike = [&](const Eigen::Matrix3d& other) {
        return angleBetween(all, other, symmetry) < 0.1;
      };
      if (!alike(Eigen::Matrix3d::Identity()) && std::none_of(turns.begin(), turns.end(), alike))
        turns.push_back(all);
    }
  };
  for (int axis = 0; axis < 3; ++axis) {
    const int steps = symmetry.rotations.size() > 1 || symmetry.hasFreeAxis() ? 4 : 24;
    for (int step = 1; step < steps; ++step) {
      const Eigen::Vector3d spin = Eigen::Vector3d::Unit(axis) * (2 * M_PI * step / steps);
      for (int flip = 0; flip < 2; ++flip)
        add(rotationFromVector(spin) *
            rotationFromVector(flip * M_PI * Eigen::Vector3d::Unit((axis + 1) % 3)));
    }
  }
  return turns;
}

/// The outermost vertices of a mesh by direction, as arrays of x, y and z: as many as fill whole
/// blocks of 16.
std::vector<float> outermostVertices(const Mesh& mesh) {
  std::vector<std::size_t> chosen;
  for (int i = 0; i < kHullDirections; ++i) {
    const Eigen::Vector3d direction = evenDirection(i, kHullDirections);
    std::size_t farthest = 0;
    for (std::size_t v = 1; v < mesh.vertices.size(); ++v)
      if (direction.dot(mesh.vertices[v] - mesh.vertices[farthest]) > 0) farthest = v;
    chosen.push_back(farthest);
  }
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  while (chosen.size() % 16 != 0) chosen.push_back(chosen.back());
  std::vector<float> arrays(3 * chosen.size());
  for (std::size_t i = 0; i < chosen.size(); ++i)
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      arrays[static_cast<std::size_t>(axis) * chosen.size() + i] =
          static_cast<float>(mesh.vertices[chosen[i]][axis]);
  return arrays;
}

/// [px] standard deviation of a region's reach.
float spreadOf(const BrightRegion& region) {
  return kHullSpread + 0.02F * static_cast<float>(std::sqrt(region.area));
}

Eigen::AlignedBox2f windowOf(const RectifiedStereoCamera& camera) {
  const Eigen::Vector2d center(camera.center_u, camera.center_v);
  const Eigen::Vector2d size(camera.size.width - 1, camera.size.height - 1);
  return {(-center / camera.focal_length).cast<float>(),
          ((size - center) / camera.focal_length).cast<float>()};
}

/// About what a body may be turned and still look nearly the same: the middle of the box around it
/// and, along each axis on which that is elsewhere, the median of its surface, which a handle
/// hardly moves.
std::vector<Eigen::Vector3d> pivotsOf(const Mesh& mesh) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero(), median = middle;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::vector<std::pair<double, double>> places;  // [m, m^2]
    double all = 0, low = 1e9, high = -1e9;
    for (const auto& t : mesh.triangles) {
      const auto &a = mesh.vertices[t[0]], &b = mesh.vertices[t[1]], &c = mesh.vertices[t[2]];
      places.emplace_back((a[axis] + b[axis] + c[axis]) / 3, (b - a).cross(c - a).norm());
      all += places.back().second;
      low = std::min({low, a[axis], b[axis], c[axis]});
      high = std::max({high, a[axis], b[axis], c[axis]});
    }
    std::sort(places.begin(), places.end());
    double passed = 0;
    for (const auto& [place, area] : places)
      if ((passed += area) >= all / 2) {
        median[axis] = place;
        break;
      }
    middle[axis] = (low + high) / 2;
  }
  std::vector<Eigen::Vector3d> pivots{middle};
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    if (std::abs(median[axis] - middle[axis]) < 0.002) continue;
    const std::size_t count = pivots.size();
    for (std::size_t i = 0; i < count; ++i) {
      pivots.push_back(pivots[i]);
      pivots.back()[axis] = median[axis];
    }
  }
  return pivots;
}

}  // namespace

PoseSearch::PoseSearch(const TrackerParams& params, const ObjectModel& object,
                       const ContourModel& model, const RectifiedStereoCamera& camera)
    : params_(params),
      camera_(camera),
      model_(&model),
      refiner_(params.contour, camera),
      shaded_view_(object.mesh, camera),
      agreement_(object.mesh, camera),
      shadow_(shadowAreaOf(object.mesh)),
      surface_places_(camera, params.volume.nearest, params.volume.farthest,
                      std::sqrt(shadow_.mean / M_PI)),
      pivots_(pivotsOf(object.mesh)),
      hull_(outermostVertices(object.mesh)),
      window_(windowOf(camera)),
      symmetry_(object.symmetry),
      turns_(turnsToTry(object.symmetry)),
      orientations_(distinctRotations(object.symmetry, kOrientations)) {}

std::pair<Eigen::Vector3f, Eigen::Matrix3f> PoseSearch::seenFrom(const ParticlePose& pose,
                                                                 std::size_t eye) const {
  using RowMajor = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  return {{pose.translation[0] - (eye == 0 ? 0.0F : static_cast<float>(camera_.baseline)),
           pose.translation[1], pose.translation[2]},
          Eigen::Map<const RowMajor>(pose.rotation.data())};
}

std::vector<PoseSearch::Place> PoseSearch::findPlaces(const RectifiedStereoFrame& frame,
                                                      bool dark) const {
  std::vector<Place> places;
  const double focal = camera_.focal_length;
  std::array<std::vector<BrightRegion>, 2> regions;
  tbb::parallel_for(std::size_t{0}, std::size_t{2}, [&](std::size_t eye) {
    if (params_.eyes == (eye == 0 ? Eyes::kRight : Eyes::kLeft)) return;
    const cv::Mat& image = eye == 0 ? frame.left : frame.right;
    regions[eye] = dark ? findDarkRegions(image) : findBrightRegions(image);
  });
  // A shadow looks larger beside the optical axis by the inverse of this.
  const auto narrowing = [&](const BrightRegion& region) {
    const Eigen::Vector2d beside(region.middleU() - camera_.center_u,
                                 region.middleV() - camera_.center_v);
    return focal / std::hypot(focal, beside.norm());
  };
  const auto add = [&](std::size_t eye, const BrightRegion& region, const BrightRegion* other,
                       double depth, double doubt) {
    if (depth < params_.volume.nearest || depth > params_.volume.farthest) return;
    const double area = region.area * depth * depth / (focal * focal) * narrowing(region);
    const double least = shadow_.least * (region.isCut() ? kLeastInside : 1);
    const double misfit = std::log(std::max({1.0, area / shadow_.largest, least / area}));
    if (misfit > kWorstArea) return;
    doubt += misfit + kDoubtOfClosing * region.closing -
             kTrustOfContrast * std::min(3.0, std::log2(region.brightest / region.faintest));
    const double eye_x = eye == 0 ? 0 : camera_.baseline;
    Place place{{eye_x + (region.middleU() - camera_.center_u) * depth / focal,
                 (region.middleV() - camera_.center_v) * depth / focal, depth},
                doubt,
                {}};
    place.regions[eye] = region;
    if (other != nullptr) place.regions[1 - eye] = *other;
    places.push_back(place);
  };
  const auto addOneEyed = [&](std::size_t eye, const BrightRegion& region) {
    add(eye, region, nullptr, focal * std::sqrt(shadow_.mean / (region.area * narrowing(region))),
        kDoubtOfOneEye);
  };
  const double half_radius = 0.35 * model_->radius();
  std::vector<char> seen_left(regions[1].size(), 0);
  for (const BrightRegion& region : regions[0]) {
    for (std::size_t i = 0; i < regions[1].size(); ++i) {
      const BrightRegion& other = regions[1][i];
      if (other.closing != region.closing || other.faintest > region.brightest ||
          other.brightest < region.faintest)
        continue;
      const bool cut = region.isCut() || other.isCut();
      const std::optional<double> lower = region.apart(other, BrightRegion::kBelow),
                                  disparity = region.apart(other, BrightRegion::kRight);
      const double larger = std::abs(std::log(other.area / region.area));
      if (!disparity || *disparity < 2 || larger > (cut ? 1 : 0.7)) continue;
      const double apart = std::abs(lower.value_or(0));
      if (apart > 4 + 0.25 * (region.high_v - region.low_v)) continue;
      if (!region.isCut()) seen_left[i] = 1;
      // The region is the near side of the object.
      const double depth = focal * camera_.baseline / *disparity + half_radius;
      const double doubt = (cut ? 0 : larger) + apart / 20;
      if (region.isCut() && !other.isCut())
        add(1, other, &region, depth, doubt);
      else
        add(0, region, &other, depth, doubt);
    }
    addOneEyed(0, region);
  }
  for (std::size_t i = 0; i < regions[1].size(); ++i)
    if (seen_left[i] == 0) addOneEyed(1, regions[1][i]);

  std::sort(places.begin(), places.end(),
            [](const Place& a, const Place& b) { return a.doubt < b.doubt; });
  std::vector<Place> chosen;
  for (const Place& place : places) {
    const bool known = std::any_of(chosen.begin(), chosen.end(), [&](const Place& other) {
      return (other.point - place.point).norm() < 0.35 * model_->radius() &&
             std::abs(std::log(other.point.z() / place.point.z())) < 0.1;
    });
    if (!known) chosen.push_back(place);
    if (chosen.size() >= kMostPlaces) break;
  }
  return chosen;
}

/// Length [px] of the first `points` of the contour as one eye sees them.
float PoseSearch::contourLength(const ParticlePose& pose, std::size_t eye, int points) const {
  const auto [origin, object_rotation] = seenFrom(pose, eye);
  const ViewChoice choice = model_->choose(-(object_rotation.transpose() * origin));
  if (choice.view == nullptr || choice.view->arrays.empty()) return 0;
  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();
  turn(0, 0) = turn(1, 1) = choice.cosine;
  turn(0, 1) = -choice.sine;
  turn(1, 0) = choice.sine;
  return contourLengthInside(choice.view->arrays.data(), static_cast<std::size_t>(model_->points()),
                             static_cast<std::size_t>(points), origin, object_rotation * turn,
                             kNearest, window_) *
         static_cast<float>(camera_.focal_length);
}

/// How far the body reaches in the image of one eye, over the focal length.
BrightRegion::Extents PoseSearch::reachInImage(const ParticlePose& pose, std::size_t eye) const {
  const auto [origin, rotation] = seenFrom(pose, eye);
  return reachOfPoints(hull_.data(), hull_.size() / 3, origin, rotation, kNearest).extents;
}

/// [px] by which a region reaches farther than a body does, whose reach is over the focal length.
BrightRegion::Extents PoseSearch::apart(const BrightRegion& region,
                                        const BrightRegion::Extents& reach) const {
  return region.extents - static_cast<float>(camera_.focal_length) * reach -
         BrightRegion::cosines() * static_cast<float>(camera_.center_u) -
         BrightRegion::sines() * static_cast<float>(camera_.center_v);
}

/// [nats] by which the reach of a region speaks against a pose.
float PoseSearch::hullDoubt(const BrightRegion::Extents& reach, const BrightRegion& region) const {
  return (region.known *
          (0.5F * (apart(region, reach) / spreadOf(region)).square()).min(kWorstHull))
             .sum() *
         kIndependentHull;
}

/// Moves a pose until its outline reaches as far as the regions in all directions, as well as can
/// be with a shift in the image and another depth: least squares of the extents.
std::optional<Pose> PoseSearch::fitToRegions(const Pose& pose, const Place& place) const {
  using Extents = BrightRegion::Extents;
  const Extents &c = BrightRegion::cosines(), &s = BrightRegion::sines();
  const auto focal = static_cast<float>(camera_.focal_length);
  const Eigen::Vector3f origin = pose.translation().cast<float>();
  const ParticlePose view = toParticlePose(pose);
  // wanted = closeness * (depth * reach) + c x + s y, reach beside the left eye's view of the
  // origin
  Eigen::Matrix3f normal = Eigen::Matrix3f::Zero();
  Eigen::Vector3f right = Eigen::Vector3f::Zero();
  float known = 0;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    if (!place.regions[eye]) continue;
    const BrightRegion& region = *place.regions[eye];
    known += region.known.sum();
    const Extents wanted = (region.extents - c * static_cast<float>(camera_.center_u) -
                            s * static_cast<float>(camera_.center_v)) /
                           focal;
    const Extents reach = origin.z() * reachInImage(view, eye) - c * origin.x() - s * origin.y();
    Eigen::Matrix<float, BrightRegion::kDirections, 3> columns;
    columns << reach, c, s;
    const Eigen::Matrix<float, 3, BrightRegion::kDirections> weighted =
        columns.transpose() * region.known.matrix().asDiagonal();
    normal += weighted * columns;
    right += weighted * wanted.matrix();
  }
  if (known < kFewestDirections) return std::nullopt;
  Eigen::Vector3f found = normal.ldlt().solve(right);
  const float growth = found[0] * origin.z();
  if (!(growth > kLeastGrowth && growth < 1 / kLeastGrowth)) {
    found[0] = (growth > 1 ? 1 / kLeastGrowth : kLeastGrowth) / origin.z();
    found.tail<2>() = normal.bottomRightCorner<2, 2>().ldlt().solve(
        right.tail<2>() - normal.bottomLeftCorner<2, 1>() * found[0]);
  }
  if (!found.allFinite()) return std::nullopt;
  Pose fitted = pose;
  fitted.translation() = (Eigen::Vector3f(found[1], found[2], 1) / found[0]).cast<double>();
  return fitted;
}

/// Adds the best hypotheses of a place once more, shaped to its regions.
void PoseSearch::shape(std::vector<Hypothesis>& hypotheses,
                       const std::vector<Place>& places) const {
  const std::size_t count = std::min(kShaped, hypotheses.size());
  std::nth_element(hypotheses.begin(), hypotheses.begin() + static_cast<std::ptrdiff_t>(count - 1),
                   hypotheses.end(),
                   [](const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; });
  std::vector<Hypothesis> shaped(hypotheses.begin(),
                                 hypotheses.begin() + static_cast<std::ptrdiff_t>(count));
  tbb::parallel_for(std::size_t{0}, count, [&](std::size_t i) {
    const Place& place = places[shaped[i].place];
    shaped[i].pose = toParticlePose(shapedToRegions(toPose(shaped[i].pose), place));
    shaped[i].score = 0;
  });
  scoreAll(shaped, kCoarsePoints, mapsFor(places[shaped.front().place].point.z(), 1), places);
  hypotheses.insert(hypotheses.end(), shaped.begin(), shaped.end());
}

/// Turns and moves a pose until its outline reaches as far as the regions in all directions:
/// Gauss-Newton of the extents, each of which one vertex sets. Where the border cuts a region, the
/// body may reach farther.
Pose PoseSearch::shapedToRegions(const Pose& start, const Place& place) const {
  const BrightRegion::Extents &c = BrightRegion::cosines(), &s = BrightRegion::sines();
  const auto focal = static_cast<float>(camera_.focal_length);
  const auto hull = static_cast<Eigen::Index>(hull_.size() / 3);
  const Eigen::Map<const Eigen::Matrix<float, Eigen::Dynamic, 3>> points(hull_.data(), hull, 3);
  Pose pose = start;
  for (int i = 0; i < kShapeSteps; ++i) {
    const auto depth = static_cast<float>(std::max(0.03, pose.translation().z()));
    const ParticlePose view = toParticlePose(pose);
    Eigen::Matrix<float, 6, 6> normal = Eigen::Matrix<float, 6, 6>::Zero();
    Eigen::Matrix<float, 6, 1> right = Eigen::Matrix<float, 6, 1>::Zero();
    normal.diagonal().head<3>().setConstant(1 / std::pow(kShapeShift * depth, 2.0F));
    normal.diagonal().tail<3>().setConstant(1 / (kShapeTurn * kShapeTurn));
    for (std::size_t eye = 0; eye < 2; ++eye) {
      if (!place.regions[eye]) continue;
      const BrightRegion& region = *place.regions[eye];
      const float spread = spreadOf(region);
      const auto [origin, rotation] = seenFrom(view, eye);
      const PointReach reach =
          reachOfPoints(hull_.data(), hull_.size() / 3, origin, rotation, kNearest);
      const BrightRegion::Extents farther = apart(region, reach.extents);
      for (Eigen::Index k = 0; k < BrightRegion::kDirections; ++k) {
        if (region.known[k] < 0.5F && farther[k] < 0) continue;
        const float off = farther[k] / (kWorstHull * spread);
        const float weight = 1 / (spread * spread * (1 + off * off));
        const Eigen::Vector3f arm = rotation * points.row(reach.farthest[k]).transpose();
        const Eigen::Vector3f slope = focal / std::max(kNearest, origin.z() + arm.z()) *
                                      Eigen::Vector3f(c[k], s[k], -reach.extents[k]);
        Eigen::Matrix<float, 6, 1> row;
        row.head<3>() = slope;
        row.tail<3>() = arm.cross(slope);
        normal.noalias() += weight * row * row.transpose();
        right += weight * farther[k] * row;
      }
    }
    Twist step = normal.ldlt().solve(right).cast<double>();
    if (!step.allFinite()) break;
    const double turn = step.tail<3>().norm();
    if (turn > kShapeTurn) step *= kShapeTurn / turn;
    pose = normalized(movedInCamera(pose, step));
  }
  return pose;
}

const std::array<GainMap, 2>& PoseSearch::mapsFor(double depth, int sharpening) const {
  const double radius = camera_.focal_length * model_->radius() / depth;
  const int level = radius < 30 ? 1 : radius < 80 ? 2 : 3;
  return maps_[static_cast<std::size_t>(std::max(0, level - sharpening))];
}

void PoseSearch::scoreAll(std::vector<Hypothesis>& hypotheses, int points,
                          const std::array<GainMap, 2>& maps,
                          const std::vector<Place>& places) const {
  std::array<EyeView, 2> eyes;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    if (fields_[eye].seen()) eyes[eye].map = &maps[eye];
    eyes[eye].focal_length = static_cast<float>(camera_.focal_length);
    eyes[eye].center_u = static_cast<float>(camera_.center_u);
    eyes[eye].center_v = static_cast<float>(camera_.center_v);
    eyes[eye].eye_x = eye == 0 ? 0 : static_cast<float>(camera_.baseline);
  }
  const auto eye_count = std::count_if(eyes.begin(), eyes.end(),
                                       [](const EyeView& eye) { return eye.map != nullptr; });
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, hypotheses.size(), 256),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i != range.end(); ++i) {
                        Hypothesis& hypothesis = hypotheses[i];
                        scoreContours(*model_, points, eyes.data(), eyes.size(), kIndependentShare,
                                      &hypothesis.pose, 1, &hypothesis.score);
                        const Place* place =
                            hypothesis.place < places.size() ? &places[hypothesis.place] : nullptr;
                        const std::size_t eye = place != nullptr && !place->regions[0] ? 1 : 0;
                        hypothesis.score -= kToBeExpected * kBlunt.log_ratio * kIndependentShare *
                                            contourLength(hypothesis.pose, eye, points) *
                                            static_cast<float>(eye_count);
                        for (std::size_t k = 0; place != nullptr && k < 2; ++k)
                          if (place->regions[k])
                            hypothesis.score -=
                                hullDoubt(reachInImage(hypothesis.pose, k), *place->regions[k]);
                      }
                    });
}

/// [px] by which the contour of a pose from the search may lie off.
double PoseSearch::reachOf(const Pose& pose) const {
  const double depth = std::max(0.03, pose.translation().z());
  return std::clamp(kReach * camera_.focal_length * model_->radius() / depth, 6.0, 24.0);
}

std::vector<Pose> PoseSearch::turned(const Pose& camera_from_object) const {
  std::vector<Pose> poses;
  for (const Eigen::Vector3d& pivot : pivots_)
    for (const Eigen::Matrix3d& turn : turns_) {
      Pose pose = camera_from_object;
      pose.linear() = camera_from_object.linear() * turn;
      pose.translation() = camera_from_object * pivot - pose.linear() * pivot;
      poses.push_back(pose);
    }
  return poses;
}

/// Orientations at each place, shaped to its regions.
std::vector<PoseSearch::Hypothesis> PoseSearch::startsAtRegions(
    const std::vector<Place>& places) const {
  std::vector<Hypothesis> kept, hypotheses;
  for (std::size_t index = 0; index < places.size(); ++index) {
    const Eigen::Vector3d& place = places[index].point;
    hypotheses.clear();
    const Eigen::Matrix3d facing = facingTo(place);
    for (const auto& orientation : orientations_) {
      Pose pose = Pose::Identity();
      pose.translation() = place;
      pose.linear() = facing * orientation;
      const std::optional<Pose> fitted = fitToRegions(pose, places[index]);
      hypotheses.push_back({toParticlePose(fitted.value_or(pose)), 0, index});
    }
    scoreAll(hypotheses, kCoarsePoints, mapsFor(place.z(), 1), places);
    shape(hypotheses, places);
    for (const Hypothesis& hypothesis :
         distinct(hypotheses, index < kLikelyPlaces ? kKeptAtLikely : kKeptElsewhere, 0.2))
      kept.push_back(hypothesis);
  }
  return kept;
}

/// Adds all orientations at a place.
void PoseSearch::addOriented(const Eigen::Vector3d& place, const Eigen::Matrix3d& facing,
                             std::size_t index, std::vector<Hypothesis>& hypotheses) const {
  for (const auto& orientation : orientations_) {
    Pose pose = Pose::Identity();
    pose.linear() = facing * orientation;
    pose.translation() = place;
    hypotheses.push_back({toParticlePose(pose), 0, index});
  }
}

/// Orientations at and around each place where the eyes see a surface.
std::vector<PoseSearch::Hypothesis> PoseSearch::startsAtSurfaces(
    const RectifiedStereoFrame& frame) const {
  std::vector<Eigen::Vector3d> places = surface_places_.find(frame);
  places.resize(std::min(places.size(), kMostSurfaces));
  std::vector<Hypothesis> kept, hypotheses;
  const double step = kSurfaceStep * surface_places_.size();
  for (std::size_t index = 0; index < places.size(); ++index) {
    hypotheses.clear();
    const Eigen::Matrix3d facing = facingTo(places[index]);
    for (int x = -1; x <= 1; ++x)
      for (int y = -1; y <= 1; ++y)
        addOriented(places[index] + facing * Eigen::Vector3d(x * step, y * step, 0), facing, index,
                    hypotheses);
    scoreAll(hypotheses, kCoarsePoints, mapsFor(places[index].z(), 1), {});
    for (const Hypothesis& hypothesis : distinct(hypotheses, kKeptAtSurface, 0.2))
      kept.push_back(hypothesis);
  }
  return kept;
}

/// Orientations at the likeliest places among the edges of one eye.
std::vector<PoseSearch::Hypothesis> PoseSearch::startsAmongEdges() const {
  const std::size_t eye = fields_[0].seen() ? 0 : 1;
  if (!fields_[eye].seen()) return {};
  const double size = surface_places_.size();
  std::vector<Eigen::Vector3d> places =
      placesAmongEdges(fields_[eye], camera_, eye == 0 ? 0 : camera_.baseline,
                       params_.volume.nearest, params_.volume.farthest, size);
  const std::size_t most = kMostOriented / orientations_.size();
  if (places.size() > most) {
    // More than can be looked at are thinned evenly.
    for (std::size_t i = 0; i < most; ++i) places[i] = places[i * places.size() / most];
    places.resize(most);
  }
  const auto oriented = [&](std::size_t index) {
    std::vector<Hypothesis> here;
    addOriented(places[index], facingTo(places[index]), index, here);
    scoreAll(here, kCoarsePoints, mapsFor(places[index].z(), 1), {});
    return here;
  };
  std::vector<float> best(places.size());
  tbb::parallel_for(std::size_t{0}, places.size(), [&](std::size_t index) {
    best[index] = std::numeric_limits<float>::lowest();
    for (const Hypothesis& hypothesis : oriented(index))
      best[index] = std::max(best[index], hypothesis.score);
  });
  std::vector<std::size_t> order(places.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return best[a] > best[b]; });
  std::vector<Hypothesis> kept;
  std::vector<Eigen::Vector3d> taken;
  for (const std::size_t index : order) {
    if (taken.size() >= kAmongEdges) break;
    if (std::any_of(taken.begin(), taken.end(), [&](const Eigen::Vector3d& other) {
          return (other - places[index]).norm() < kApartAmongEdges * size;
        }))
      continue;
    std::vector<Hypothesis> here = oriented(index);
    for (const Hypothesis& hypothesis :
         distinct(here, taken.size() < kLikelyPlaces ? kKeptAtLikely : kKeptAmongEdges, 0.2))
      kept.push_back(hypothesis);
    taken.push_back(places[index]);
  }
  return kept;
}

std::optional<FoundPose> PoseSearch::find(const RectifiedStereoFrame& frame, const Query& query,
                                          const std::function<bool(const FoundPose&)>& enough) {
  ++calls_;
  const cv::Rect whole(cv::Point(), camera_.size);
  tbb::parallel_for(std::size_t{0}, std::size_t{2}, [&](std::size_t eye) {
    const bool used =
        params_.eyes == Eyes::kBoth || params_.eyes == (eye == 0 ? Eyes::kLeft : Eyes::kRight);
    fields_[eye].build(used ? (eye == 0 ? frame.left : frame.right) : cv::Mat(), whole);
    if (!fields_[eye].seen()) return;
    for (std::size_t level = 0; level < maps_.size(); ++level)
      fields_[eye].transform(kBlunt, 1 << level, maps_[level][eye]);
  });

  std::vector<Place> places;
  std::vector<Hypothesis> kept;
  if (query.where == Where::kSurfaces)
    kept = fields_[0].seen() && fields_[1].seen() ? startsAtSurfaces(frame) : startsAmongEdges();
  if (kept.empty()) {
    places = findPlaces(frame, query.where == Where::kDarkRegions);
    kept = startsAtRegions(places);
  }
  if (query.near) {
    const Pose& near = *query.near;
    std::vector<Hypothesis> hypotheses;
    for (std::uint64_t i = 0; i < 3000; ++i) {
      CounterRandom random(params_.filter.seed, 7'000'000 + calls_, i);
      const auto normals = random.sixNormals();
      const double reach = i % 3 == 0 ? 0.3 : i % 3 == 1 ? 1.0 : 2.5;
      Twist step;
      for (int k = 0; k < 6; ++k)
        step[k] = reach * (k < 3 ? 0.01 : 0.12) *
                  static_cast<double>(normals[static_cast<std::size_t>(k)]);
      hypotheses.push_back({toParticlePose(movedInCamera(near, step)), 0, kNear});
    }
    scoreAll(hypotheses, kCoarsePoints, mapsFor(std::max(0.03, near.translation().z())), places);
    for (const Hypothesis& hypothesis : distinct(hypotheses, kKeptAtLikely, 0.1))
      kept.push_back(hypothesis);
  }
  if (kept.empty() && query.candidates.empty()) return std::nullopt;

  // Each of the kept moves to the best of its children, in steps that shrink.
  std::vector<Hypothesis> unmoved = kept;
  for (int round = 0; round < kRounds; ++round) {
    const double size = std::pow(0.6, round);
    tbb::parallel_for(std::size_t{0}, kept.size(), [&](std::size_t i) {
      const Pose parent = toPose(kept[i].pose);
      const double depth = std::max(0.03, parent.translation().z());
      std::vector<Hypothesis> children{kept[i]};
      children.front().score = 0;
      for (int child = 0; child < kChildren; ++child) {
        CounterRandom random(params_.filter.seed + calls_, static_cast<std::uint64_t>(round) + 100,
                             i * kChildren + static_cast<std::uint64_t>(child));
        const auto normals = random.sixNormals();
        Twist step;
        for (int k = 0; k < 6; ++k)
          step[k] = size * (k < 3 ? 0.12 * model_->radius() : 0.12) *
                    static_cast<double>(normals[static_cast<std::size_t>(k)]);
        // Along the ray the place is less well known.
        step.head<3>() += parent.translation().normalized() *
                          (size * 0.03 * depth * static_cast<double>(normals[2]));
        children.push_back({toParticlePose(movedInCamera(parent, step)), 0, kept[i].place});
      }
      scoreAll(children, model_->points(), mapsFor(depth, round), places);
      kept[i] = *std::max_element(
          children.begin(), children.end(),
          [](const Hypothesis& a, const Hypothesis& b) { return a.score < b.score; });
    });
  }
  // Scores of different places do not compare: large projections collect more of everything.
  std::vector<Pose> starts;
  for (std::size_t first = 0; first < kept.size();) {
    std::size_t last = first;
    while (last < kept.size() && kept[last].place == kept[first].place) ++last;
    const std::size_t place = kept[first].place;
    const bool surface = places.empty() && place != kNear;
    const std::size_t count = last - first > kKeptAtSurface ? kRefinedAtLikely
                              : surface                     ? kRefinedAtSurface
                                                            : kRefinedElsewhere;
    // Shaped ones may be better than what edges made of them.
    for (const auto* all : {&kept, &unmoved}) {
      std::vector<Hypothesis> here(all->begin() + static_cast<std::ptrdiff_t>(first),
                                   all->begin() + static_cast<std::ptrdiff_t>(last));
      for (const Hypothesis& hypothesis : distinct(here, count, 0.3))
        starts.push_back(toPose(hypothesis.pose));
    }
    first = last;
  }
  starts.insert(starts.end(), query.candidates.begin(), query.candidates.end());
  std::vector<RefinedPose> refined(starts.size());
  const auto better = [](const RefinedPose& a, const RefinedPose& b) {
    return a.evidence > b.evidence;
  };
  tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t i) {
    const double reach = reachOf(starts[i]);
    refined[i] =
        refiner_.refine(*model_, fields_, starts[i], {}, {}, {reach, 0.8 * reach, 0.6 * reach});
    toAgreeingDepth(refined[i]);
  });
  // What lies outside of the images has no evidence against it, and what no edge supports is lost.
  refined.erase(std::remove_if(refined.begin(), refined.end(),
                               [](const RefinedPose& pose) {
                                 return pose.insideShare() < kLeastInImages ||
                                        pose.support() < kHopelessToMove;
                               }),
                refined.end());
  if (refined.empty()) return std::nullopt;
  const std::size_t promising = std::min(kPromising, refined.size());
  std::partial_sort(refined.begin(), refined.begin() + static_cast<std::ptrdiff_t>(promising),
                    refined.end(), better);
  refined.resize(promising);
  tbb::parallel_for(std::size_t{0}, refined.size(), [&](std::size_t i) {
    const Pose& pose = refined[i].camera_from_object;
    refined[i] = refiner_.refine(*model_, fields_, pose, {}, {}, {0.4 * reachOf(pose), 3, 2.5});
    compareEyes(refined[i]);
  });
  std::sort(refined.begin(), refined.end(), better);
  std::optional<FoundPose> best;
  std::vector<Eigen::Vector3d> asked;
  for (const RefinedPose& candidate : refined) {
    const Eigen::Vector3d place = candidate.camera_from_object.translation();
    if (std::any_of(asked.begin(), asked.end(), [&](const Eigen::Vector3d& other) {
          return (place - other).norm() < model_->radius();
        }))
      continue;
    if (candidate.support() < kHopelessSupport) continue;
    asked.push_back(place);
    std::vector<Pose> rivals;
    for (const RefinedPose& other : refined)
      if (&other != &candidate && other.support() >= kHopelessSupport &&
          (place - other.camera_from_object.translation()).norm() < model_->radius())
        rivals.push_back(other.camera_from_object);
    const FoundPose found = bestTurned(candidate, rivals);
    const double depth = found.refined.camera_from_object.translation().z();
    if (depth < params_.volume.nearest || depth > params_.volume.farthest) continue;
    if (enough(found)) return found;
    if (!best) best = found;
    if (asked.size() >= kAsked) break;
  }
  return best ? *best : FoundPose{refined.front(), {}, 0};
}

/// @param apart [rad], and of the body's radius
bool PoseSearch::areWithin(double apart, const Pose& a, const Pose& b) const {
  return (a.translation() - b.translation()).norm() < apart * model_->radius() &&
         angleBetween(a.linear(), b.linear(), symmetry_) < apart;
}

/// Best first, none of them within `apart` [rad] of a better one.
std::vector<PoseSearch::Hypothesis> PoseSearch::distinct(std::vector<Hypothesis>& hypotheses,
                                                         std::size_t count, double apart) const {
  const std::size_t looked_at = std::min(12 * count, hypotheses.size());
  std::partial_sort(hypotheses.begin(), hypotheses.begin() + static_cast<std::ptrdiff_t>(looked_at),
                    hypotheses.end(),
                    [](const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; });
  std::vector<Hypothesis> kept;
  std::vector<Pose> poses;
  for (std::size_t i = 0; i < looked_at && kept.size() < count; ++i) {
    const Pose pose = toPose(hypotheses[i].pose);
    const bool known = std::any_of(poses.begin(), poses.end(), [&](const Pose& other) {
      return areWithin(apart, pose, other);
    });
    if (known) continue;
    poses.push_back(pose);
    kept.push_back(hypotheses[i]);
  }
  return kept;
}

/// Counts how the eyes agree on the texture of a refined pose.
void PoseSearch::compareEyes(RefinedPose& refined) const {
  refined.evidence += agreement_.compare(fields_, refined.camera_from_object).log_likelihood_ratio;
}

/// Moves a refined pose, whose contour may have been drawn away by texture, along its ray to where
/// the eyes agree best, and counts what it wins there.
void PoseSearch::toAgreeingDepth(RefinedPose& refined) const {
  if (refined.support() < kHopelessToMove) return;
  const EyeAgreement::Agreement agreement = agreement_.compare(fields_, refined.camera_from_object);
  refined.evidence += agreement.best_ratio;
  const double depth = refined.camera_from_object.translation().z();
  const double growth =
      1 - agreement.best_shift * depth / (camera_.focal_length * camera_.baseline);
  if (growth > kLeastGrowth && agreement.best_ratio > kClearTexture)
    refined.camera_from_object.translation() /= growth;
}

/// Refines and judges a pose by the looks that it shows itself: what is object and what is not,
/// each pose says for itself.
RefinedPose PoseSearch::refineByOwnLooks(const Pose& pose, const std::vector<double>& ranges,
                                         const std::array<ContourView, 2>* exact) const {
  Appearance looks;
  refiner_.learn(*model_, fields_, pose, looks, exact);
  return refiner_.refine(*model_, fields_, pose, {}, looks, ranges, exact);
}

/// The same on the contour of exactly its view.
void PoseSearch::settle(RefinedPose& refined) const {
  const auto exact = exactViews(*model_, refined.camera_from_object, camera_.baseline);
  refined = refineByOwnLooks(refined.camera_from_object, {3, 2.5}, exact ? &*exact : nullptr);
}

/// A body that looks nearly the same turned over or round may have been taken for it: the best of
/// the pose and its turned ones.
FoundPose PoseSearch::bestTurned(const RefinedPose& pose, const std::vector<Pose>& rivals) const {
  std::vector<Hypothesis> hypotheses;
  for (const Pose& other : turned(pose.camera_from_object))
    hypotheses.push_back({toParticlePose(other), 0, 0});
  const double depth = std::max(0.03, pose.camera_from_object.translation().z());
  scoreAll(hypotheses, model_->points(), mapsFor(depth, 2), {});
  std::vector<Pose> starts;
  for (const Hypothesis& hypothesis : distinct(hypotheses, kTurned, 0.15))
    starts.push_back(toPose(hypothesis.pose));
  starts.push_back(pose.camera_from_object);
  for (const Pose& rival : rivals) {
    if (std::none_of(starts.begin(), starts.end(),
                     [&](const Pose& known) { return areWithin(kSame, rival, known); }))
      starts.push_back(rival);
  }
  const auto differ = [&](const Pose& a, const Pose& b) {
    return (a.translation() - b.translation()).norm() > kApart ||
           angleBetween(a.linear(), b.linear(), symmetry_) > kApartTurn;
  };
  std::vector<RefinedPose> refined(starts.size());
  tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t i) {
    const Pose moved = refiner_.move(*model_, fields_, starts[i], {}, {}, {10, 7, 4});
    refined[i] = refineByOwnLooks(moved, {3, 2.5});
  });
  std::vector<std::size_t> ranked(starts.size()), order;
  std::iota(ranked.begin(), ranked.end(), std::size_t{0});
  const auto likelier = [&](std::size_t a, std::size_t b) {
    return refined[a].log_likelihood > refined[b].log_likelihood;
  };
  std::sort(ranked.begin(), ranked.end(), likelier);
  for (const std::size_t i : ranked) {
    if (order.size() >= kExactlySeen) break;
    if (std::none_of(order.begin(), order.end(), [&](std::size_t known) {
          return areWithin(kSame, refined[i].camera_from_object, refined[known].camera_from_object);
        }))
      order.push_back(i);
  }
  tbb::parallel_for(std::size_t{0}, order.size(),
                    [&](std::size_t i) { settle(refined[order[i]]); });
  // Shading decides between those that the contour leaves.
  const double best =
      refined[*std::min_element(order.begin(), order.end(), likelier)].log_likelihood;
  order.erase(std::remove_if(
                  order.begin(), order.end(),
                  [&](std::size_t i) { return refined[i].log_likelihood < best - kShadedReach; }),
              order.end());
  tbb::parallel_for(std::size_t{0}, order.size(), [&](std::size_t i) {
    RefinedPose& pose_there = refined[order[i]];
    pose_there.log_likelihood += shaded_view_.logLikelihood(fields_, pose_there.camera_from_object);
  });
  FoundPose likeliest{refined[*std::min_element(order.begin(), order.end(), likelier)],
                      {},
                      std::numeric_limits<double>::infinity()};
  for (const std::size_t i : order) {
    const double lead = likeliest.refined.log_likelihood - refined[i].log_likelihood;
    if (lead < likeliest.lead &&
        differ(refined[i].camera_from_object, likeliest.refined.camera_from_object)) {
      likeliest.lead = lead;
      likeliest.rival = refined[i].camera_from_object;
    }
  }
  compareEyes(likeliest.refined);
  return likeliest;
}

void PoseSearch::learn(const Pose& camera_from_object, Appearance& appearance) const {
  refiner_.learn(*model_, fields_, camera_from_object, appearance);
}

RefinedPose PoseSearch::judge(const Pose& camera_from_object) const {
  RefinedPose refined = refineByOwnLooks(camera_from_object, {4, 3, 2.5});
  settle(refined);
  refined.log_likelihood += shaded_view_.logLikelihood(fields_, refined.camera_from_object);
  return refined;
}

}  // namespace leap_object_tracker
