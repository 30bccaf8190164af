#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "leap_object_tracker/geometry/mesh.hpp"

namespace leap_object_tracker {

/// Says whether a line of sight is free of a mesh. A tree of boxes, eight children a node, split at
/// medians; as many boxes or triangles are looked at together as the processor can.
class SightLines {
 public:
  explicit SightLines(const Mesh& mesh);

  /// @param from, to [m]
  /// @param last what blocked the line before, which is likely to block this one as well; any
  /// number at first
  bool blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to, std::uint32_t& last) const;

  static constexpr std::size_t kWidth = 8;
  static constexpr std::uint32_t kLeaf = 1U << 31;
  /// Three coordinates [m] of eight things.
  struct alignas(32) Vectors {
    float at[3][kWidth] = {};
  };
  struct Node {
    Vectors low, high;
    /// Nodes or, from kLeaf on, leaves; zero, which is nobody's child: none.
    std::array<std::uint32_t, kWidth> children{};
  };
  /// Triangles by a corner and two sides; without extent where there is none.
  struct Leaf {
    Vectors corner, first, second;
  };

 private:
  struct Range {
    std::size_t begin, end;
    std::size_t size() const { return end - begin; }
  };
  struct Triangle {
    Eigen::Vector3f corner, first, second, center;
  };
  std::size_t split(const Range& range);
  void cut(const Range& range, int times, std::vector<Range>& parts);
  std::uint32_t build(const Range& range);
  void setBox(const Range& range, std::size_t child, Node& node) const;
  std::uint32_t addLeaf(const Range& range);

  std::vector<Triangle> triangles_;   ///< while the tree is built
  std::vector<std::uint32_t> order_;  ///< the same
  std::vector<Node> nodes_;
  std::vector<Leaf> leaves_;
};

}  // namespace leap_object_tracker
