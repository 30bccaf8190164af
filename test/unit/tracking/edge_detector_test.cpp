#include "leap_object_tracker/tracking/edge_detector.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

namespace leap_object_tracker {
namespace {

/// Discs of random brightness under noise.
cv::Mat discs(const cv::Size& size, int seed) {
  cv::RNG random(static_cast<std::uint64_t>(seed));
  cv::Mat image(size, CV_8UC1, cv::Scalar(40));
  for (int i = 0; i < 12; ++i)
    cv::circle(image, {random.uniform(0, size.width), random.uniform(0, size.height)},
               random.uniform(5, 40), cv::Scalar(random.uniform(0, 255)), cv::FILLED);
  cv::Mat noise(size, CV_8UC1);
  random.fill(noise, cv::RNG::UNIFORM, 0, 12);
  return image + noise;
}

TEST(EdgeDetector, findsWhatTheFiltersOfOpenCvFind) {
  EdgeDetector detector;
  ImageMemory<std::int16_t> smoothed;
  cv::Mat table(1, 256, CV_8UC1);
  for (int i = 0; i < 256; ++i) table.at<std::uint8_t>(i) = static_cast<std::uint8_t>(255 - i / 2);
  // Larger and smaller in turn: nothing may be left of the image before.
  for (const cv::Size size :
       {cv::Size(160, 120), cv::Size(33, 50), cv::Size(97, 9), cv::Size(8, 8)}) {
    const cv::Mat image = discs(size, size.width);
    cv::Mat scaled, expected, stabilized, du, dv, edges;
    image.convertTo(scaled, CV_16SC1, 16.0);
    cv::GaussianBlur(scaled, expected, cv::Size(5, 5), 1, 1);
    cv::LUT(image, table, stabilized);
    cv::GaussianBlur(stabilized, stabilized, cv::Size(5, 5), 1, 1);
    cv::Sobel(stabilized, du, CV_16S, 1, 0, 3);
    cv::Sobel(stabilized, dv, CV_16S, 0, 1, 3);
    cv::Canny(du, dv, edges, 30, 75, true);

    detector.smooth(image, 16, smoothed);
    detector.differentiate(image, table.ptr<std::uint8_t>());
    detector.findEdges(30, 75);
    for (int v = 0; v < size.height; ++v)
      for (int u = 0; u < size.width; ++u) {
        // The order of its sums is OpenCV's own.
        ASSERT_NEAR(smoothed.row(v)[u], expected.at<std::int16_t>(v, u), 1) << u << ", " << v;
        ASSERT_EQ(detector.du().row(v)[u], du.at<std::int16_t>(v, u)) << u << ", " << v;
        ASSERT_EQ(detector.dv().row(v)[u], dv.at<std::int16_t>(v, u)) << u << ", " << v;
        ASSERT_EQ(detector.isEdge(u, v), edges.at<std::uint8_t>(v, u) != 0) << u << ", " << v;
      }
  }
}

}  // namespace
}  // namespace leap_object_tracker
