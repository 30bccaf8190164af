#include "leap_object_tracker/tracking/eye_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "depth_view.hpp"
#include "sampler.hpp"

namespace leap_object_tracker {
namespace {

constexpr int kRim = 3;                  // [px] beside silhouettes and edges that is left out
constexpr int kLeastStride = 2;          // [px] both ways
constexpr double kMostLooks = 5000;      // at pixels of the box around a body
constexpr double kPixelsPerSample = 12;  // neighbours share their errors
constexpr float kTextureNoise = 4;       // [noise] of a slope that is texture
constexpr float kTextureSlope = 0.08F;   // of the brightness a pixel: shading changes less
constexpr float kSaturated = 245;        // grey level
constexpr float kUnlikeSlopes = 0.25F;   // share of a slope by which eyes differ
constexpr float kLeastVariance = 0.1F;   // [grey levels^2/px^2]
constexpr float kFreedom = 4;            // of Student's t-distribution
constexpr float kOutliers = 0.15F;
constexpr float kOutlierDensity = 0.1F;                            // of the greatest
constexpr int kNearShifts = 4;                                     // [px] at which to look as well
constexpr std::array kFarShifts{6.0F, 8.0F, 10.0F, 12.0F, 14.0F};  // [px] that only count
constexpr float kStepOfDepth = 0.02F;  // share of the nearness by which a surface bends
constexpr float kSmoothTurn = 0.9F;    // cosine between normals of one smooth surface

/// Whether no edge of the body is near a pixel: edges are in its contour already.
bool smoothAround(const DepthView& seen, const std::vector<Eigen::Vector3f>& normals, int row,
                  int column) {
  const auto* nearness = seen.nearness.ptr<float>(row) + column;
  const auto normal = [&](int v, int u) -> const Eigen::Vector3f& {
    return normals[static_cast<std::size_t>(seen.triangle.at<int>(row + v, column + u))];
  };
  return std::abs(nearness[-kRim] + nearness[kRim] - 2 * nearness[0]) <=
             kStepOfDepth * nearness[0] &&
         normal(0, -kRim).dot(normal(0, kRim)) >= kSmoothTurn &&
         normal(-kRim, 0).dot(normal(kRim, 0)) >= kSmoothTurn;
}

}  // namespace

EyeAgreement::EyeAgreement(const Mesh& mesh, const RectifiedStereoCamera& camera)
    : camera_(camera), triangles_(mesh.triangles) {
  vertices_.reserve(mesh.vertices.size());
  for (const Eigen::Vector3d& vertex : mesh.vertices) vertices_.push_back(vertex.cast<float>());
}

EyeAgreement::Agreement EyeAgreement::compare(const std::array<EdgeField, 2>& fields,
                                              const Pose& camera_from_object) const {
  Agreement agreement;
  if (!fields[0].seen() || !fields[1].seen()) return agreement;
  PlacedBody body;
  placeBody(vertices_, triangles_, camera_from_object, body);
  DepthView seen;
  drawDepths(body.points, triangles_, camera_, 0, fields[0].region(), 1, seen);
  if (seen.box.width <= 2 * kRim || seen.box.height <= 2 * kRim) return agreement;
  cv::Mat inside;
  cv::erode(seen.nearness > 0, inside,
            cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * kRim + 1, 2 * kRim + 1)),
            cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, cv::Scalar(0));
  const Sampler<std::int16_t> left(fields[0], fields[0].smooth(), 1 / 16.0F);
  const Sampler<std::int16_t> right(fields[1], fields[1].smooth(), 1 / 16.0F);
  const auto slopeAt = [](const Sampler<std::int16_t>& eye, float u, float v) {
    return eye.contains(u - 1, v) && eye.contains(u + 1, v) ? 0.5F * (eye(u + 1, v) - eye(u - 1, v))
                                                            : 0.0F;
  };
  const auto disparity_of = static_cast<float>(camera_.focal_length * camera_.baseline);
  const int stride =
      std::max(kLeastStride, static_cast<int>(std::ceil(std::sqrt(seen.box.area() / kMostLooks))));
  std::array<float, 2 * kNearShifts + 1> sums{}, densities{};
  for (int row = kRim; row < seen.box.height - kRim; row += stride)
    for (int column = kRim; column < seen.box.width - kRim; column += stride) {
      if (inside.at<std::uint8_t>(row, column) == 0) continue;
      const auto u = static_cast<float>(column + seen.box.x);
      const auto v = static_cast<float>(row + seen.box.y);
      if (!left.contains(u, v)) continue;
      const float grey = left(u, v), slope = slopeAt(left, u, v);
      const float noise = fields[0].slopeNoise(grey);
      if (grey > kSaturated ||
          std::abs(slope) < std::max(kTextureNoise * noise, kTextureSlope * grey) ||
          !smoothAround(seen, body.normals, row, column))
        continue;
      const float other_u = u - disparity_of * seen.nearness.at<float>(row, column);
      if (!right.contains(other_u - 1, v) || !right.contains(other_u + 1, v) ||
          right(other_u, v) > kSaturated)
        continue;
      const float variance =
          2 * noise * noise + kUnlikeSlopes * kUnlikeSlopes * slope * slope + kLeastVariance;
      const auto density = [&](float at) {
        const float residual = slope - slopeAt(right, at, v);
        const float base = 1 + residual * residual / (kFreedom * variance);
        return (1 - kOutliers) / (base * base * std::sqrt(base)) + kOutliers * kOutlierDensity;
      };
      float all = 0;
      for (int shift = -kNearShifts; shift <= kNearShifts; ++shift) {
        float& here = densities[static_cast<std::size_t>(shift + kNearShifts)];
        here = density(other_u + static_cast<float>(shift));
        all += here;
      }
      for (const float by : kFarShifts) all += density(other_u - by) + density(other_u + by);
      const float mean = all / static_cast<float>(densities.size() + 2 * kFarShifts.size());
      for (std::size_t i = 0; i < sums.size(); ++i) sums[i] += std::log(densities[i] / mean);
    }
  const double share = std::min(1.0, stride * stride / kPixelsPerSample);
  const auto* best = std::max_element(sums.begin(), sums.end());
  agreement.log_likelihood_ratio = share * static_cast<double>(sums[kNearShifts]);
  agreement.best_ratio = share * static_cast<double>(*best);
  if (agreement.best_ratio > agreement.log_likelihood_ratio)
    agreement.best_shift = static_cast<double>(best - sums.begin()) - kNearShifts;
  return agreement;
}

}  // namespace leap_object_tracker
