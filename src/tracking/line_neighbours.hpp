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
  /// @param length [px]
  void add(float u, float v, float normal_u, float normal_v, float step, float length);

  /// What runs beside a line of the same direction, by distances along its normal.
  struct Neighbours {
    float before, after;      ///< [px] to the next lines on both sides, at most kFarthest
    float same, same_moment;  ///< steps of the lines on its place, and times their distances
    float near, near_moment;  ///< the same of all that blur together with it, by how much they do
    float own, all;           ///< [px] length of the line itself and of all not told apart from it
  };
  static constexpr float kFarthest = 16;    // [px]
  static constexpr float kSameLine = 0.7F;  // [px]

  struct Arrays {
    const float *u, *v, *normal_u, *normal_v, *step, *length;
    std::size_t count;  ///< a multiple of 16
  };

  /// @param i in the order in which the lines were added, all of them before
  Neighbours neighbours(std::size_t i);

 private:
  void pad();

  std::vector<float> u_, v_, normal_u_, normal_v_, step_, length_;
  std::size_t count_ = 0;
};

}  // namespace leap_object_tracker
