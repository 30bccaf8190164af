#pragma once

#include <memory>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"
#include "leap_object_tracker/tracking/contour_model.hpp"

namespace leap_object_tracker {

/// Contours of a mesh from a sphere of directions, at several distances.
struct MeshViews {
  std::vector<Eigen::Vector3f> directions;  ///< unit vectors from the object's origin to the eye
  std::vector<float> shell_limits;          ///< [m] limits between the distances, ascending
  float nearest = 0;                        ///< [m] closer than this no view is known
  std::vector<ContourView> views;           ///< shell by shell, all directions of a shell together
};

/// Finds outlines, self-occlusions and creases sharper than 30 deg that are visible from each
/// place, by casting rays. Uses all cores.
/// @param cache_folder where the result is kept, named by its content; empty: nowhere. A folder
/// that cannot be written to, or a damaged file in it, is ignored.
MeshViews makeMeshViews(const Mesh& mesh, int points, const std::string& cache_folder);

/// The visible contour of a mesh from one place, computed then and there.
class MeshContour {
 public:
  explicit MeshContour(const Mesh& mesh);
  ~MeshContour();

  /// @param eye [m] in the object frame; views.points is empty from inside the body
  ContourView viewFrom(const Eigen::Vector3d& eye, int points) const;

 private:
  class Finder;
  std::unique_ptr<Finder> finder_;
};

}  // namespace leap_object_tracker
