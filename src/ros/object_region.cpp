#include "object_region.hpp"

#include <algorithm>
#include <cmath>

namespace leap_object_tracker {
namespace {

constexpr double kNearest = 0.01;  // [m] vertices closer to the eye have no place in the image

}  // namespace

std::array<cv::Rect, 2> objectRegions(const Mesh& mesh, const Pose& camera_from_object,
                                      const RectifiedStereoCamera& camera, int margin) {
  std::array<cv::Rect, 2> regions;
  for (std::size_t eye = 0; eye < 2; ++eye) {
    Eigen::AlignedBox2d box;
    for (const auto& vertex : mesh.vertices) {
      const Eigen::Vector3d point = camera_from_object * vertex;
      if (point.z() > kNearest)
        box.extend(eye == 0 ? camera.leftPixel(point) : camera.rightPixel(point));
    }
    if (box.isEmpty()) continue;
    const Eigen::Vector2i first = box.min().array().floor().cast<int>() - margin;
    const Eigen::Vector2i last = box.max().array().ceil().cast<int>() + margin;
    regions[eye] = cv::Rect(cv::Point(first.x(), first.y()), cv::Point(last.x(), last.y())) &
                   cv::Rect(cv::Point(), camera.size);
  }
  return regions;
}

}  // namespace leap_object_tracker
