#include "reproducing_weights.hpp"

#include <Eigen/Dense>
#include <stdexcept>

namespace estuary::solid {
namespace {

using Matrix = Eigen::MatrixXd;

// Singular values below this share of the largest count as "the points cannot tell".
constexpr double kResolved = 1e-3;

// Minimum-norm solution in the scaled unknowns: `exact` a = `exact_target` holds, `desired` a = 0 as far as
// possible. Rows are moments, columns are points; the result has one column per column of `exact_target`.
struct Solution {
  Matrix weights;
  bool complete = true;
};

Solution solve(const Matrix& exact, const Matrix& exact_target, const Matrix& desired,
               std::span<const double> weights) {
  const Eigen::Index points = exact.cols();
  Eigen::VectorXd scale(points);
  for (Eigen::Index j = 0; j < points; ++j) scale[j] = std::sqrt(weights[j]);
  const Matrix scaled_exact = exact * scale.asDiagonal();
  const Eigen::ColPivHouseholderQR<Matrix> qr(scaled_exact.transpose());
  Eigen::ColPivHouseholderQR<Matrix> rank_revealing = qr;
  rank_revealing.setThreshold(1e-9);
  if (points < exact.rows() || rank_revealing.rank() < exact.rows())
    throw std::domain_error("neighbouring particles do not span the plane");
  const Eigen::CompleteOrthogonalDecomposition<Matrix> decomposition(scaled_exact);
  Matrix y = decomposition.solve(exact_target);
  Solution solution;
  if (desired.rows() > 0) {
    const Eigen::Index free = points - exact.rows();
    if (free > 0) {
      const Matrix q = qr.householderQ() * Matrix::Identity(points, points);
      const Matrix null_space = q.rightCols(free);
      const Matrix scaled_desired = desired * scale.asDiagonal();
      Eigen::JacobiSVD<Matrix> svd(scaled_desired * null_space, Eigen::ComputeThinU | Eigen::ComputeThinV);
      // Compared with the moments themselves, not with each other: one that vanishes on the null space is not
      // resolved.
      const double largest = scaled_desired.norm();
      const Matrix gap = scaled_desired * y;
      Matrix z = Matrix::Zero(free, y.cols());
      Eigen::Index resolved = 0;
      for (Eigen::Index k = 0; k < svd.singularValues().size(); ++k) {
        if (svd.singularValues()[k] < kResolved * largest) continue;
        ++resolved;
        z -= svd.matrixV().col(k) * (svd.matrixU().col(k).transpose() * gap) / svd.singularValues()[k];
      }
      y += null_space * z;
      solution.complete = resolved == desired.rows();
    } else {
      solution.complete = false;
    }
  }
  solution.weights = scale.asDiagonal() * y;
  return solution;
}

Matrix quadratic_moments(std::span<const Offset> offsets, Order order) {
  if (order == Order::linear) return Matrix(0, static_cast<Eigen::Index>(offsets.size()));
  Matrix m(3, offsets.size());
  for (std::size_t j = 0; j < offsets.size(); ++j)
    m.col(j) << offsets[j].x * offsets[j].x, offsets[j].x * offsets[j].y, offsets[j].y * offsets[j].y;
  return m;
}

}  // namespace

std::vector<double> value_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                  Curvature curvature, Offset tangent) {
  Matrix exact(3, offsets.size());
  for (std::size_t j = 0; j < offsets.size(); ++j) exact.col(j) << 1, offsets[j].x, offsets[j].y;
  Matrix target = Matrix::Zero(3, 1);
  target(0, 0) = 1;
  Matrix desired = quadratic_moments(offsets, curvature == Curvature::all ? Order::quadratic : Order::linear);
  if (curvature == Curvature::tangential) {
    desired.resize(1, offsets.size());
    for (std::size_t j = 0; j < offsets.size(); ++j)
      desired(0, j) = std::pow(offsets[j].x * tangent.x + offsets[j].y * tangent.y, 2);
  }
  const Solution solution = solve(exact, target, desired, weights);
  return {solution.weights.data(), solution.weights.data() + solution.weights.rows()};
}

std::vector<double> value_weights_on_line(std::span<const Offset> offsets, std::span<const double> weights,
                                          Offset tangent) {
  Matrix exact(2, offsets.size());
  for (std::size_t j = 0; j < offsets.size(); ++j)
    exact.col(j) << 1, offsets[j].x * tangent.x + offsets[j].y * tangent.y;
  Matrix target = Matrix::Zero(2, 1);
  target(0, 0) = 1;
  const Solution solution = solve(exact, target, quadratic_moments(offsets, Order::linear), weights);
  return {solution.weights.data(), solution.weights.data() + solution.weights.rows()};
}

GradientWeights gradient_weights(std::span<const Offset> offsets, std::span<const double> weights,
                                 Order order) {
  Matrix exact(2, offsets.size());
  for (std::size_t j = 0; j < offsets.size(); ++j) exact.col(j) << offsets[j].x, offsets[j].y;
  const Solution solution = solve(exact, Matrix::Identity(2, 2), quadratic_moments(offsets, order), weights);
  GradientWeights result;
  result.complete = solution.complete;
  for (Eigen::Index j = 0; j < solution.weights.rows(); ++j)
    result.weights.push_back({solution.weights(j, 0), solution.weights(j, 1)});
  return result;
}

}  // namespace estuary::solid
