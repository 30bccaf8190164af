#pragma once

#include <Eigen/Dense>
#include <array>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"

namespace leap_object_tracker {

/// Distance [m] of a point from the surface of a body, negative inside. Exact for box, cylinder and
/// prism; from a grid, interpolated, for a mesh.
class SignedDistance {
 public:
  /// Grid cells along the longest side of a mesh.
  static constexpr int kGridCells = 64;

  explicit SignedDistance(const ObjectModel& object);

  float operator()(const Eigen::Vector3f& point_in_object) const;

  /// @param gradient unit vector away from the body
  float operator()(const Eigen::Vector3f& point_in_object, Eigen::Vector3f& gradient) const;

  Shape shape() const { return shape_; }
  /// [m] Half of ObjectModel::size.
  const Eigen::Vector3f& half() const { return half_; }

 private:
  void buildGrid(const Mesh& mesh);
  float gridDistance(const Eigen::Vector3f& point) const;

  Shape shape_;
  Eigen::Vector3f half_ = Eigen::Vector3f::Zero();         ///< [m] box: half sizes; else see .cpp
  Eigen::Vector3f grid_origin_ = Eigen::Vector3f::Zero();  ///< [m]
  float cell_ = 0;                                         ///< [m]
  std::array<int, 3> cells_{};
  std::vector<float> grid_;  ///< [m] at the nodes, x runs fastest
};

}  // namespace leap_object_tracker
