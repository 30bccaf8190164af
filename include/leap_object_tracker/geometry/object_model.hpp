#pragma once

#include <optional>
#include <string>

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/geometry/symmetry.hpp"

namespace leap_object_tracker {

enum class Shape { kBox, kCylinder, kPrism, kMesh };

/// What is tracked: a rigid body with its frame (README, "Objects").
struct ObjectModel {
  std::string name;
  Shape shape = Shape::kBox;
  Eigen::Vector3d size = Eigen::Vector3d::Zero();  ///< [m] box: x y z; cylinder: radius height -;
                                                   ///< prism: side height -; mesh: zero
  Mesh mesh;                                       ///< always filled
  Symmetry symmetry;
  std::optional<bool> textured;  ///< whether its surface carries a texture; nothing: to be seen
  std::string mesh_path;         ///< absolute; empty for primitives
};

/// Reads an object file (README, "Objects").
/// @throw std::runtime_error naming the file, the key and what is allowed.
ObjectModel loadObject(const std::string& path);

/// A primitive with its own symmetry. @throw std::invalid_argument for sizes that are not positive.
ObjectModel makePrimitive(const std::string& name, Shape shape, const Eigen::Vector3d& size);

}  // namespace leap_object_tracker
