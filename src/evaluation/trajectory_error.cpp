#include "leap_object_tracker/evaluation/trajectory_error.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

constexpr std::array<double, 6> kBandLimits{0.0, 0.05, 0.10, 0.15, 0.30, 0.60};  // [m]
constexpr int kExtremeDirections = 256;
constexpr double kLagStep = 0.0005;              // [s]
constexpr double kSmallestMotionForLag = 0.002;  // [m] standard deviation of the true position

using Points = std::vector<Eigen::Vector3d>;

std::chrono::nanoseconds nanoseconds(double duration) {
  return std::chrono::nanoseconds(std::llround(duration * 1e9));
}

/// Element `index` of the van der Corput sequence: even and without randomness.
double vanDerCorput(int index, int base) {
  double value = 0, digit = 1.0 / base;
  for (; index > 0; index /= base, digit /= base) value += digit * (index % base);
  return value;
}

/// The vertices that are farthest in some direction: a rigid displacement is largest at one of
/// them.
Points extremePoints(const Mesh& mesh) {
  std::vector<std::size_t> indices;
  const double golden_angle = M_PI * (3.0 - std::sqrt(5.0));
  for (int i = 0; i < kExtremeDirections; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / kExtremeDirections;
    const double radius = std::sqrt(1.0 - z * z);
    const Eigen::Vector3d direction(radius * std::cos(golden_angle * i),
                                    radius * std::sin(golden_angle * i), z);
    std::size_t farthest = 0;
    for (std::size_t v = 1; v < mesh.vertices.size(); ++v)
      if (mesh.vertices[v].dot(direction) > mesh.vertices[farthest].dot(direction)) farthest = v;
    indices.push_back(farthest);
  }
  std::sort(indices.begin(), indices.end());
  indices.erase(std::unique(indices.begin(), indices.end()), indices.end());
  Points points;
  for (const std::size_t index : indices) points.push_back(mesh.vertices[index]);
  return points;
}

double meanDistance(const Points& points, const Pose& a, const Pose& b) {
  double sum = 0;
  for (const auto& point : points) sum += (a * point - b * point).norm();
  return sum / static_cast<double>(points.size());
}

double meanNearestDistance(const Points& points, const Pose& a, const Pose& b) {
  const Pose b_from_a = b.inverse() * a;
  double sum = 0;
  for (const auto& point : points) {
    const Eigen::Vector3d moved_point = b_from_a * point;
    double nearest = std::numeric_limits<double>::infinity();
    for (const auto& other : points)
      nearest = std::min(nearest, (other - moved_point).squaredNorm());
    sum += std::sqrt(nearest);
  }
  return sum / static_cast<double>(points.size());
}

double largestDistance(const Points& points, const Pose& a, const Pose& b) {
  double largest = 0;
  for (const auto& point : points)
    largest = std::max(largest, (a * point - b * point).squaredNorm());
  return std::sqrt(largest);
}

/// The free angle is the one of the nearest orientation, which is the minimum for small errors.
double symmetricSurfaceDistance(const Points& points, const Pose& estimate, const Pose& truth,
                                const Symmetry& symmetry) {
  Symmetry one = symmetry;
  double smallest = std::numeric_limits<double>::infinity();
  for (const auto& rotation : symmetry.rotations) {
    one.rotations = {rotation};
    const Pose equivalent = nearestEquivalent(truth, estimate, one);
    smallest = std::min(smallest, largestDistance(points, estimate, equivalent));
  }
  return smallest;
}

/// All directions but the free axis, as columns.
Eigen::MatrixXd observableDirections(const Pose& estimate, const Symmetry& symmetry) {
  if (!symmetry.hasFreeAxis()) return Matrix6d::Identity();
  const Eigen::Vector3d axis = (estimate.linear() * symmetry.free_axis).normalized();
  const Eigen::Vector3d first = axis.unitOrthogonal();
  Eigen::MatrixXd directions = Eigen::MatrixXd::Zero(6, 5);
  directions.topLeftCorner<3, 3>().setIdentity();
  directions.block<3, 1>(3, 3) = first;
  directions.block<3, 1>(3, 4) = axis.cross(first);
  return directions;
}

std::optional<double> neesOf(const FrameError& frame, const Matrix6d& covariance,
                             const Symmetry& symmetry) {
  const Eigen::MatrixXd directions = observableDirections(*frame.estimate, symmetry);
  Twist error;
  error << frame.offset, frame.rotation;
  const Eigen::LLT<Eigen::MatrixXd> factor(directions.transpose() * covariance * directions);
  if (factor.info() != Eigen::Success) return std::nullopt;
  return factor.matrixL().solve(directions.transpose() * error).squaredNorm();
}

FrameError judge(Stamp stamp, const Pose& truth, const StampedPose* estimate,
                 const Symmetry& symmetry, const Points& surface, const Points& extreme) {
  FrameError frame;
  frame.stamp = stamp;
  frame.truth = truth;
  frame.distance = truth.translation().z();
  if (estimate == nullptr) return frame;
  frame.estimate = estimate->camera_from_object;
  const Pose nearest = nearestEquivalent(truth, *frame.estimate, symmetry);
  frame.offset = frame.estimate->translation() - truth.translation();
  frame.rotation = vectorFromRotation(frame.estimate->linear() * nearest.linear().transpose());
  frame.position = frame.offset.norm();
  frame.orientation = frame.rotation.norm();
  frame.add = meanDistance(surface, *frame.estimate, truth);
  frame.add_s = meanNearestDistance(surface, *frame.estimate, nearest);
  frame.mssd = symmetricSurfaceDistance(extreme, *frame.estimate, truth, symmetry);
  if (estimate->covariance) frame.nees = neesOf(frame, *estimate->covariance, symmetry);
  return frame;
}

const StampedPose* nearestInTime(const Trajectory& trajectory, Stamp stamp, double tolerance) {
  const auto after = std::lower_bound(
      trajectory.begin(), trajectory.end(), stamp,
      [](const StampedPose& candidate, Stamp wanted) { return candidate.stamp < wanted; });
  const StampedPose* best = nullptr;
  for (auto candidate = after == trajectory.begin() ? after : after - 1;
       candidate != trajectory.end() && candidate <= after; ++candidate)
    if (best == nullptr ||
        std::chrono::abs(candidate->stamp - stamp) < std::chrono::abs(best->stamp - stamp))
      best = &*candidate;
  if (best == nullptr || std::chrono::abs(best->stamp - stamp) > nanoseconds(tolerance))
    return nullptr;
  return best;
}

double shareWithin(const std::vector<FrameError>& frames, double metres, double degrees) {
  if (frames.empty()) return 0;
  const auto count = std::count_if(frames.begin(), frames.end(), [&](const FrameError& frame) {
    return frame.within(metres, degrees * M_PI / 180.0);
  });
  return static_cast<double>(count) / static_cast<double>(frames.size());
}

template <typename Member>
ErrorStatistics memberStatistics(const std::vector<FrameError>& frames, Member member) {
  std::vector<double> errors;
  for (const auto& frame : frames)
    if (frame.estimate) errors.push_back(frame.*member);
  return statisticsOf(std::move(errors));
}

/// Mean of the share of thresholds in 0 to limit that each frame stays below; no pose earns
/// nothing.
double areaUnderCurve(const std::vector<FrameError>& frames, double FrameError::*member,
                      double limit) {
  double sum = 0;
  for (const auto& frame : frames)
    if (frame.estimate) sum += std::max(0.0, 1.0 - frame.*member / limit);
  return frames.empty() ? 0 : sum / static_cast<double>(frames.size());
}

std::vector<DistanceBand> bandsOf(const std::vector<FrameError>& frames) {
  std::vector<DistanceBand> bands;
  for (std::size_t i = 0; i + 1 < kBandLimits.size(); ++i) {
    DistanceBand band;
    band.nearest = kBandLimits[i];
    band.farthest = kBandLimits[i + 1];
    std::vector<FrameError> inside;
    for (const auto& frame : frames)
      if (frame.distance >= band.nearest && frame.distance < band.farthest) inside.push_back(frame);
    if (inside.empty()) continue;
    band.frames = static_cast<int>(inside.size());
    band.with_pose = static_cast<int>(
        std::count_if(inside.begin(), inside.end(), [](const auto& f) { return !!f.estimate; }));
    band.position = memberStatistics(inside, &FrameError::position);
    band.orientation = memberStatistics(inside, &FrameError::orientation);
    band.within_1mm_1deg = shareWithin(inside, 0.001, 1);
    band.within_2mm_2deg = shareWithin(inside, 0.002, 2);
    band.within_5mm_5deg = shareWithin(inside, 0.005, 5);
    bands.push_back(band);
  }
  return bands;
}

/// Root of half the mean square of successive differences, summed over the axes (Allan 1966).
double allanDeviation(const std::vector<FrameError>& frames, Eigen::Vector3d FrameError::*member) {
  double sum = 0;
  int pairs = 0;
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (!frames[i - 1].estimate || !frames[i].estimate) continue;
    sum += (frames[i].*member - frames[i - 1].*member).squaredNorm();
    ++pairs;
  }
  return pairs == 0 ? 0 : std::sqrt(sum / (2.0 * pairs));
}

/// Correlation of the estimated positions with the true ones `lag` [s] earlier, without their
/// means.
std::optional<double> correlationAt(double lag, const std::vector<FrameError>& frames,
                                    const Trajectory& truth, const EvaluationParams& params) {
  std::vector<Eigen::Vector3d> estimated, true_ones;
  for (const auto& frame : frames) {
    // The same frames for every lag: those with a truth on both sides of the searched window.
    if (!frame.estimate || frame.stamp - nanoseconds(params.longest_lag) < truth.front().stamp ||
        frame.stamp + nanoseconds(params.longest_lag) > truth.back().stamp)
      continue;
    const auto then = poseAt(truth, frame.stamp - nanoseconds(lag),
                             nanoseconds(params.stamp_tolerance), nanoseconds(params.longest_gap));
    if (!then) continue;
    estimated.push_back(frame.estimate->translation());
    true_ones.push_back(then->translation());
  }
  if (estimated.size() < 10) return std::nullopt;
  const auto removeMean = [](std::vector<Eigen::Vector3d>& signal) {
    const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
    const Eigen::Vector3d mean =
        std::accumulate(signal.begin(), signal.end(), zero) / static_cast<double>(signal.size());
    double energy = 0;
    for (auto& value : signal) energy += (value -= mean).squaredNorm();
    return std::sqrt(energy);
  };
  const double estimated_norm = removeMean(estimated), true_norm = removeMean(true_ones);
  if (true_norm < kSmallestMotionForLag * std::sqrt(static_cast<double>(true_ones.size())) ||
      estimated_norm <= 0)
    return std::nullopt;
  double product = 0;
  for (std::size_t i = 0; i < estimated.size(); ++i) product += estimated[i].dot(true_ones[i]);
  return product / (estimated_norm * true_norm);
}

std::optional<double> lagOf(const std::vector<FrameError>& frames, const Trajectory& truth,
                            const EvaluationParams& params) {
  const int steps = static_cast<int>(params.longest_lag / kLagStep);
  std::optional<double> best_lag;
  double best = -1;
  for (int step = -steps; step <= steps; ++step) {
    const auto correlation = correlationAt(step * kLagStep, frames, truth, params);
    if (!correlation || *correlation <= best) continue;
    best = *correlation;
    best_lag = step * kLagStep;
  }
  return best_lag;
}

std::vector<TrackingGap> gapsOf(const std::vector<FrameError>& frames,
                                const EvaluationParams& params) {
  std::vector<TrackingGap> gaps;
  const auto good = [&](const FrameError& frame) {
    return frame.within(params.good_position, params.good_rotation);
  };
  const auto first = std::find_if(frames.begin(), frames.end(), good);
  const FrameError* begin = nullptr;
  for (auto frame = first; frame != frames.end(); ++frame) {
    if (!good(*frame)) {
      if (begin == nullptr) begin = &*frame;
    } else if (begin != nullptr) {
      gaps.push_back({seconds(begin->stamp - frames.front().stamp),
                      seconds(frame->stamp - begin->stamp), true});
      begin = nullptr;
    }
  }
  if (begin != nullptr)
    gaps.push_back({seconds(begin->stamp - frames.front().stamp),
                    seconds(frames.back().stamp - begin->stamp), false});
  return gaps;
}

std::optional<NeesReport> neesReport(const std::vector<FrameError>& frames,
                                     const Symmetry& symmetry) {
  NeesReport report;
  report.degrees_of_freedom = symmetry.hasFreeAxis() ? 5 : 6;
  const boost::math::chi_squared one_frame(report.degrees_of_freedom);
  const double low = quantile(one_frame, 0.025), high = quantile(one_frame, 0.975);
  int inside = 0;
  for (const auto& frame : frames) {
    if (!frame.nees) continue;
    ++report.frames;
    report.mean += *frame.nees;
    if (*frame.nees >= low && *frame.nees <= high) ++inside;
  }
  if (report.frames == 0) return std::nullopt;
  report.mean /= report.frames;
  report.share_inside = static_cast<double>(inside) / report.frames;
  const boost::math::chi_squared all(report.degrees_of_freedom * report.frames);
  report.band_low = quantile(all, 0.025) / report.frames;
  report.band_high = quantile(all, 0.975) / report.frames;
  return report;
}

void checkParams(const EvaluationParams& params) {
  if (!(params.stamp_tolerance >= 0) || !(params.longest_gap >= 0) || !(params.longest_lag >= 0))
    throw std::invalid_argument("evaluation: times must not be negative");
  if (params.surface_points < 1)
    throw std::invalid_argument("evaluation: surface_points must be at least 1");
  if (!(params.auc_limit > 0)) throw std::invalid_argument("evaluation: auc_limit must be above 0");
}

std::optional<double> timeOfFirst(const std::vector<FrameError>& frames, double metres,
                                  double radians) {
  for (const auto& frame : frames)
    if (frame.within(metres, radians)) return seconds(frame.stamp - frames.front().stamp);
  return std::nullopt;
}

}  // namespace

ErrorStatistics statisticsOf(std::vector<double> errors) {
  ErrorStatistics statistics;
  if (errors.empty()) return statistics;
  std::sort(errors.begin(), errors.end());
  const auto at = [&](double share) {
    const double rank = share * static_cast<double>(errors.size() - 1);
    const auto below = static_cast<std::size_t>(rank);
    const std::size_t above = std::min(below + 1, errors.size() - 1);
    return errors[below] + (rank - static_cast<double>(below)) * (errors[above] - errors[below]);
  };
  const double count = static_cast<double>(errors.size());
  statistics.rms =
      std::sqrt(std::inner_product(errors.begin(), errors.end(), errors.begin(), 0.0) / count);
  statistics.mean = std::accumulate(errors.begin(), errors.end(), 0.0) / count;
  statistics.median = at(0.5);
  statistics.p95 = at(0.95);
  statistics.largest = errors.back();
  return statistics;
}

std::vector<Eigen::Vector3d> surfacePoints(const Mesh& mesh, int count) {
  std::vector<double> area_up_to;
  double area = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[1]] - mesh.vertices[t[0]];
    const Eigen::Vector3d b = mesh.vertices[t[2]] - mesh.vertices[t[0]];
    area_up_to.push_back(area += 0.5 * a.cross(b).norm());
  }
  Points points;
  if (!(area > 0)) return points;
  for (int i = 1; i <= count; ++i) {
    const double wanted = vanDerCorput(i, 2) * area;
    const auto found = std::upper_bound(area_up_to.begin(), area_up_to.end() - 1, wanted);
    const auto& t = mesh.triangles[static_cast<std::size_t>(found - area_up_to.begin())];
    const double root = std::sqrt(vanDerCorput(i, 3)), side = vanDerCorput(i, 5);
    points.push_back((1 - root) * mesh.vertices[t[0]] + root * (1 - side) * mesh.vertices[t[1]] +
                     root * side * mesh.vertices[t[2]]);
  }
  return points;
}

TrajectoryReport compare(const Trajectory& estimate, const Trajectory& truth,
                         const ObjectModel& object, const EvaluationParams& params) {
  checkParams(params);
  if (truth.empty())
    throw std::invalid_argument("evaluation: there is no true pose to compare with");
  const Points surface = surfacePoints(object.mesh, params.surface_points);
  const Points extreme = extremePoints(object.mesh);
  if (surface.empty()) throw std::invalid_argument("evaluation: the object has no surface");

  std::vector<Stamp> stamps = params.frames;
  if (stamps.empty())
    for (const auto& pose : truth) stamps.push_back(pose.stamp);
  std::sort(stamps.begin(), stamps.end());

  // Of the truth's object frame, so that the first estimate is right up to its own error.
  std::optional<Eigen::Matrix3d> turn;
  if (!params.absolute_orientation) turn = Eigen::Matrix3d::Identity();
  const Symmetry symmetry = params.absolute_orientation ? Symmetry() : object.symmetry;

  TrajectoryReport report;
  for (const Stamp stamp : stamps) {
    const StampedPose* found = nearestInTime(estimate, stamp, params.stamp_tolerance);
    const Stamp when = found != nullptr ? found->stamp : stamp;
    auto true_pose =
        poseAt(truth, when, nanoseconds(params.stamp_tolerance), nanoseconds(params.longest_gap));
    if (!true_pose) continue;
    if (!turn && found != nullptr)
      turn = true_pose->linear().transpose() *
             nearestEquivalent(*true_pose, found->camera_from_object, object.symmetry).linear();
    if (turn) true_pose->linear() = true_pose->linear() * *turn;
    report.frames.push_back(judge(when, *true_pose, found, symmetry, surface, extreme));
  }
  if (report.frames.empty())
    throw std::invalid_argument(
        "evaluation: no frame has a true pose, are both of the same recording and clock?");
  report.with_pose = static_cast<int>(std::count_if(report.frames.begin(), report.frames.end(),
                                                    [](const auto& f) { return !!f.estimate; }));
  report.without_pose = static_cast<int>(report.frames.size()) - report.with_pose;
  report.without_truth = static_cast<int>(estimate.size()) - report.with_pose;
  if (report.with_pose == 0 && !estimate.empty())
    throw std::invalid_argument(
        "evaluation: no estimate has the stamp of a frame, are both of the same recording and "
        "clock?");
  report.duration = seconds(report.frames.back().stamp - report.frames.front().stamp);

  const auto& frames = report.frames;
  report.position = memberStatistics(frames, &FrameError::position);
  report.orientation = memberStatistics(frames, &FrameError::orientation);
  report.add = memberStatistics(frames, &FrameError::add);
  report.add_s = memberStatistics(frames, &FrameError::add_s);
  report.mssd = memberStatistics(frames, &FrameError::mssd);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> errors;
    for (const auto& frame : frames)
      if (frame.estimate) errors.push_back(frame.offset[axis]);
    report.axis_rms[static_cast<std::size_t>(axis)] = statisticsOf(std::move(errors)).rms;
  }
  report.add_auc = areaUnderCurve(frames, &FrameError::add, params.auc_limit);
  report.add_s_auc = areaUnderCurve(frames, &FrameError::add_s, params.auc_limit);
  report.within_1mm_1deg = shareWithin(frames, 0.001, 1);
  report.within_2mm_2deg = shareWithin(frames, 0.002, 2);
  report.within_5mm_5deg = shareWithin(frames, 0.005, 5);
  report.wrong = static_cast<double>(std::count_if(frames.begin(), frames.end(),
                                                   [&](const FrameError& frame) {
                                                     return frame.estimate &&
                                                            !frame.within(params.wrong_position,
                                                                          params.wrong_rotation);
                                                   })) /
                 static_cast<double>(frames.size());
  report.bands = bandsOf(frames);
  report.jitter_position = allanDeviation(frames, &FrameError::offset);
  report.jitter_orientation = allanDeviation(frames, &FrameError::rotation);
  report.lag = lagOf(frames, truth, params);
  constexpr double kAnything = std::numeric_limits<double>::infinity();
  report.time_to_first_pose = timeOfFirst(frames, kAnything, kAnything);
  report.time_to_good_pose = timeOfFirst(frames, params.good_position, params.good_rotation);
  report.gaps = gapsOf(frames, params);
  report.nees = neesReport(frames, symmetry);
  return report;
}

}  // namespace leap_object_tracker
