#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

namespace leap_object_tracker {

/// Where each pixel of an image comes from in another one, ready for bilinear interpolation with
/// fractions of 1/256 px. Faster and finer than cv::remap (1/32 px), for 8-bit grey.
class RemapTable {
 public:
  RemapTable() = default;
  /// @param map_u, map_v CV_32FC1, the source pixel of each pixel. Outside the source, the nearest
  /// pixel of its border: so the end of what is seen makes no edge. Not finite: left black.
  RemapTable(const cv::Mat& map_u, const cv::Mat& map_v, const cv::Size& source_size);

  const cv::Size& size() const { return size_; }
  const cv::Size& sourceSize() const { return source_size_; }

  /// Fills the rows [first, last) of `target`, CV_8UC1 of size(), from `source`, CV_8UC1 of
  /// sourceSize() and continuous. Rows may be filled by several threads at once.
  void fillRows(const cv::Mat& source, cv::Mat& target, int first, int last) const;

 private:
  /// Pixels that are not black: [begin, end), but for the holes.
  struct Row {
    int begin = 0;
    int end = 0;
    std::vector<int> holes;
  };

  cv::Size size_;
  cv::Size source_size_;
  std::vector<std::int32_t> offsets_;     ///< of the upper left neighbour
  std::vector<std::uint16_t> fractions_;  ///< [1/256 px] to the right; down in the upper byte
  std::vector<Row> rows_;
};

}  // namespace leap_object_tracker
