#pragma once

#include <cstddef>
#include <opencv2/core.hpp>

#include "leap_object_tracker/tracking/edge_field.hpp"

namespace leap_object_tracker {

/// Grey values of a field at sub-pixel places of the whole image.
template <class Value>
class Sampler {
 public:
  Sampler(const EdgeField& field, const cv::Mat& image, float scale)
      : first_(image.ptr<Value>()),
        stride_(static_cast<std::ptrdiff_t>(image.step1())),
        scale_(scale),
        u0_(static_cast<float>(field.region().x)),
        v0_(static_cast<float>(field.region().y)),
        last_u_(static_cast<float>(image.cols - 1)),
        last_v_(static_cast<float>(image.rows - 1)) {}

  bool contains(float u, float v) const {
    return u >= u0_ && v >= v0_ && u < u0_ + last_u_ && v < v0_ + last_v_;
  }

  /// Bilinear, in 8-bit grey levels; the place must be contained.
  float operator()(float u, float v) const {
    const float x = u - u0_, y = v - v0_;
    const int column = static_cast<int>(x), row = static_cast<int>(y);
    const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
    const Value *top = first_ + row * stride_ + column, *bottom = top + stride_;
    const float upper = static_cast<float>(top[0]) + fx * static_cast<float>(top[1] - top[0]);
    const float lower =
        static_cast<float>(bottom[0]) + fx * static_cast<float>(bottom[1] - bottom[0]);
    return (upper + fy * (lower - upper)) * scale_;
  }

 private:
  const Value* first_;
  std::ptrdiff_t stride_;
  float scale_;
  float u0_, v0_, last_u_, last_v_;
};

}  // namespace leap_object_tracker
