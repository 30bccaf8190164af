#include "overlay.hpp"

#include <opencv2/imgproc.hpp>

namespace leap_object_tracker {

cv::Mat drawOverlay(const RectifiedStereoFrame& frame, const Tracker& tracker,
                    const std::optional<Pose>& camera_from_object) {
  constexpr int kFractionBits = 4;
  const cv::Size size = tracker.camera().size;
  cv::Mat both(size.height, 2 * size.width, CV_8UC3, cv::Scalar::all(0));
  for (const int eye : {0, 1}) {
    cv::Mat half = both(cv::Rect(eye * size.width, 0, size.width, size.height));
    const cv::Mat& image = eye == 0 ? frame.left : frame.right;
    if (!image.empty()) cv::cvtColor(image, half, cv::COLOR_GRAY2BGR);
    if (!camera_from_object) continue;
    const auto fixed = [](const Eigen::Vector2d& pixel) {
      const Eigen::Vector2d scaled = pixel * (1 << kFractionBits);
      return cv::Point(cvRound(scaled.x()), cvRound(scaled.y()));
    };
    for (const auto& segment : tracker.contour(*camera_from_object, eye))
      cv::line(half, fixed(segment.first), fixed(segment.second), {60, 255, 60}, 1, cv::LINE_AA,
               kFractionBits);
  }
  return both;
}

}  // namespace leap_object_tracker
