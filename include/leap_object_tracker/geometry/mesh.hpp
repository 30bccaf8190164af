#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace leap_object_tracker {

/// Triangles in the object frame, counter-clockwise seen from outside.
struct Mesh {
  std::vector<Eigen::Vector3d> vertices;                ///< [m]
  std::vector<std::array<std::uint32_t, 3>> triangles;  ///< indices into vertices
};

/// Box centred on the origin. @param size x, y, z [m]
Mesh makeBox(const Eigen::Vector3d& size);
/// Cylinder centred on the origin, axis along z. @param radius, height [m]
Mesh makeCylinder(double radius, double height, int segments = 96);
/// Equilateral prism: centroid of the triangle at half height in the origin, apex towards +y, axis
/// along z. @param side, height [m]
Mesh makePrism(double side, double height);

/// Reads OBJ, STL, PLY or DAE; equal vertices are joined, degenerate triangles left out.
/// @param scale metres per unit of the file
/// @throw std::runtime_error naming the file and what is wrong with it.
Mesh loadMesh(const std::string& path, double scale);

/// Largest distance of a vertex from the origin [m].
double radiusOf(const Mesh& mesh);
/// Largest distance between two vertices [m], searched over 256 directions (short by 0.3 % at
/// most).
double diameterOf(const Mesh& mesh);

/// Direction i of `count` that are spread evenly over the sphere (Fibonacci lattice).
Eigen::Vector3d evenDirection(int i, int count);
/// About `count` points spread evenly over the surface [m] (low-discrepancy sequence R2, Roberts
/// 2018); none if it has no area.
std::vector<Eigen::Vector3d> pointsOn(const Mesh& mesh, int count);

/// Area of the shadow that a body throws in parallel light [m^2], over directions all around.
struct ShadowArea {
  double least = 0, mean = 0, largest = 0;
};
/// To about 5 %, from points on the surface.
ShadowArea shadowAreaOf(const Mesh& mesh);

}  // namespace leap_object_tracker
