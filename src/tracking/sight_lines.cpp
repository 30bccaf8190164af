#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "tracking/sight_lines.cpp"
#include <hwy/foreach_target.h>
// Highway wants its own header after foreach_target.h.
#include <hwy/highway.h>

#include "tracking/sight_lines.hpp"

HWY_BEFORE_NAMESPACE();
namespace leap_object_tracker {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Floats = hn::CappedTag<float, SightLines::kWidth>;
using Float = hn::Vec<Floats>;

struct Vector {
  Float x, y, z;
};

HWY_INLINE Vector load(const SightLines::Vectors& vectors, std::size_t i) {
  const Floats df;
  return {hn::Load(df, vectors.at[0] + i), hn::Load(df, vectors.at[1] + i),
          hn::Load(df, vectors.at[2] + i)};
}
HWY_INLINE Vector everywhere(const Eigen::Vector3f& v) {
  const Floats df;
  return {hn::Set(df, v.x()), hn::Set(df, v.y()), hn::Set(df, v.z())};
}
HWY_INLINE Vector minus(const Vector& a, const Vector& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Vector cross(const Vector& a, const Vector& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
          hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE Float dot(const Vector& a, const Vector& b) {
  return hn::Add(hn::Mul(a.x, b.x), hn::Add(hn::Mul(a.y, b.y), hn::Mul(a.z, b.z)));
}

/// Möller and Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
HWY_INLINE bool hits(const SightLines::Leaf& leaf, const Vector& from, const Vector& way) {
  const Floats df;
  const auto zero = hn::Zero(df), one = hn::Set(df, 1.0F);
  for (std::size_t i = 0; i < SightLines::kWidth; i += hn::Lanes(df)) {
    const Vector first = load(leaf.first, i), second = load(leaf.second, i);
    const Vector p = cross(way, second);
    const auto determinant = dot(first, p);
    const Vector offset = minus(from, load(leaf.corner, i));
    const auto u = hn::Div(dot(offset, p), determinant);
    const Vector q = cross(offset, first);
    const auto v = hn::Div(dot(way, q), determinant);
    const auto along = hn::Div(dot(second, q), determinant);
    const auto inside = hn::And(hn::And(hn::Ge(u, zero), hn::Ge(v, zero)),
                                hn::And(hn::Le(hn::Add(u, v), one), hn::Ne(determinant, zero)));
    const auto between = hn::And(hn::Gt(along, zero), hn::Lt(along, one));
    if (!hn::AllFalse(df, hn::And(inside, between))) return true;
  }
  return false;
}

/// @return a bit for each child
HWY_INLINE std::uint32_t crossedBoxes(const SightLines::Node& node, const Vector& from,
                                      const Vector& inverse) {
  const Floats df;
  std::uint32_t crossed = 0;
  for (std::size_t i = 0; i < SightLines::kWidth; i += hn::Lanes(df)) {
    const Vector low = minus(load(node.low, i), from), high = minus(load(node.high, i), from);
    auto near = hn::Zero(df), far = hn::Set(df, 1.0F);
    const auto narrow = [&](Float a, Float b, Float factor) HWY_ATTR {
      a = hn::Mul(a, factor), b = hn::Mul(b, factor);
      near = hn::Max(near, hn::Min(a, b));
      far = hn::Min(far, hn::Max(a, b));
    };
    narrow(low.x, high.x, inverse.x);
    narrow(low.y, high.y, inverse.y);
    narrow(low.z, high.z, inverse.z);
    std::uint8_t bits[8] = {};
    hn::StoreMaskBits(df, hn::Le(near, far), bits);
    crossed |= std::uint32_t{bits[0]} << i;
  }
  return crossed;
}

bool isBlocked(const std::vector<SightLines::Node>& nodes,
               const std::vector<SightLines::Leaf>& leaves, const Eigen::Vector3f& start,
               const Eigen::Vector3f& to, std::uint32_t& last) {
  const Eigen::Vector3f line = to - start;
  const Vector from = everywhere(start), way = everywhere(line);
  if (last < leaves.size() && hits(leaves[last], from, way)) return true;
  Eigen::Vector3f factors;
  for (int axis = 0; axis < 3; ++axis)
    factors[axis] = line[axis] != 0 ? 1 / line[axis] : std::numeric_limits<float>::max();
  const Vector inverse = everywhere(factors);
  std::array<std::uint32_t, 256> waiting;
  std::size_t count = 0;
  waiting[count++] = 0;
  while (count > 0) {
    const SightLines::Node& node = nodes[waiting[--count]];
    for (std::uint32_t crossed = crossedBoxes(node, from, inverse); crossed != 0;
         crossed &= crossed - 1) {
      const std::uint32_t index = node.children[hwy::Num0BitsBelowLS1Bit_Nonzero32(crossed)];
      if (index == 0) continue;
      if (index < SightLines::kLeaf) {
        waiting[count++] = index;
      } else if (hits(leaves[index - SightLines::kLeaf], from, way)) {
        last = index - SightLines::kLeaf;
        return true;
      }
    }
  }
  return false;
}

}  // namespace HWY_NAMESPACE
}  // namespace leap_object_tracker
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <algorithm>
#include <numeric>

namespace leap_object_tracker {

HWY_EXPORT(isBlocked);

SightLines::SightLines(const Mesh& mesh) {
  for (const auto& t : mesh.triangles) {
    Triangle triangle;
    triangle.corner = mesh.vertices[t[0]].cast<float>();
    triangle.first = (mesh.vertices[t[1]] - mesh.vertices[t[0]]).cast<float>();
    triangle.second = (mesh.vertices[t[2]] - mesh.vertices[t[0]]).cast<float>();
    triangle.center = triangle.corner + (triangle.first + triangle.second) / 3;
    triangles_.push_back(triangle);
  }
  order_.resize(triangles_.size());
  std::iota(order_.begin(), order_.end(), 0U);
  if (!order_.empty()) build({0, order_.size()});
  triangles_ = {};
  order_ = {};
}

bool SightLines::blocked(const Eigen::Vector3f& from, const Eigen::Vector3f& to,
                         std::uint32_t& last) const {
  return !nodes_.empty() && HWY_DYNAMIC_DISPATCH(isBlocked)(nodes_, leaves_, from, to, last);
}

/// Sorts a range into halves along the longest side of the centres' box. @return the middle
std::size_t SightLines::split(const Range& range) {
  Eigen::Vector3f least = triangles_[order_[range.begin]].center, most = least;
  for (std::size_t i = range.begin; i < range.end; ++i) {
    least = least.cwiseMin(triangles_[order_[i]].center);
    most = most.cwiseMax(triangles_[order_[i]].center);
  }
  Eigen::Index axis = 0;
  (most - least).maxCoeff(&axis);
  const std::size_t middle = (range.begin + range.end) / 2;
  const auto at = [&](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(range.begin), at(middle), at(range.end),
                   [&](std::uint32_t a, std::uint32_t b) {
                     const float left = triangles_[a].center[axis];
                     const float right = triangles_[b].center[axis];
                     return left != right ? left < right : a < b;
                   });
  return middle;
}

void SightLines::cut(const Range& range, int times, std::vector<Range>& parts) {
  if (times == 0 || range.size() <= kWidth) {
    parts.push_back(range);
    return;
  }
  const std::size_t middle = split(range);
  cut({range.begin, middle}, times - 1, parts);
  cut({middle, range.end}, times - 1, parts);
}

/// @return index of the node
std::uint32_t SightLines::build(const Range& range) {
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  std::vector<Range> parts;
  cut(range, 3, parts);
  Node node;
  for (std::size_t child = 0; child < parts.size(); ++child) {
    setBox(parts[child], child, node);
    node.children[child] =
        parts[child].size() > kWidth ? build(parts[child]) : kLeaf + addLeaf(parts[child]);
  }
  nodes_[index] = node;
  return index;
}

void SightLines::setBox(const Range& range, std::size_t child, Node& node) const {
  Eigen::Vector3f low = triangles_[order_[range.begin]].corner, high = low;
  for (std::size_t i = range.begin; i < range.end; ++i) {
    const Triangle& t = triangles_[order_[i]];
    for (const Eigen::Vector3f& corner :
         {t.corner, Eigen::Vector3f(t.corner + t.first), Eigen::Vector3f(t.corner + t.second)}) {
      low = low.cwiseMin(corner);
      high = high.cwiseMax(corner);
    }
  }
  // Flat boxes would miss rays in their plane by rounding.
  const float margin = 1e-6F * low.cwiseAbs().cwiseMax(high.cwiseAbs()).maxCoeff();
  for (int axis = 0; axis < 3; ++axis) {
    node.low.at[axis][child] = low[axis] - margin;
    node.high.at[axis][child] = high[axis] + margin;
  }
}

std::uint32_t SightLines::addLeaf(const Range& range) {
  Leaf leaf;
  for (std::size_t i = range.begin; i < range.end; ++i)
    for (int axis = 0; axis < 3; ++axis) {
      const Triangle& t = triangles_[order_[i]];
      leaf.corner.at[axis][i - range.begin] = t.corner[axis];
      leaf.first.at[axis][i - range.begin] = t.first[axis];
      leaf.second.at[axis][i - range.begin] = t.second[axis];
    }
  leaves_.push_back(leaf);
  return static_cast<std::uint32_t>(leaves_.size() - 1);
}

}  // namespace leap_object_tracker
#endif
