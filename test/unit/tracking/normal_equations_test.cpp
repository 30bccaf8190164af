#include "tracking/normal_equations.hpp"

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <random>

namespace leap_object_tracker {
namespace {

constexpr std::size_t kMost = 9;
using Equations = NormalEquations<kMost>;

Equations factorized(const Eigen::MatrixXd& matrix) {
  Equations equations(static_cast<std::size_t>(matrix.rows()));
  for (Eigen::Index row = 0; row < matrix.rows(); ++row)
    for (Eigen::Index column = 0; column <= row; ++column)
      equations.at(static_cast<std::size_t>(row), static_cast<std::size_t>(column)) =
          matrix(row, column);
  equations.factorize();
  return equations;
}

Equations::Vector padded(const Eigen::VectorXd& vector) {
  Equations::Vector result{};
  std::copy(vector.begin(), vector.end(), result.begin());
  return result;
}

Eigen::VectorXd solved(const Equations& equations, const Eigen::VectorXd& right) {
  const auto x = equations.solve(padded(right));
  return Eigen::Map<const Eigen::VectorXd>(x.data(), right.size());
}

Eigen::MatrixXd randomMatrix(Eigen::Index rows, Eigen::Index columns, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, 1);
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return normal(random); });
}

TEST(NormalEquations, areSolvedAsByEigen) {
  for (Eigen::Index size = 1; size <= static_cast<Eigen::Index>(kMost); ++size) {
    const Eigen::MatrixXd basis = randomMatrix(15, size, static_cast<unsigned>(size));
    const Eigen::MatrixXd matrix = basis.transpose() * basis;
    const Eigen::VectorXd right = randomMatrix(size, 1, 77);
    const Eigen::VectorXd expected = matrix.ldlt().solve(right);
    const Equations equations = factorized(matrix);
    EXPECT_LT((solved(equations, right) - expected).norm(), 1e-11 * expected.norm());
    EXPECT_NEAR(equations.inverseForm(padded(right)), right.dot(expected),
                1e-11 * right.dot(expected));
  }
}

TEST(NormalEquations, giveTheInverseFormOfTheLastUnknownsAlone) {
  const Eigen::MatrixXd basis = randomMatrix(15, 7, 1);
  const Eigen::MatrixXd matrix = basis.transpose() * basis;
  Eigen::VectorXd x = Eigen::VectorXd::Zero(7);
  x.tail<3>() << -1, 1, 0.3;
  const double expected = x.dot(matrix.ldlt().solve(x));
  EXPECT_NEAR(factorized(matrix).inverseForm(padded(x), 4), expected, 1e-12 * expected);
}

/// As profiles with close neighbours are: columns nearly alike, bound by little more than rounding.
TEST(NormalEquations, areSolvedAsByEigenWhereNearlySingular) {
  Eigen::MatrixXd basis = randomMatrix(15, 6, 2);
  basis.col(4) = basis.col(1) + 1e-3 * basis.col(4);
  basis.col(5) = basis.col(0) - basis.col(2);
  Eigen::MatrixXd matrix = basis.transpose() * basis;
  matrix.diagonal().array() += 4e-6;
  const Eigen::VectorXd right = basis.transpose() * randomMatrix(15, 1, 3);
  const Eigen::VectorXd expected = matrix.ldlt().solve(right);
  EXPECT_LT((solved(factorized(matrix), right) - expected).norm(), 1e-7 * expected.norm());
}

TEST(NormalEquations, ofSingularMatricesHaveAFiniteSolution) {
  Eigen::MatrixXd basis = randomMatrix(15, 6, 4);
  basis.col(3) = basis.col(1);
  basis.col(5).setZero();
  const Eigen::VectorXd values = randomMatrix(15, 1, 5);
  const Eigen::MatrixXd matrix = basis.transpose() * basis;
  const Equations equations = factorized(matrix);
  const Eigen::VectorXd x = solved(equations, basis.transpose() * values);
  ASSERT_TRUE(x.allFinite());
  // Of least squares all the same: what is left is across the columns.
  EXPECT_LT((basis.transpose() * (values - basis * x)).norm(), 1e-4 * values.norm());
  Eigen::VectorXd open = Eigen::VectorXd::Zero(6);
  open[3] = 1;
  EXPECT_GT(equations.inverseForm(padded(open)), 1e9) << "nothing binds it";
  // One that rounding has made indefinite.
  Eigen::MatrixXd indefinite = matrix;
  indefinite(3, 3) -= 1e-7;
  EXPECT_TRUE(solved(factorized(indefinite), basis.transpose() * values).allFinite());
}

}  // namespace
}  // namespace leap_object_tracker
