#include "leap_object_tracker/tracking/edge_field.hpp"

#include <gtest/gtest.h>

namespace leap_object_tracker {
namespace {

/// Grey 60 with the noise of a sensor; a square in the middle is printed with dots.
cv::Mat boardWithPrint() {
  cv::Mat image(480, 640, CV_32FC1, cv::Scalar(60)), noise(image.size(), CV_32FC1);
  cv::RNG random(7);
  cv::Mat dots(80, 80, CV_32FC1);
  random.fill(dots, cv::RNG::UNIFORM, -50, 50);
  cv::Mat square(image, cv::Rect(240, 160, 160, 160));
  for (int v = 0; v < square.rows; ++v)
    for (int u = 0; u < square.cols; ++u) square.at<float>(v, u) += dots.at<float>(v / 2, u / 2);
  random.fill(noise, cv::RNG::NORMAL, 0, 2);
  image += noise;
  cv::Mat grey;
  image.convertTo(grey, CV_8UC1);
  return grey;
}

float noiseIn(const cv::Mat& image, const cv::Rect& region) {
  EdgeField field;
  field.build(image, region);
  return field.slopeNoise(60);
}

TEST(EdgeField, doesNotTakeTextureForNoise) {
  const cv::Mat image = boardWithPrint();
  const float plain = noiseIn(image, cv::Rect(20, 20, 160, 160));
  EXPECT_LT(noiseIn(image, cv::Rect(240, 160, 160, 160)), 4 * plain);
}

TEST(EdgeField, knowsTheNoiseOfAPlainRegion) {
  // Of the derivative of a Gaussian of one pixel, sampled by Sobel's kernel: 0.19 of white noise.
  EXPECT_NEAR(noiseIn(boardWithPrint(), cv::Rect(20, 20, 160, 160)), 2 * 0.19F, 0.25F);
}

TEST(EdgeField, ofAnImageSmallerThanAPatchHasEdges) {
  cv::Mat image(20, 20, CV_8UC1, cv::Scalar(10));
  image.colRange(10, 20).setTo(150);
  EdgeField field;
  field.build(image, cv::Rect(0, 0, 20, 20));
  EXPECT_GT(field.edgels().size(), 10U);
}

}  // namespace
}  // namespace leap_object_tracker
