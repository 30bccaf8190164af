#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "leap_object_tracker/geometry/object_model.hpp"

namespace leap_object_tracker {

/// A short piece of visible contour in the object frame.
struct ContourPoint {
  Eigen::Vector3f position;  ///< [m]
  Eigen::Vector3f tangent;   ///< unit vector along the contour
  Eigen::Vector3f outward;  ///< off the body, where only one side of the contour is body; else zero
  float length = 0;         ///< [m] of contour that the point stands for
  /// [m] radius of curvature across the contour where a curved surface turns away, 0 at an edge of
  /// the body.
  float limb = 0;
  float inner = 0;  ///< 1 where an outline lies before another part of the body
  /// Unit normals of the faces that the eye sees, the first on the side of tangent x normal; zero
  /// where there is none or where the surface is curved.
  std::array<Eigen::Vector3f, 2> faces{Eigen::Vector3f::Zero(), Eigen::Vector3f::Zero()};
  /// Unit normal of the face that an outline at a rounded edge hides; else zero.
  Eigen::Vector3f hidden = Eigen::Vector3f::Zero();

  bool outline() const { return outward.squaredNorm() > 0.5F; }
};

/// What of the contour one view shows, hidden lines left out.
struct ContourView {
  /// Points for scoring, one array a coordinate: x y z [m] and the tangent times the length [m].
  /// Each array has ContourModel::points() entries (a multiple of 16, padded with zero tangents),
  /// in such an order that the first 16, 32 ... are an even sample of all.
  std::vector<float> arrays;
  /// Points for refinement, about twice as dense.
  std::vector<ContourPoint> points;
};

/// Which view a pose shows, and how to turn the object first: the views of a cylinder are stored
/// for one direction only.
struct ViewChoice {
  const ContourView* view = nullptr;  ///< nullptr: the eye is inside the body
  float cosine = 1, sine = 0;         ///< of the turn about the object's z axis
};

/// The visible contour of an object from anywhere outside of it.
///
/// Convex polyhedra: exact, one view for each set of faces that look at the eye. Cylinder: exact
/// but for the places of the two limbs, which are stored in steps of 2 deg (their images move by
/// the square of that). Meshes: a view sphere of 642 directions times four to six distances, hidden
/// lines removed by casting rays; outlines, self-occlusions and creases sharper than 30 deg.
class ContourModel {
 public:
  /// @param points scored a view, rounded up to a multiple of 16
  /// @param edge_radius [m] of the rounding of a primitive's edges: no body is sharp
  /// @param cache_folder where the views of meshes are kept between runs; empty: nowhere
  ContourModel(const ObjectModel& object, int points, double edge_radius = 0,
               const std::string& cache_folder = "");
  ~ContourModel();
  ContourModel(ContourModel&&) noexcept;

  /// @param eye_in_object place of the eye [m]
  ViewChoice choose(const Eigen::Vector3f& eye_in_object) const;

  /// The view from exactly this place, where choose() only knows one from nearby: of meshes. About
  /// 1 ms for some thousand triangles. Nothing for shapes whose views are exact anyway.
  std::optional<ContourView> exactView(const Eigen::Vector3d& eye_in_object) const;

  /// Entries of each array of a view.
  int points() const { return points_; }
  /// Largest distance of the surface from the origin [m].
  double radius() const { return radius_; }
  int viewCount() const;

  class Table;  ///< how views are stored, one kind a family of shapes

 private:
  int points_;
  double radius_;
  std::unique_ptr<Table> table_;
};

}  // namespace leap_object_tracker
