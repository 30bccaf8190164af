#include "leap_object_tracker/tracking/edge_places.hpp"

#include <cmath>
#include <cstdint>
#include <opencv2/imgproc.hpp>

namespace leap_object_tracker {
namespace {

constexpr double kGrowth = 1.25;      // of the depth, from one layer of the grid to the next
constexpr double kStep = 0.35;        // of the body's size, between neighbours in a layer
constexpr double kSmallest = 12;      // [px] of the body's size
constexpr double kHalfWindow = 1.3;   // of the body's size, about a place
constexpr double kLeastEdges = 0.5;   // edge pixels in it, over the girth of the body there
constexpr double kLeastInside = 0.7;  // of it in the image

}  // namespace

std::vector<Eigen::Vector3d> placesAmongEdges(const EdgeField& field,
                                              const RectifiedStereoCamera& camera, double eye_x,
                                              double nearest, double farthest, double size) {
  std::vector<Eigen::Vector3d> places;
  cv::Mat edges(camera.size, CV_8UC1, cv::Scalar(0)), sums;
  for (const EdgeField::Edgel& edgel : field.edgels()) edges.at<std::uint8_t>(edgel.v, edgel.u) = 1;
  cv::integral(edges, sums, CV_32S);
  const double focal = camera.focal_length;
  for (double depth = nearest; depth < farthest; depth *= kGrowth) {
    const double radius = focal * size / depth;
    if (radius < kSmallest) break;
    const double step = kStep * radius, half = kHalfWindow * radius;
    for (double v = step / 2; v < camera.size.height; v += step)
      for (double u = step / 2; u < camera.size.width; u += step) {
        const cv::Rect window =
            cv::Rect(cvRound(u - half), cvRound(v - half), cvRound(2 * half), cvRound(2 * half)) &
            cv::Rect(cv::Point(), camera.size);
        if (window.area() < kLeastInside * 4 * half * half) continue;
        const cv::Point low = window.tl(), high = window.br();
        const int inside = sums.at<int>(high) - sums.at<int>(low.y, high.x) -
                           sums.at<int>(high.y, low.x) + sums.at<int>(low);
        if (inside < kLeastEdges * 2 * M_PI * radius) continue;
        places.emplace_back(eye_x + (u - camera.center_u) * depth / focal,
                            (v - camera.center_v) * depth / focal, depth);
      }
  }
  return places;
}

}  // namespace leap_object_tracker
