#include "leap_object_tracker/tracking/surface_places.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <unordered_map>
#include <utility>

namespace leap_object_tracker {
namespace {

constexpr int kBlockSize = 9;           // [px of half the size]
constexpr int kTexture = 8;             // [grey levels] least mean slope of what is matched
constexpr int kUniqueness = 5;          // [%] by which the best disparity must be better
constexpr int kSameDisparity = 2;       // [px of half the size] from the left and from the right
constexpr double kLeastSurface = 0.15;  // of the area of the body as it is seen on average
constexpr double kBehind = 0.6;         // of the body's size: from the surface to the middle
constexpr double kCell = 0.5;           // of the body's size
constexpr double kApart = 0.5;          // of the body's size, between places

/// The part of a surface in one cell of space.
struct Patch {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();  // [m^3] of its points times their areas
  double area = 0;                                // [m^2]
};
using Patches = std::unordered_map<std::uint64_t, Patch>;

std::uint64_t keyOf(const Eigen::Vector3i& cell) {
  std::uint64_t key = 0;
  for (int k = 0; k < 3; ++k) key = key << 20U | static_cast<std::uint64_t>(cell[k] + 500'000);
  return key;
}

Eigen::Vector3i cellOf(const Eigen::Vector3d& point, double edge) {
  return (point / edge).array().floor().cast<int>();
}

/// Disparities of half the image [1/16 px]; columns begin `disparities` to the left of the image.
cv::Mat matched(const RectifiedStereoFrame& frame, int disparities) {
  std::array<cv::Mat, 2> eyes;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    cv::resize(eye == 0 ? frame.left : frame.right, eyes[eye], cv::Size(), 0.5, 0.5,
               cv::INTER_AREA);
    // The matcher leaves out as much of the left side as it looks for matches there.
    cv::copyMakeBorder(eyes[eye], eyes[eye], 0, 0, disparities, 0, cv::BORDER_REPLICATE);
  }
  const cv::Ptr<cv::StereoBM> matcher = cv::StereoBM::create(disparities, kBlockSize);
  matcher->setTextureThreshold(kTexture * kBlockSize * kBlockSize);
  matcher->setUniquenessRatio(kUniqueness);
  matcher->setDisp12MaxDiff(kSameDisparity);
  cv::Mat found;
  matcher->compute(eyes[0], eyes[1], found);
  return found;
}

}  // namespace

SurfacePlaces::SurfacePlaces(const RectifiedStereoCamera& camera, double nearest, double farthest,
                             double size)
    : camera_(camera), nearest_(nearest), farthest_(farthest), size_(size) {}

std::vector<Eigen::Vector3d> SurfacePlaces::find(const RectifiedStereoFrame& frame) const {
  if (frame.left.empty() || frame.right.empty()) return {};
  const double focal = camera_.focal_length / 2;
  const int disparities =
      16 * std::clamp(static_cast<int>(std::ceil(focal * camera_.baseline / nearest_ / 16)), 1,
                      std::max(1, frame.left.cols / 32));
  const cv::Mat disparity = matched(frame, disparities);
  Patches patches;
  const double edge = kCell * size_;
  for (int v = 0; v < disparity.rows; ++v) {
    const auto* row = disparity.ptr<std::int16_t>(v);
    for (int u = disparities; u < disparity.cols; ++u) {
      if (row[u] <= 0) continue;
      const double depth = focal * camera_.baseline * cv::StereoMatcher::DISP_SCALE / row[u];
      if (depth < nearest_ || depth > farthest_) continue;
      const Eigen::Vector3d point((u - disparities + 0.25 - camera_.center_u / 2) * depth / focal,
                                  (v + 0.25 - camera_.center_v / 2) * depth / focal, depth);
      Patch& patch = patches[keyOf(cellOf(point, edge))];
      const double area = depth * depth / (focal * focal);
      patch.sum += area * point;
      patch.area += area;
    }
  }
  std::vector<std::pair<double, Eigen::Vector3d>> places;
  const int reach = static_cast<int>(std::ceil(2 / kCell));
  for (const auto& [key, patch] : patches) {
    const Eigen::Vector3d surface = patch.sum / patch.area;
    const Eigen::Vector3i cell = cellOf(surface, edge);
    Patch near;
    double around = 0;
    for (int x = -reach; x <= reach; ++x)
      for (int y = -reach; y <= reach; ++y)
        for (int z = -reach; z <= reach; ++z) {
          const auto other = patches.find(keyOf(cell + Eigen::Vector3i(x, y, z)));
          if (other == patches.end()) continue;
          const auto& [sum, area] = other->second;
          const double apart = (sum / area - surface).norm();
          if (apart < 2 * size_) around += area;
          if (apart > size_) continue;
          near.area += area;
          near.sum += sum;
        }
    if (near.area < kLeastSurface * M_PI * size_ * size_) continue;
    const Eigen::Vector3d middle = near.sum / near.area;
    places.emplace_back(near.area / around, middle + kBehind * size_ * middle.normalized());
  }
  std::sort(places.begin(), places.end(), [](const auto& a, const auto& b) {
    return a.first != b.first ? a.first > b.first : a.second.z() < b.second.z();
  });
  std::vector<Eigen::Vector3d> kept;
  for (const auto& [weight, place] : places)
    if (std::none_of(kept.begin(), kept.end(), [&, place = place](const Eigen::Vector3d& other) {
          return (other - place).norm() < kApart * size_;
        }))
      kept.push_back(place);
  return kept;
}

}  // namespace leap_object_tracker
