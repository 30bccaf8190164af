#include "leap_object_tracker/tracking/contour_measurement.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr std::array<float, 2> kSigma = {3.0F, 1.2F};  // [cells] blunt, sharp
constexpr int kMostCells = 160 * 160;          // of a gain map; larger regions get larger cells
constexpr int kBluntPoints = 32;               // that tell as much of a blunt likelihood as more
constexpr float kIndependentShare = 1 / 3.0F;  // samples per pixel of contour

/// log(p(d = 0 | edge of the object) / p(any d | no edge of it)) of a Gaussian of the distance with
/// a uniform share of outliers, against a uniform density over the truncation distance on both
/// sides.
float logRatio(float sigma, double outlier_share, double truncation) {
  const double peak = (1 - outlier_share) / (std::sqrt(2 * M_PI) * sigma);
  const double uniform = 1 / (2 * truncation);
  return static_cast<float>(std::log(1 + peak / (outlier_share * uniform)));
}

}  // namespace

ContourMeasurement::ContourMeasurement(const ContourParams& params, Eyes eyes,
                                       const RectifiedStereoCamera& camera)
    : params_(params), eyes_(eyes), camera_(camera) {}

void ContourMeasurement::observe(const RectifiedStereoFrame& frame,
                                 const std::array<cv::Rect, 2>& regions) {
  tbb::parallel_for(std::size_t{0}, std::size_t{2}, [&](std::size_t eye) {
    const bool used = eyes_ == Eyes::kBoth || eyes_ == (eye == 0 ? Eyes::kLeft : Eyes::kRight);
    fields_[eye].build(used ? (eye == 0 ? frame.left : frame.right) : cv::Mat(), regions[eye]);
    if (!fields_[eye].seen()) return;
    int coarseness = 1;
    while (fields_[eye].region().area() / (coarseness * coarseness) > kMostCells) coarseness *= 2;
    for (std::size_t sharpness = 0; sharpness < 2; ++sharpness) {
      const float sigma = kSigma[sharpness];
      fields_[eye].transform({sigma, logRatio(sigma, params_.outlier_share, params_.truncation)},
                             coarseness, maps_[sharpness][eye]);
    }
  });
}

void ContourMeasurement::score(const ContourModel& model, Sharpness sharpness,
                               const ParticlePose* poses, std::size_t count,
                               float* log_likelihood) const {
  std::array<EyeView, 2> eyes;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    if (fields_[eye].seen()) eyes[eye].map = &maps_[static_cast<std::size_t>(sharpness)][eye];
    eyes[eye].focal_length = static_cast<float>(camera_.focal_length);
    eyes[eye].center_u = static_cast<float>(camera_.center_u);
    eyes[eye].center_v = static_cast<float>(camera_.center_v);
    eyes[eye].eye_x = eye == 0 ? 0 : static_cast<float>(camera_.baseline);
  }
  const int points =
      sharpness == Sharpness::kBlunt ? std::min(kBluntPoints, model.points()) : model.points();
  const float share =
      kIndependentShare * static_cast<float>(model.points()) / static_cast<float>(points);
  scoreContours(model, points, eyes.data(), eyes.size(), share, poses, count, log_likelihood);
}

}  // namespace leap_object_tracker
