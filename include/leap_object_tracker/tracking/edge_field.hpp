#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "leap_object_tracker/tracking/edge_detector.hpp"

namespace leap_object_tracker {

/// How well an edge explains a contour point at a distance: a truncated quadratic of the distance
/// transform, in nats per independent pixel of contour:
///   gain(d) = max(0, log_ratio - d^2 / (2 sigma^2)).
struct EdgeKernel {
  float sigma = 1;      ///< [cells]
  float log_ratio = 2;  ///< log density of a perfect match over that of no match
};

/// The truncated distance transform of the edges of one eye, one plane for each of 8 edge
/// directions, already turned into gains, less the mean gain of the plane: what a contour point
/// would win anywhere.
struct GainMap {
  static constexpr int kDirections = 8;

  int width = 0, height = 0;         ///< [cells], with a border of one cell
  int row_stride = 0;                ///< [bytes]
  int plane_stride = 0;              ///< [bytes]
  float origin_u = 0, origin_v = 0;  ///< [px] image place of the centre of cell (0, 0)
  float cells_per_pixel = 1;
  float nats_per_step = 0;          ///< gain of one grey step
  std::vector<std::uint8_t> gains;  ///< kZero + gain / nats_per_step

  static constexpr int kZero = 112;
  static constexpr int kMargin = 16;  ///< [cells] around each plane

  /// Cell (0, 0) of plane 0.
  const std::uint8_t* first() const { return gains.data() + kMargin * row_stride + kMargin; }
  std::uint8_t* first() { return gains.data() + kMargin * row_stride + kMargin; }
};

/// One eye of one frame: edges in a region of interest, ready to be scored and refined on.
class EdgeField {
 public:
  /// Smooths, finds Canny edges and their directions inside `region` of an 8-bit grey image. The
  /// thresholds follow the image's own noise and contrast.
  /// An empty image gives a field without edges.
  void build(const cv::Mat& image, const cv::Rect& region);

  /// Distance transform of the edges as gains. @param coarseness cell size in pixels (1, 2, 4 ...)
  void transform(const EdgeKernel& kernel, int coarseness, GainMap& map) const;

  bool seen() const { return !smooth_.empty(); }
  const cv::Rect& region() const { return region_; }
  const cv::Size& imageSize() const { return image_size_; }

  /// Grey values of the region as they came (CV_8UC1).
  const cv::Mat& image() const { return image_; }
  /// Smoothed grey values of the region, 16 times the 8-bit scale (CV_16SC1).
  const cv::Mat& smooth() const { return smooth_; }

  /// One edge pixel, in pixels of the whole image.
  struct Edgel {
    std::int16_t u, v;
    std::uint8_t direction;  ///< of the edge line, 0 to 255 for 0 to 180 deg, from +u towards +v
  };
  const std::vector<Edgel>& edgels() const { return edgels_; }
  /// Standard deviation of the smoothed image's slope [grey levels per pixel] where it has this
  /// grey level: read noise and shot noise together.
  float slopeNoise(float grey) const {
    return slope_noise_[static_cast<std::uint8_t>(grey < 0 ? 0 : grey > 255 ? 255 : grey)];
  }

 private:
  cv::Rect region_;
  cv::Size image_size_;
  cv::Mat image_, smooth_;
  ImageMemory<std::int16_t> smooth_memory_;
  EdgeDetector detector_, patch_detector_;
  std::vector<Edgel> edgels_;
  std::array<float, 256> slope_noise_{};
};

}  // namespace leap_object_tracker
