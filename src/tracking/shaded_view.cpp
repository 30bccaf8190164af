#include "leap_object_tracker/tracking/shaded_view.hpp"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "depth_view.hpp"
#include "leap_optics.hpp"

namespace leap_object_tracker {
namespace {

constexpr float kSaturated = 250;        // grey level
constexpr int kRim = 2;                  // [px] of a silhouette that is left out
constexpr double kPixelsPerSample = 15;  // neighbours share their errors
constexpr double kFewestPixels = 60;     // of one eye
constexpr double kLeastResidual = 0.05;  // of the brightness: what Lambert's law leaves
constexpr float kGrossResidual = 60;     // [grey levels] something else is seen there
constexpr double kLargeBody = 35;        // [px] of the half of a body whose shadows may be coarse
constexpr float kShadowSlack = 0.01F;    // of the depth a pixel, by which a surface may hide itself
constexpr int kFits = 3;

}  // namespace

ShadedView::ShadedView(const Mesh& mesh, const RectifiedStereoCamera& camera)
    : camera_(camera), radius_(radiusOf(mesh)), triangles_(mesh.triangles) {
  vertices_.reserve(mesh.vertices.size());
  for (const Eigen::Vector3d& vertex : mesh.vertices) vertices_.push_back(vertex.cast<float>());
}

double ShadedView::logLikelihood(const std::array<EdgeField, 2>& fields,
                                 const Pose& camera_from_object) const {
  PlacedBody body;
  placeBody(vertices_, triangles_, camera_from_object, body);
  const bool coarse =
      camera_.focal_length * radius_ > kLargeBody * camera_from_object.translation().z();
  std::array<float, kLamps> lamps{};
  std::array<DepthView, kLamps> lit;
  const cv::Size& size = camera_.size;
  const cv::Rect everywhere(-size.width, -size.height, 3 * size.width, 3 * size.height);
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    lamps[i] = lampPlace(static_cast<int>(i), camera_.baseline);
    drawDepths(body.points, triangles_, camera_, lamps[i], everywhere, coarse ? 0.5F : 1.0F,
               lit[i]);
  }
  Sums all;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    if (!fields[eye].seen()) continue;
    const auto eye_x = static_cast<float>(eye == 0 ? 0 : camera_.baseline);
    DepthView seen;
    drawDepths(body.points, triangles_, camera_, eye_x, fields[eye].region(), 1, seen);
    const Sums sums = compare(fields[eye], body.normals, eye_x, seen, lamps, lit);
    all.residual += sums.residual;
    all.brightness += sums.brightness;
    all.pixels += sums.pixels;
  }
  if (all.pixels <= 0 || all.brightness <= 0) return 0;
  return -0.5 * all.pixels / kPixelsPerSample *
         std::log(all.residual / all.brightness + kLeastResidual * kLeastResidual);
}

ShadedView::Sums ShadedView::compare(const EdgeField& field,
                                     const std::vector<Eigen::Vector3f>& normals, float eye_x,
                                     const DepthView& seen, const std::array<float, 3>& lamps,
                                     const std::array<DepthView, 3>& lit) const {
  if (seen.box.area() < kFewestPixels) return {};
  cv::Mat inside;
  cv::erode(seen.nearness > 0, inside,
            cv::getStructuringElement(cv::MORPH_RECT, cv::Size(2 * kRim + 1, 2 * kRim + 1)),
            cv::Point(-1, -1), 1, cv::BORDER_CONSTANT, cv::Scalar(255));
  const cv::Mat grey = field.image()(seen.box - field.region().tl());
  const auto focal = static_cast<float>(camera_.focal_length);
  const auto center_u = static_cast<float>(camera_.center_u);

  cv::Mat shading(seen.box.size(), CV_32FC1, cv::Scalar(0));
  for (int v = 0; v < seen.box.height; ++v)
    for (int u = 0; u < seen.box.width; ++u) {
      if (seen.nearness.at<float>(v, u) <= 0) continue;
      const Eigen::Vector3f at = placeSeen(seen, camera_, eye_x, u, v);
      const Eigen::Vector3f& normal =
          normals[static_cast<std::size_t>(seen.triangle.at<int>(v, u))];
      float shade = 0;
      for (std::size_t i = 0; i < lamps.size(); ++i) {
        const float light = lampLight(lamps[i], at, normal);
        if (light <= 0) continue;
        // Something else of the body may throw its shadow here.
        const float lamp_u = center_u + focal * (at.x() - lamps[i]) / at.z();
        const auto lamp_v = static_cast<float>(v + seen.box.y);
        const cv::Point cell =
            cv::Point(cvRound(lit[i].scale * lamp_u), cvRound(lit[i].scale * lamp_v)) -
            lit[i].box.tl();
        if (cell.x >= 0 && cell.y >= 0 && cell.x < lit[i].box.width && cell.y < lit[i].box.height &&
            lit[i].nearness.at<float>(cell) * at.z() > 1 + kShadowSlack / lit[i].scale)
          continue;
        shade += light;
      }
      shading.at<float>(v, u) = shade;
    }
  cv::GaussianBlur(shading, shading, cv::Size(7, 7), kBlurU, kBlurV, cv::BORDER_REPLICATE);

  thread_local std::vector<std::array<float, 2>> pixels;  // grey value, shading
  pixels.clear();
  for (int v = 0; v < seen.box.height; ++v)
    for (int u = 0; u < seen.box.width; ++u)
      if (inside.at<std::uint8_t>(v, u) != 0)
        pixels.push_back(
            {static_cast<float>(grey.at<std::uint8_t>(v, u)), shading.at<float>(v, u)});
  if (static_cast<double>(pixels.size()) < kFewestPixels) return {};

  double lamp_gain = 0, even = 0;  // grey value = lamp_gain * shading + even
  for (int fit = 0; fit < kFits; ++fit) {
    double count = 0, shades = 0, squares = 0, values = 0, products = 0;
    for (const auto& [value, shade] : pixels) {
      const auto expected = static_cast<float>(lamp_gain * static_cast<double>(shade) + even);
      if (value > kSaturated && (fit == 0 || expected > kSaturated)) continue;
      if (fit > 0 && std::abs(value - expected) > kGrossResidual) continue;
      count += 1;
      shades += static_cast<double>(shade);
      squares += static_cast<double>(shade * shade);
      values += static_cast<double>(value);
      products += static_cast<double>(value * shade);
    }
    if (squares <= 0) break;
    const double determinant = count * squares - shades * shades;
    lamp_gain = even = 0;
    if (determinant > 1e-6 * count * squares) {
      lamp_gain = (count * products - shades * values) / determinant;
      even = (squares * values - shades * products) / determinant;
    }
    // No light is negative.
    if (lamp_gain <= 0 && even > 0) lamp_gain = 0, even = values / count;
    if (even <= 0) even = 0, lamp_gain = products / squares;
  }
  if (lamp_gain <= 0 && even <= 0) return {};
  Sums sums;
  for (const auto& [value, shade] : pixels) {
    const float expected =
        std::min(255.0F, static_cast<float>(lamp_gain * static_cast<double>(shade) + even));
    const float residual = value > kSaturated && expected > kSaturated
                               ? 0
                               : std::clamp(value - expected, -kGrossResidual, kGrossResidual);
    sums.residual += static_cast<double>(residual * residual);
    if (value > kSaturated) continue;
    sums.brightness += static_cast<double>(value * value);
    sums.pixels += 1;
  }
  return sums;
}

}  // namespace leap_object_tracker
