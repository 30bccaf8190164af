#include "leap_object_tracker/tracking/feature_landmarks.hpp"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <opencv2/core/persistence.hpp>
#include <random>
#include <stdexcept>

namespace leap_object_tracker {
namespace {

constexpr double kNewViewAngle = 0.6;     // [rad] between known directions of view
constexpr float kSameView = 0.77F;        // cosine, 40 deg: a descriptor holds that far
constexpr float kLikeDescriptor = 0.30F;  // squared distance of unit vectors
constexpr float kClearlyBest = 0.70F;     // squared distance to that of the second best
constexpr float kOtherSpot = 0.0015F;     // [m] the second best must lie farther off than this
constexpr float kSpacing = 0.0006F;       // [m] between landmarks
constexpr float kDrift = 0.006F;          // [m] that a pose may err by when a new landmark is made
constexpr int kForgetAfter = 30;          // frames missed, for a landmark seen only a few times
constexpr int kWellKnown = 8;             // frames
constexpr int kExpected = 4;              // frames after which a landmark is expected
constexpr float kFacing = 0.9F;           // cosine of view directions, 25 deg
constexpr float kDescriptorGain = 0.1F;   // of each new sight
constexpr int kTries = 300;               // of RANSAC
constexpr std::size_t kLeastPairs = 8;
constexpr const char* kFormat = "leap_object_tracker landmarks 1";

/// Turn about the optical axis [rad] that brings one orientation nearest to another: the twist of
/// the swing-twist decomposition.
double rollBetween(const Eigen::Matrix3d& from, const Eigen::Matrix3d& to) {
  const Eigen::Quaterniond turn(Eigen::Matrix3d(to * from.transpose()));
  return 2 * std::atan2(turn.z(), turn.w());
}

Eigen::Vector3f viewOf(const Pose& object_from_camera, const Eigen::Vector3f& spot) {
  return (object_from_camera.translation().cast<float>() - spot).normalized();
}

void normalize(FeatureDescriptor& descriptor) {
  float sum = 0;
  for (const float value : descriptor) sum += value * value;
  for (float& value : descriptor) value /= std::sqrt(std::max(sum, 1e-12F));
}

/// Rigid transform of three or more pairs in least squares (Umeyama 1991, equation 40, no scale).
Pose poseOfPairs(const std::vector<Eigen::Vector3d>& in_object,
                 const std::vector<Eigen::Vector3d>& in_camera) {
  Eigen::Matrix3Xd source(3, static_cast<Eigen::Index>(in_object.size()));
  Eigen::Matrix3Xd target = source;
  for (std::size_t i = 0; i < in_object.size(); ++i) {
    source.col(static_cast<Eigen::Index>(i)) = in_object[i];
    target.col(static_cast<Eigen::Index>(i)) = in_camera[i];
  }
  Pose pose;
  pose.matrix() = Eigen::umeyama(source, target, false);
  return pose;
}

}  // namespace

const LandmarkMap::View* LandmarkMap::nearestView(const Eigen::Matrix3d& camera_from_object,
                                                  double& angle) const {
  const View* nearest = nullptr;
  double best = -2;
  for (const auto& view : views_) {
    const double cosine = view.camera_from_object.row(2).dot(camera_from_object.row(2));
    if (cosine <= best) continue;
    best = cosine;
    nearest = &view;
  }
  angle = std::acos(std::clamp(best, -1.0, 1.0));
  return nearest;
}

double LandmarkMap::rollOf(const Eigen::Matrix3d& camera_from_object) const {
  double angle = 0;
  const View* view = nearestView(camera_from_object, angle);
  return view == nullptr ? 0
                         : view->roll + rollBetween(view->camera_from_object, camera_from_object);
}

void LandmarkMap::match(const std::vector<StereoFeature>& features, const Pose& camera_from_object,
                        double reach, std::vector<int>& matches) const {
  matches.assign(features.size(), -1);
  thread_local std::vector<float> distances;
  distances.assign(features.size(), std::numeric_limits<float>::infinity());
  thread_local std::vector<int> feature_of;
  feature_of.assign(landmarks_.size(), -1);
  const Pose object_from_camera = camera_from_object.inverse();
  for (std::size_t i = 0; i < features.size(); ++i) {
    const Eigen::Vector3f spot = (object_from_camera * features[i].point_in_camera).cast<float>();
    const Eigen::Vector3f view = viewOf(object_from_camera, spot);
    float best = std::numeric_limits<float>::infinity();
    int found = -1;
    const auto within = [&](const Landmark& landmark) {
      return (landmark.position - spot).squaredNorm() < reach * reach &&
             landmark.view.dot(view) > kSameView;
    };
    thread_local std::vector<std::pair<float, int>> candidates;
    candidates.clear();
    for (std::size_t k = 0; k < landmarks_.size(); ++k) {
      if (!within(landmarks_[k])) continue;
      const float distance = squaredDistance(landmarks_[k].descriptor, features[i].descriptor);
      candidates.emplace_back(distance, static_cast<int>(k));
      if (distance < best) {
        best = distance;
        found = static_cast<int>(k);
      }
    }
    if (found < 0 || best > kLikeDescriptor) continue;
    const Eigen::Vector3f& place = landmarks_[static_cast<std::size_t>(found)].position;
    const bool unique = std::all_of(candidates.begin(), candidates.end(), [&](const auto& other) {
      const auto& landmark = landmarks_[static_cast<std::size_t>(other.second)];
      return (landmark.position - place).norm() < kOtherSpot || best < kClearlyBest * other.first;
    });
    if (!unique) continue;
    int& taken = feature_of[static_cast<std::size_t>(found)];
    if (taken >= 0) {
      if (distances[static_cast<std::size_t>(taken)] <= best) continue;
      matches[static_cast<std::size_t>(taken)] = -1;
    }
    taken = static_cast<int>(i);
    matches[i] = found;
    distances[i] = best;
  }
}

int LandmarkMap::expected(const Pose& camera_from_object) const {
  const Pose object_from_camera = camera_from_object.inverse();
  return static_cast<int>(
      std::count_if(landmarks_.begin(), landmarks_.end(), [&](const Landmark& landmark) {
        return landmark.seen >= kExpected &&
               viewOf(object_from_camera, landmark.position).dot(landmark.view) > kFacing;
      }));
}

void LandmarkMap::learn(const std::vector<StereoFeature>& features, const std::vector<int>& matches,
                        const std::vector<bool>& on_surface, const Pose& camera_from_object,
                        double pose_variance) {
  double angle = 0;
  const double roll = rollOf(camera_from_object.linear());
  if (nearestView(camera_from_object.linear(), angle) == nullptr || angle > kNewViewAngle)
    views_.push_back({camera_from_object.linear(), roll});

  const Pose object_from_camera = camera_from_object.inverse();
  seen_.assign(landmarks_.size(), false);
  const std::size_t known = landmarks_.size();
  for (std::size_t i = 0; i < features.size(); ++i) {
    if (!on_surface[i]) continue;
    const Eigen::Vector3f spot = (object_from_camera * features[i].point_in_camera).cast<float>();
    const auto variance = static_cast<float>(features[i].covariance.trace() / 3 + pose_variance);
    if (matches[i] >= 0) {
      Landmark& landmark = landmarks_[static_cast<std::size_t>(matches[i])];
      seen_[static_cast<std::size_t>(matches[i])] = true;
      // What the pose errs by is common to all sights: the variance never falls below it.
      const float gain = landmark.variance / (landmark.variance + variance);
      landmark.position += gain * (spot - landmark.position);
      landmark.variance =
          std::max((1 - gain) * landmark.variance, 0.25F * static_cast<float>(pose_variance));
      for (std::size_t k = 0; k < landmark.descriptor.size(); ++k)
        landmark.descriptor[k] +=
            kDescriptorGain * (features[i].descriptor[k] - landmark.descriptor[k]);
      normalize(landmark.descriptor);
      ++landmark.seen;
      landmark.missed = 0;
      continue;
    }
    const Eigen::Vector3f view = viewOf(object_from_camera, spot);
    // A spot that looks like a known one close by is that one, seen from a pose that drifted.
    const bool known_already =
        std::any_of(landmarks_.begin(), landmarks_.end(), [&](const Landmark& landmark) {
          const float apart = (landmark.position - spot).squaredNorm();
          return landmark.view.dot(view) > kSameView &&
                 (apart < kSpacing * kSpacing ||
                  (apart < kDrift * kDrift &&
                   squaredDistance(landmark.descriptor, features[i].descriptor) < kLikeDescriptor));
        });
    if (!known_already) landmarks_.push_back({spot, view, features[i].descriptor, variance, 1, 0});
  }
  const Eigen::Vector3f eye = object_from_camera.translation().cast<float>();
  for (std::size_t k = 0; k < known; ++k)
    if (!seen_[k] && (eye - landmarks_[k].position).normalized().dot(landmarks_[k].view) > 0.97F)
      ++landmarks_[k].missed;
  makeRoom();
}

void LandmarkMap::makeRoom() {
  const auto useless = [](const Landmark& landmark) {
    return landmark.missed > kForgetAfter && landmark.seen < kWellKnown;
  };
  landmarks_.erase(std::remove_if(landmarks_.begin(), landmarks_.end(), useless), landmarks_.end());
  if (landmarks_.size() <= static_cast<std::size_t>(capacity_)) return;
  std::stable_sort(landmarks_.begin(), landmarks_.end(), [](const Landmark& a, const Landmark& b) {
    return a.seen - a.missed > b.seen - b.missed;
  });
  landmarks_.resize(static_cast<std::size_t>(capacity_));
}

std::optional<Pose> LandmarkMap::locate(const std::vector<StereoFeature>& features,
                                        double tolerance) const {
  struct Pair {
    Eigen::Vector3d in_object, in_camera;
  };
  std::vector<Pair> pairs;
  for (const auto& feature : features) {
    float best = std::numeric_limits<float>::infinity();
    const Landmark* found = nullptr;
    for (const auto& landmark : landmarks_) {
      const float distance = squaredDistance(landmark.descriptor, feature.descriptor);
      if (distance >= best) continue;
      best = distance;
      found = &landmark;
    }
    if (found != nullptr && best < kLikeDescriptor)
      pairs.push_back({found->position.cast<double>(), feature.point_in_camera});
  }
  if (pairs.size() < kLeastPairs) return std::nullopt;

  const auto agreeing = [&](const Pose& pose) {
    std::vector<std::size_t> indices;
    for (std::size_t i = 0; i < pairs.size(); ++i)
      if ((pose * pairs[i].in_object - pairs[i].in_camera).norm() < tolerance) indices.push_back(i);
    return indices;
  };
  const auto poseOf = [&](const std::vector<std::size_t>& indices) {
    std::vector<Eigen::Vector3d> in_object, in_camera;
    for (const std::size_t i : indices) {
      in_object.push_back(pairs[i].in_object);
      in_camera.push_back(pairs[i].in_camera);
    }
    return poseOfPairs(in_object, in_camera);
  };
  std::mt19937 random(1);
  std::vector<std::size_t> best;
  for (int attempt = 0; attempt < kTries; ++attempt) {
    std::vector<std::size_t> three;
    for (int i = 0; i < 3; ++i) three.push_back(random() % pairs.size());
    const Eigen::Vector3d a = pairs[three[1]].in_object - pairs[three[0]].in_object;
    const Eigen::Vector3d b = pairs[three[2]].in_object - pairs[three[0]].in_object;
    if (a.cross(b).norm() < 4 * tolerance * tolerance) continue;  // in one place or one line
    auto indices = agreeing(poseOf(three));
    if (indices.size() > best.size()) best = std::move(indices);
  }
  if (best.size() < kLeastPairs) return std::nullopt;
  for (int round = 0; round < 2; ++round) {
    auto indices = agreeing(poseOf(best));
    if (indices.size() < best.size()) break;
    best = std::move(indices);
  }
  return poseOf(best);
}

void LandmarkMap::clear() {
  landmarks_.clear();
  views_.clear();
}

void LandmarkMap::save(const std::string& path, const std::string& object_name) const {
  constexpr int kColumns = 8 + 64;
  cv::Mat table(static_cast<int>(landmarks_.size()), kColumns, CV_32F);
  for (int row = 0; row < table.rows; ++row) {
    const Landmark& landmark = landmarks_[static_cast<std::size_t>(row)];
    float* out = table.ptr<float>(row);
    for (int i = 0; i < 3; ++i) *out++ = landmark.position[i];
    for (int i = 0; i < 3; ++i) *out++ = landmark.view[i];
    *out++ = landmark.variance;
    *out++ = static_cast<float>(landmark.seen);
    std::copy(landmark.descriptor.begin(), landmark.descriptor.end(), out);
  }
  cv::Mat views(static_cast<int>(views_.size()), 10, CV_64F);
  for (int row = 0; row < views.rows; ++row) {
    const View& view = views_[static_cast<std::size_t>(row)];
    for (int i = 0; i < 9; ++i) views.at<double>(row, i) = view.camera_from_object(i / 3, i % 3);
    views.at<double>(row, 9) = view.roll;
  }
  cv::FileStorage file;
  try {
    file.open(path, cv::FileStorage::WRITE | cv::FileStorage::FORMAT_YAML);
  } catch (const cv::Exception&) {
  }
  if (!file.isOpened()) throw std::runtime_error("landmarks '" + path + "': cannot be written");
  file << "format" << kFormat << "object" << object_name << "landmarks" << table << "views"
       << views;
}

void LandmarkMap::load(const std::string& path, const std::string& object_name) {
  const auto complain = [&](const std::string& what) {
    throw std::runtime_error("landmarks '" + path + "': " + what);
  };
  if (!std::ifstream(path)) complain("cannot be read");
  std::string format, object;
  cv::Mat table, views;
  try {
    cv::FileStorage file(path, cv::FileStorage::READ);
    file["format"] >> format;
    file["object"] >> object;
    file["landmarks"] >> table;
    file["views"] >> views;
  } catch (const cv::Exception& error) {
    complain(std::string("not a file of landmarks: ") + error.what());
  }
  if (format != kFormat) complain("not a file of landmarks of this version");
  if (object != object_name)
    complain("of the object '" + object + "', not of '" + object_name + "'");
  if ((!table.empty() && (table.type() != CV_32F || table.cols != 72)) ||
      (!views.empty() && (views.type() != CV_64F || views.cols != 10)) || !cv::checkRange(table) ||
      !cv::checkRange(views))
    complain("damaged: a table has the wrong shape or numbers that are not finite");
  clear();
  for (int row = 0; row < table.rows; ++row) {
    const float* in = table.ptr<float>(row);
    Landmark landmark;
    for (int i = 0; i < 3; ++i) landmark.position[i] = *in++;
    for (int i = 0; i < 3; ++i) landmark.view[i] = *in++;
    landmark.variance = *in++;
    landmark.seen = static_cast<int>(*in++);
    std::copy(in, in + landmark.descriptor.size(), landmark.descriptor.begin());
    landmarks_.push_back(landmark);
  }
  for (int row = 0; row < views.rows; ++row) {
    View view;
    for (int i = 0; i < 9; ++i) view.camera_from_object(i / 3, i % 3) = views.at<double>(row, i);
    view.roll = views.at<double>(row, 9);
    views_.push_back(view);
  }
}

}  // namespace leap_object_tracker
