#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace leap_object_tracker {

/// Memory of an image that changes its size from frame to frame and is allocated only to grow.
template <class T>
class ImageMemory {
 public:
  ImageMemory() = default;
  ImageMemory(const ImageMemory&) = delete;
  ImageMemory& operator=(const ImageMemory&) = delete;

  /// Leaves the pixels as they happen to be.
  void resize(int rows, int columns) {
    rows_ = rows, columns_ = columns;
    const auto size = static_cast<std::size_t>(rows) * static_cast<std::size_t>(columns);
    if (pixels_.size() < size) pixels_.resize(size);
  }
  int rows() const { return rows_; }
  int columns() const { return columns_; }
  T* row(int index) { return pixels_.data() + std::ptrdiff_t{index} * columns_; }
  const T* row(int index) const { return pixels_.data() + std::ptrdiff_t{index} * columns_; }

 private:
  int rows_ = 0, columns_ = 0;
  std::vector<T> pixels_;
};

/// Smoothing, gradients and edges of grey images, as OpenCV's GaussianBlur, Sobel and Canny make
/// them with mirrored borders, but without an allocation once the largest image was seen.
class EdgeDetector {
 public:
  /// Gaussian of one pixel over 5 x 5. @param scale of the result, rounded
  void smooth(const cv::Mat& grey, float scale, ImageMemory<std::int16_t>& smoothed);

  /// Derivatives (Sobel, 3 x 3) of an image that a table of 256 values was applied to and that was
  /// smoothed by a Gaussian of one pixel.
  void differentiate(const cv::Mat& grey, const std::uint8_t* table);
  const ImageMemory<std::int16_t>& du() const { return du_; }
  const ImageMemory<std::int16_t>& dv() const { return dv_; }

  /// Thin edges (Canny 1986) of the last derivatives: where the gradient is above `low` along a
  /// line on which it is above `high` somewhere.
  void findEdges(float low, float high);
  bool isEdge(int u, int v) const { return states_.row(v + 1)[u + 1] == kEdge; }

 private:
  enum State : std::uint8_t { kNone, kWeak, kEdge };
  void suppressNonMaxima(int row, std::int32_t low, std::int32_t high);
  void follow();

  ImageMemory<std::int16_t> du_, dv_;
  ImageMemory<float> smoothed_rows_;
  ImageMemory<std::uint16_t> weighted_rows_;
  ImageMemory<std::uint8_t> stabilized_;
  ImageMemory<std::int32_t> squares_;             ///< of the gradient, with a border of zeros
  ImageMemory<std::uint8_t> states_;              ///< with a border of kNone
  std::vector<std::uint8_t> bytes_;               ///< a row with mirrored borders
  std::vector<std::int16_t> sums_, differences_;  ///< the same
  std::vector<std::uint8_t*> strong_;             ///< edges whose neighbours are not looked at yet
};

}  // namespace leap_object_tracker
