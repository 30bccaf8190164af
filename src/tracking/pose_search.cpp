#include "leap_object_tracker/tracking/pose_search.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "tracking/random.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kOrientations = 4400;  // about 15 deg apart over all of SO(3)
constexpr int kMostPlaces = 14;
constexpr std::size_t kTurned = 24;        // of the turned poses that are refined
constexpr int kBoxPoints = 64;             // of the contour, for the box around it
constexpr double kOtherShape = 0.5;        // log of the ratio of elongations
constexpr int kCoarsePoints = 32;          // of the contour, for the first look
constexpr std::size_t kLikelyPlaces = 3;   // first by how well their blob fits
constexpr std::size_t kKeptAtLikely = 40;  // hypotheses of such a place that move on
constexpr std::size_t kKeptElsewhere = 8;
constexpr int kChildren = 20;  // random steps of each, a round
constexpr int kRounds = 4;
constexpr std::size_t kRefinedAtLikely = 8;
constexpr std::size_t kRefinedElsewhere = 2;
constexpr float kIndependentShare = 1 / 3.0F;  // samples per pixel of contour
// Of the best score that so much contour could have: less speaks against a pose. Without it, views
// that show more contour would win.
constexpr float kToBeExpected = 0.65F;
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

/// One of each class of orientations that look the same.
std::vector<Eigen::Matrix3d> distinctRotations(const Symmetry& symmetry, int count) {
  std::vector<Eigen::Matrix3d> kept;
  if (symmetry.hasFreeAxis()) {
    // Only the direction of the axis matters: as many as there are 15 deg caps on a sphere.
    const int directions = 240;
    for (int i = 0; i < directions; ++i) {
      const double z = 1 - (2 * i + 1.0) / directions, ring = std::sqrt(1 - z * z);
      const double angle = i * M_PI * (3 - std::sqrt(5.0));
      const Eigen::Vector3d axis(ring * std::cos(angle), ring * std::sin(angle), z);
      kept.push_back(
          Eigen::Quaterniond::FromTwoVectors(symmetry.free_axis, axis).toRotationMatrix());
    }
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

double surfaceOf(const Mesh& mesh) {
  double doubled = 0;
  for (const auto& t : mesh.triangles)
    doubled += (mesh.vertices[t[1]] - mesh.vertices[t[0]])
                   .cross(mesh.vertices[t[2]] - mesh.vertices[t[0]])
                   .norm();
  return doubled / 2;
}

}  // namespace

PoseSearch::PoseSearch(const TrackerParams& params, const ObjectModel& object,
                       const ContourModel& model, const RectifiedStereoCamera& camera)
    : params_(params),
      camera_(camera),
      model_(&model),
      refiner_(params.contour, camera),
      surface_(surfaceOf(object.mesh)),
      pivots_(pivotsOf(object.mesh)),
      symmetry_(object.symmetry),
      turns_(turnsToTry(object.symmetry)),
      orientations_(distinctRotations(object.symmetry, kOrientations)) {}

std::vector<PoseSearch::Blob> PoseSearch::findBlobs(const cv::Mat& image) const {
  std::vector<Blob> blobs;
  if (image.empty()) return blobs;
  cv::Mat half, mask, labels, statistics, centroids;
  cv::resize(image, half, cv::Size(), 0.5, 0.5, cv::INTER_AREA);
  for (const int threshold : {12, 20, 32, 50, 80, 120, 170}) {
    mask = half > threshold;
    const int count = cv::connectedComponentsWithStats(mask, labels, statistics, centroids, 8);
    for (int i = 1; i < count; ++i) {
      Blob blob;
      blob.area = 4.0 * statistics.at<int>(i, cv::CC_STAT_AREA);
      if (blob.area < 40) continue;
      blob.left = 2.0 * statistics.at<int>(i, cv::CC_STAT_LEFT);
      blob.top = 2.0 * statistics.at<int>(i, cv::CC_STAT_TOP);
      blob.width = 2.0 * statistics.at<int>(i, cv::CC_STAT_WIDTH);
      blob.height = 2.0 * statistics.at<int>(i, cv::CC_STAT_HEIGHT);
      blob.u = 2 * centroids.at<double>(i, 0) + 0.5;
      blob.v = 2 * centroids.at<double>(i, 1) + 0.5;
      blob.threshold = threshold;
      blobs.push_back(blob);
    }
  }
  return blobs;
}

std::vector<PoseSearch::Place> PoseSearch::findPlaces(const RectifiedStereoFrame& frame) const {
  std::vector<Place> places;
  const double focal = camera_.focal_length;
  const bool left_used = params_.eyes != Eyes::kRight && !frame.left.empty();
  const std::vector<Blob> left = left_used ? findBlobs(frame.left) : std::vector<Blob>();
  const std::vector<Blob> right =
      params_.eyes != Eyes::kLeft ? findBlobs(frame.right) : std::vector<Blob>();
  const auto add = [&](const Blob& blob, double depth, double doubt, double eye_x) {
    if (depth < params_.volume.nearest || depth > params_.volume.farthest) return;
    const double expected = surface_ / 4 * focal * focal / (depth * depth);
    const double misfit = std::abs(std::log(blob.area / expected));
    if (misfit > std::log(4.0)) return;
    places.push_back({{eye_x + (blob.u - camera_.center_u) * depth / focal,
                       (blob.v - camera_.center_v) * depth / focal, depth},
                      misfit + doubt,
                      blob,
                      eye_x});
  };
  const double half_radius = 0.35 * model_->radius();
  for (const Blob& blob : left) {
    for (const Blob& other : right) {
      if (other.threshold != blob.threshold) continue;
      if (std::abs(other.v - blob.v) > 4 + 0.25 * blob.height) continue;
      if (std::abs(std::log(other.area / blob.area)) > 0.7) continue;
      const double disparity = blob.u - other.u;
      if (disparity < 2) continue;
      // The blob is the near side of the object.
      add(blob, focal * camera_.baseline / disparity + half_radius,
          std::abs(std::log(other.area / blob.area)) + std::abs(other.v - blob.v) / 20, 0);
    }
    add(blob, focal * std::sqrt(surface_ / 4 / blob.area), 0.5, 0);
  }
  if (!left_used)
    for (const Blob& blob : right)
      add(blob, focal * std::sqrt(surface_ / 4 / blob.area), 0.5, camera_.baseline);

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

/// What one eye sees of the first `points` of the contour at a pose.
std::optional<PoseSearch::Glance> PoseSearch::glance(const ParticlePose& pose, double eye_x,
                                                     int points) const {
  using RowMajor = Eigen::Matrix<float, 3, 3, Eigen::RowMajor>;
  const Eigen::Map<const RowMajor> object_rotation(pose.rotation.data());
  const Eigen::Vector3f origin(pose.translation[0] - static_cast<float>(eye_x), pose.translation[1],
                               pose.translation[2]);
  const ViewChoice choice = model_->choose(-(object_rotation.transpose() * origin));
  if (choice.view == nullptr || choice.view->arrays.empty()) return std::nullopt;
  Eigen::Matrix3f turn = Eigen::Matrix3f::Identity();
  turn(0, 0) = turn(1, 1) = choice.cosine;
  turn(0, 1) = -choice.sine;
  turn(1, 0) = choice.sine;
  const Eigen::Matrix3f rotation = object_rotation * turn;
  const auto count = static_cast<std::size_t>(model_->points());
  const float* values = choice.view->arrays.data();
  const auto column = [&](std::size_t first, std::size_t i) {
    return Eigen::Vector3f(values[first * count + i], values[(first + 1) * count + i],
                           values[(first + 2) * count + i]);
  };
  Glance seen;
  for (std::size_t i = 0; i < static_cast<std::size_t>(points); ++i) {
    const Eigen::Vector3f at = origin + rotation * column(0, i);
    if (at.z() < 0.02F) return std::nullopt;
    const Eigen::Array2f slope = at.head<2>().array() / at.z();
    seen.low = seen.low.min(slope);
    seen.high = seen.high.max(slope);
    const Eigen::Vector3f along = rotation * column(3, i);
    seen.length += (along.head<2>().array() - slope * along.z()).matrix().norm() / at.z();
  }
  seen.length *= static_cast<float>(camera_.focal_length);
  return seen;
}

/// Moves a pose until the box around its contour has the centre and the area of the blob's; nothing
/// if it is of another shape altogether.
std::optional<Pose> PoseSearch::fitToBox(const Pose& pose, const Place& place) const {
  const std::optional<Glance> seen =
      glance(toParticlePose(pose), place.eye_x, std::min(kBoxPoints, model_->points()));
  if (!seen) return std::nullopt;
  const Eigen::Array2f low = seen->low, high = seen->high;
  const Eigen::Vector3d origin = pose.translation() - Eigen::Vector3d(place.eye_x, 0, 0);
  const double focal = camera_.focal_length;
  const Eigen::Array2d size = (high - low).cast<double>() * focal;
  const Eigen::Array2d middle = 0.5 * (high + low).cast<double>();
  const double elongation =
      std::log(size.x() / size.y()) - std::log(place.blob.width / place.blob.height);
  if (!(std::abs(elongation) < kOtherShape)) return std::nullopt;
  const double grown =
      std::clamp(std::sqrt(size.x() * size.y() / (place.blob.width * place.blob.height)), 0.7, 1.4);
  const Eigen::Array2d wanted(
      (place.blob.left + 0.5 * (place.blob.width - 1) - camera_.center_u) / focal,
      (place.blob.top + 0.5 * (place.blob.height - 1) - camera_.center_v) / focal);
  const Eigen::Array2d own = origin.head<2>().array() / origin.z();
  Pose fitted = pose;
  const double depth = pose.translation().z() * grown;
  const Eigen::Array2d moved = (wanted + (own - middle) / grown) * depth;
  fitted.translation() << moved.x() + place.eye_x, moved.y(), depth;
  return fitted;
}

const std::array<GainMap, 2>& PoseSearch::mapsFor(double depth, int sharpening) const {
  const double radius = camera_.focal_length * model_->radius() / depth;
  const int level = radius < 30 ? 1 : radius < 80 ? 2 : 3;
  return maps_[static_cast<std::size_t>(std::max(0, level - sharpening))];
}

void PoseSearch::scoreAll(std::vector<Hypothesis>& hypotheses, int points,
                          const std::array<GainMap, 2>& maps) const {
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
                        const auto seen = glance(hypothesis.pose, 0, points);
                        if (seen)
                          hypothesis.score -= kToBeExpected * kBlunt.log_ratio * kIndependentShare *
                                              seen->length * static_cast<float>(eye_count);
                      }
                    });
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

std::optional<RefinedPose> PoseSearch::find(const RectifiedStereoFrame& frame,
                                            const std::optional<Pose>& near) {
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

  const std::vector<Place> places = findPlaces(frame);
  std::vector<Hypothesis> kept;
  // Best first, none of them within `apart` [rad] of a better one.
  const auto keepDistinct = [&](std::vector<Hypothesis>& all, std::size_t count, double apart) {
    const std::size_t looked_at = std::min(12 * count, all.size());
    std::partial_sort(all.begin(), all.begin() + static_cast<std::ptrdiff_t>(looked_at), all.end(),
                      [](const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; });
    std::vector<Hypothesis> distinct;
    std::vector<Pose> poses;
    for (std::size_t i = 0; i < looked_at && distinct.size() < count; ++i) {
      const Pose pose = toPose(all[i].pose);
      const bool known = std::any_of(poses.begin(), poses.end(), [&](const Pose& other) {
        return (pose.translation() - other.translation()).norm() < apart * model_->radius() &&
               angleBetween(pose.linear(), other.linear(), symmetry_) < apart;
      });
      if (known) continue;
      poses.push_back(pose);
      distinct.push_back(all[i]);
    }
    all = std::move(distinct);
  };
  std::vector<Hypothesis> hypotheses;
  for (std::size_t index = 0; index < places.size(); ++index) {
    const Eigen::Vector3d& place = places[index].point;
    hypotheses.clear();
    // Orientations are laid out as seen along the ray to the place.
    const Eigen::Matrix3d facing =
        Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), place).toRotationMatrix();
    for (const auto& orientation : orientations_) {
      Pose pose = Pose::Identity();
      pose.translation() = place;
      pose.linear() = facing * orientation;
      hypotheses.push_back({toParticlePose(pose), 0, index});
      if (const auto fitted = fitToBox(pose, places[index]))
        hypotheses.push_back({toParticlePose(*fitted), 0, index});
    }
    scoreAll(hypotheses, kCoarsePoints, mapsFor(place.z(), 1));
    keepDistinct(hypotheses, index < kLikelyPlaces ? kKeptAtLikely : kKeptElsewhere, 0.2);
    kept.insert(kept.end(), hypotheses.begin(), hypotheses.end());
  }
  if (near) {
    hypotheses.clear();
    for (std::uint64_t i = 0; i < 3000; ++i) {
      CounterRandom random(params_.filter.seed, 7'000'000 + calls_, i);
      const auto normals = random.sixNormals();
      const double reach = i % 3 == 0 ? 0.3 : i % 3 == 1 ? 1.0 : 2.5;
      Twist step;
      for (int k = 0; k < 6; ++k)
        step[k] = reach * (k < 3 ? 0.01 : 0.12) *
                  static_cast<double>(normals[static_cast<std::size_t>(k)]);
      hypotheses.push_back({toParticlePose(movedInCamera(*near, step)), 0, places.size()});
    }
    scoreAll(hypotheses, kCoarsePoints, mapsFor(std::max(0.03, near->translation().z())));
    keepDistinct(hypotheses, kKeptAtLikely, 0.1);
    kept.insert(kept.end(), hypotheses.begin(), hypotheses.end());
  }
  if (kept.empty()) return std::nullopt;

  // Each of the kept moves to the best of its children, in steps that shrink.
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
      scoreAll(children, model_->points(), mapsFor(depth, round));
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
    std::vector<Hypothesis> here(kept.begin() + static_cast<std::ptrdiff_t>(first),
                                 kept.begin() + static_cast<std::ptrdiff_t>(last));
    keepDistinct(here, here.size() > kKeptElsewhere ? kRefinedAtLikely : kRefinedElsewhere, 0.15);
    for (const Hypothesis& hypothesis : here) starts.push_back(toPose(hypothesis.pose));
    first = last;
  }
  std::vector<RefinedPose> refined(starts.size());
  tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t i) {
    refined[i] = refiner_.refine(*model_, fields_, starts[i], {}, {}, {10, 8, 6, 4, 3, 2.5});
  });
  const auto less = [](const RefinedPose& a, const RefinedPose& b) {
    return a.evidence < b.evidence;
  };
  auto best = std::max_element(refined.begin(), refined.end(), less);
  // A body that looks nearly the same turned over or round may have been taken for it.
  const RefinedPose first = *best;
  const double first_depth = std::max(0.03, first.camera_from_object.translation().z());
  hypotheses.clear();
  for (const Pose& pose : turned(first.camera_from_object))
    hypotheses.push_back({toParticlePose(pose), 0, 0});
  scoreAll(hypotheses, model_->points(), mapsFor(first_depth, 2));
  keepDistinct(hypotheses, kTurned, 0.15);
  starts.clear();
  for (const Hypothesis& hypothesis : hypotheses) starts.push_back(toPose(hypothesis.pose));
  starts.push_back(first.camera_from_object);
  refined.resize(starts.size());
  // Most of the silhouette is right already: it tells what is object and what is not.
  Appearance looks;
  refiner_.learn(*model_, fields_, first.camera_from_object, looks);
  tbb::parallel_for(std::size_t{0}, starts.size(), [&](std::size_t i) {
    refined[i] = refiner_.refine(*model_, fields_, starts[i], {}, looks, {10, 7, 4, 3, 2.5});
  });
  best = std::max_element(refined.begin(), refined.end(),
                          [](const RefinedPose& a, const RefinedPose& b) {
                            return a.log_likelihood < b.log_likelihood;
                          });
  const double depth = best->camera_from_object.translation().z();
  if (depth < params_.volume.nearest || depth > params_.volume.farthest) return std::nullopt;
  return *best;
}

}  // namespace leap_object_tracker
