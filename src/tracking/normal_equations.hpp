#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace leap_object_tracker {

/// Symmetric positive definite equations A x = b of few unknowns, by Cholesky's factors A = L L'.
template <std::size_t kMost>
class NormalEquations {
 public:
  using Vector = std::array<double, kMost>;

  /// @param size unknowns, at most kMost
  explicit NormalEquations(std::size_t size) : size_(size) {}

  /// Of A, column <= row; all of them are to be set.
  double& at(std::size_t row, std::size_t column) { return factor_[row][column]; }

  /// To be called once A is filled in. What rounding makes of a singular matrix is not let below
  /// its own size: unknowns that the equations leave open stay finite.
  void factorize() {
    for (std::size_t row = 0; row < size_; ++row) {
      Vector& l = factor_[row];
      for (std::size_t column = 0; column < row; ++column)
        l[column] = (l[column] - dot(l, factor_[column], 0, column)) * inverse_[column];
      const double least = kRounding * l[row] + kSmallest;
      inverse_[row] = 1 / std::sqrt(std::max(l[row] - dot(l, l, 0, row), least));
    }
  }

  Vector solve(const Vector& right) const {
    Vector x;
    substitute(right, 0, x);
    for (std::size_t row = size_; row-- > 0;) {
      x[row] *= inverse_[row];
      for (std::size_t i = 0; i < row; ++i) x[i] -= factor_[row][i] * x[row];
    }
    return x;
  }

  /// x' A^-1 x. @param first from which on x is not zero; cheap for the last ones
  double inverseForm(const Vector& x, std::size_t first = 0) const {
    Vector y;
    substitute(x, first, y);
    return dot(y, y, first, size_);
  }

 private:
  static constexpr double kRounding = 1e-12;  // of the diagonal
  static constexpr double kSmallest = 1e-30;

  static double dot(const Vector& a, const Vector& b, std::size_t from, std::size_t to) {
    double sum = 0;
    for (std::size_t i = from; i < to; ++i) sum += a[i] * b[i];
    return sum;
  }

  /// L^-1 right, from the first unknown that is not zero on.
  void substitute(const Vector& right, std::size_t first, Vector& x) const {
    for (std::size_t row = first; row < size_; ++row)
      x[row] = (right[row] - dot(factor_[row], x, first, row)) * inverse_[row];
  }

  std::size_t size_;
  std::array<Vector, kMost> factor_;  ///< below the diagonal
  Vector inverse_;                    ///< of the diagonal
};

}  // namespace leap_object_tracker
