#pragma once

#include <cstddef>
#include <vector>

namespace leap_object_tracker {

/// Short pieces of projected contour, one array a coordinate.
class ContourLines {
 public:
  void clear();
  /// @param u, v place [px]
  /// @param normal_u, normal_v unit vector across the line
  /// @param step brightness that the normal gains across the line, times the length
  /// @param seen length [px] by how surely it shows
  void add(float u, float v, float normal_u, float normal_v, float step, float seen);

  /// What runs beside a line of the same direction, by distances along its normal.
  struct Neighbours {
    float before, after;      ///< [px] to the next lines on both sides, at most kFarthest
    float same, same_moment;  ///< steps of the lines on its place, and times their distances
    float near, near_moment;  ///< the same of all that blur together with it, by how much they do
    /// [px] length seen of all lines not told apart from it, itself included, by how near they are
    float all;
  };
  static constexpr float kFarthest = 16;    // [px]
  static constexpr float kSameLine = 0.7F;  // [px]
  static constexpr float kWindow = 8;       ///< [px] along a line, fading, in which `all` counts

  struct Arrays {
    const float *u, *v, *normal_u, *normal_v, *step, *seen;
    std::size_t count;  ///< a multiple of 16
  };

  /// @param i in the order in which the lines were added, all of them before
  Neighbours neighbours(std::size_t i);

 private:
  void pad();

  std::vector<float> u_, v_, normal_u_, normal_v_, step_, seen_;
  std::size_t count_ = 0;
};

}  // namespace leap_object_tracker
