#include "leap_object_tracker/leap/epipolar_check.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>
#include <vector>

namespace leap_object_tracker {
namespace {

constexpr int kFeatures = 800;
constexpr int kFewestMatches = 30;
constexpr double kFarthestColumn = 1.5;  // slope in the rectified frame; lenses are coarse outside
constexpr double kLargestRowDifference = 0.1;  // slope: beyond it a match is a mistake

/// Direction (x/z, y/z) in the rectified frame.
Eigen::Vector2d rectifiedRay(const CameraCalibration& camera, const cv::Point2f& pixel) {
  const Eigen::Vector2d raw = rayFromPixel(camera, {pixel.x, pixel.y});
  return (camera.rectified_from_raw * raw.homogeneous()).hnormalized();
}

}  // namespace

std::optional<EpipolarResidual> epipolarResidual(const RawStereoFrame& frame,
                                                 const StereoCalibration& calibration) {
  const auto detector = cv::ORB::create(kFeatures);
  std::vector<cv::KeyPoint> left, right;
  cv::Mat left_descriptors, right_descriptors;
  detector->detectAndCompute(frame.left, cv::noArray(), left, left_descriptors);
  detector->detectAndCompute(frame.right, cv::noArray(), right, right_descriptors);
  if (left.empty() || right.empty()) return std::nullopt;

  std::vector<cv::DMatch> matches;
  cv::BFMatcher(cv::NORM_HAMMING, true).match(left_descriptors, right_descriptors, matches);
  std::vector<double> differences;
  for (const cv::DMatch& match : matches) {
    const Eigen::Vector2d a = rectifiedRay(calibration.left, left[match.queryIdx].pt);
    const Eigen::Vector2d b = rectifiedRay(calibration.right, right[match.trainIdx].pt);
    const double rows = std::abs(a.y() - b.y());
    const bool plausible = a.allFinite() && b.allFinite() &&
                           a.cwiseAbs().maxCoeff() < kFarthestColumn && a.x() > b.x() - 0.02 &&
                           rows < kLargestRowDifference;
    if (plausible) differences.push_back(rows);
  }
  if (static_cast<int>(differences.size()) < kFewestMatches) return std::nullopt;
  const auto middle = differences.begin() + static_cast<std::ptrdiff_t>(differences.size() / 2);
  std::nth_element(differences.begin(), middle, differences.end());
  return EpipolarResidual{static_cast<int>(differences.size()), *middle * calibration.left.fx};
}

}  // namespace leap_object_tracker
