#include "leap_object_tracker/tracking/edge_detector.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <cstring>

namespace leap_object_tracker {
namespace {

constexpr int kReach = 2;  // [px] of the Gaussian
constexpr std::array<float, 3> kGaussian{0.402619958F, 0.244201347F, 0.054488685F};
constexpr std::array<int, 3> kGaussianOf256{104, 62, 14};

/// Index on the image of one that may lie up to its size - 1 beyond it; the border itself is not
/// repeated.
int mirrored(int index, int size) {
  if (index < 0) return -index;
  return index < size ? index : 2 * size - 2 - index;
}

/// Fills `reach` elements on both sides of `row`.
template <class T>
void mirrorEnds(T* row, int size, int reach) {
  for (int i = 1; i <= reach; ++i) {
    row[-i] = row[i];
    row[size - 1 + i] = row[size - 1 - i];
  }
}

/// To the nearest, halves to even; for numbers of less than 22 bits.
std::int16_t rounded(float value) {
  const float shifted = value + 0x1.8p23F;
  std::int32_t bits;
  std::memcpy(&bits, &shifted, sizeof bits);
  return static_cast<std::int16_t>(bits);
}

}  // namespace

void EdgeDetector::smooth(const cv::Mat& grey, float scale, ImageMemory<std::int16_t>& smoothed) {
  const int rows = grey.rows, columns = grey.cols;
  smoothed.resize(rows, columns);
  smoothed_rows_.resize(rows, columns);
  bytes_.resize(static_cast<std::size_t>(columns + 2 * kReach));
  for (int v = 0; v < rows; ++v) {
    std::uint8_t* in = bytes_.data() + kReach;
    std::copy_n(grey.ptr<std::uint8_t>(v), columns, in);
    mirrorEnds(in, columns, kReach);
    float* out = smoothed_rows_.row(v);
    for (int u = 0; u < columns; ++u)
      out[u] = scale * (kGaussian[0] * static_cast<float>(in[u]) +
                        kGaussian[1] * static_cast<float>(in[u - 1] + in[u + 1]) +
                        kGaussian[2] * static_cast<float>(in[u - 2] + in[u + 2]));
  }
  for (int v = 0; v < rows; ++v) {
    std::array<const float*, 5> in;
    for (int i = -kReach; i <= kReach; ++i)
      in[static_cast<std::size_t>(i + kReach)] = smoothed_rows_.row(mirrored(v + i, rows));
    std::int16_t* out = smoothed.row(v);
    for (int u = 0; u < columns; ++u)
      out[u] = rounded(kGaussian[0] * in[2][u] + kGaussian[1] * (in[1][u] + in[3][u]) +
                       kGaussian[2] * (in[0][u] + in[4][u]));
  }
}

void EdgeDetector::differentiate(const cv::Mat& grey, const std::uint8_t* table) {
  const int rows = grey.rows, columns = grey.cols;
  weighted_rows_.resize(rows, columns);
  stabilized_.resize(rows, columns);
  bytes_.resize(static_cast<std::size_t>(columns + 2 * kReach));
  const auto [middle, beside, outer] = kGaussianOf256;
  for (int v = 0; v < rows; ++v) {
    std::uint8_t* in = bytes_.data() + kReach;
    const auto* from = grey.ptr<std::uint8_t>(v);
    for (int u = 0; u < columns; ++u) in[u] = table[from[u]];
    mirrorEnds(in, columns, kReach);
    std::uint16_t* out = weighted_rows_.row(v);
    for (int u = 0; u < columns; ++u)
      out[u] = static_cast<std::uint16_t>(middle * in[u] + beside * (in[u - 1] + in[u + 1]) +
                                          outer * (in[u - 2] + in[u + 2]));
  }
  for (int v = 0; v < rows; ++v) {
    std::array<const std::uint16_t*, 5> in;
    for (int i = -kReach; i <= kReach; ++i)
      in[static_cast<std::size_t>(i + kReach)] = weighted_rows_.row(mirrored(v + i, rows));
    std::uint8_t* out = stabilized_.row(v);
    for (int u = 0; u < columns; ++u)
      out[u] = static_cast<std::uint8_t>((middle * in[2][u] + beside * (in[1][u] + in[3][u]) +
                                          outer * (in[0][u] + in[4][u]) + (1 << 15)) >>
                                         16);
  }

  du_.resize(rows, columns);
  dv_.resize(rows, columns);
  sums_.resize(static_cast<std::size_t>(columns + 2));
  differences_.resize(static_cast<std::size_t>(columns + 2));
  std::int16_t *sums = sums_.data() + 1, *differences = differences_.data() + 1;
  for (int v = 0; v < rows; ++v) {
    const std::uint8_t* above = stabilized_.row(mirrored(v - 1, rows));
    const std::uint8_t* here = stabilized_.row(v);
    const std::uint8_t* below = stabilized_.row(mirrored(v + 1, rows));
    for (int u = 0; u < columns; ++u) {
      sums[u] = static_cast<std::int16_t>(above[u] + 2 * here[u] + below[u]);
      differences[u] = static_cast<std::int16_t>(below[u] - above[u]);
    }
    mirrorEnds(sums, columns, 1);
    mirrorEnds(differences, columns, 1);
    std::int16_t *du = du_.row(v), *dv = dv_.row(v);
    for (int u = 0; u < columns; ++u) {
      du[u] = static_cast<std::int16_t>(sums[u + 1] - sums[u - 1]);
      dv[u] =
          static_cast<std::int16_t>(differences[u - 1] + 2 * differences[u] + differences[u + 1]);
    }
  }
}

void EdgeDetector::findEdges(float low, float high) {
  const int rows = du_.rows(), columns = du_.columns();
  squares_.resize(rows + 2, columns + 2);
  states_.resize(rows + 2, columns + 2);
  std::fill_n(states_.row(0), columns + 2, kNone);
  std::fill_n(states_.row(rows + 1), columns + 2, kNone);
  std::fill_n(squares_.row(0), columns + 2, 0);
  std::fill_n(squares_.row(rows + 1), columns + 2, 0);
  for (int v = 0; v < rows; ++v) {
    const std::int16_t *du = du_.row(v), *dv = dv_.row(v);
    std::int32_t* out = squares_.row(v + 1) + 1;
    out[-1] = out[columns] = 0;
    for (int u = 0; u < columns; ++u)
      out[u] = std::int32_t{du[u]} * du[u] + std::int32_t{dv[u]} * dv[u];
  }
  strong_.clear();
  for (int v = 0; v < rows; ++v)
    suppressNonMaxima(v, static_cast<std::int32_t>(low * low),
                      static_cast<std::int32_t>(high * high));
  follow();
}

/// Keeps what is steepest across the edge, whose direction counts in steps of 45 deg.
void EdgeDetector::suppressNonMaxima(int row, std::int32_t low, std::int32_t high) {
  constexpr std::int32_t kTangent = 13573;  // of 22.5 deg, in 1 / 2^15
  const int columns = du_.columns();
  const std::int16_t *du = du_.row(row), *dv = dv_.row(row);
  const std::int32_t* here = squares_.row(row + 1) + 1;
  const std::int32_t *above = squares_.row(row) + 1, *below = squares_.row(row + 2) + 1;
  std::uint8_t* states = states_.row(row + 1) + 1;
  states[-1] = states[columns] = kNone;
  for (int u = 0; u < columns; ++u) {
    states[u] = kNone;
    const std::int32_t square = here[u];
    if (square <= low) continue;
    const std::int32_t along_u = std::abs(du[u]), along_v = std::abs(dv[u]) * (1 << 15);
    const std::int32_t flat = along_u * kTangent, steep = flat + along_u * (1 << 16);
    bool largest = false;
    if (along_v < flat) {
      largest = square > here[u - 1] && square >= here[u + 1];
    } else if (along_v > steep) {
      largest = square > above[u] && square >= below[u];
    } else {
      const int side = (du[u] ^ dv[u]) < 0 ? -1 : 1;
      largest = square > above[u - side] && square > below[u + side];
    }
    if (!largest) continue;
    states[u] = square > high ? kEdge : kWeak;
    if (square > high) strong_.push_back(states + u);
  }
}

/// Weak edges beside edges are edges.
void EdgeDetector::follow() {
  const int stride = states_.columns();
  const std::array<int, 8> neighbours{-stride - 1, -stride,    -stride + 1, -1,
                                      1,           stride - 1, stride,      stride + 1};
  while (!strong_.empty()) {
    std::uint8_t* edge = strong_.back();
    strong_.pop_back();
    for (const int offset : neighbours) {
      if (edge[offset] != kWeak) continue;
      edge[offset] = kEdge;
      strong_.push_back(edge + offset);
    }
  }
}

}  // namespace leap_object_tracker
