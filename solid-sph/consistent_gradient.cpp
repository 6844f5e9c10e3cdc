#include "consistent_gradient.hpp"

#include <Eigen/SparseCholesky>
#include <Eigen/SparseCore>
#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

using Vector = Eigen::VectorXd;
using Sparse = Eigen::SparseMatrix<double>;

// Outward normal times half the length of both segments at every particle of the contour.
std::vector<double> boundary_vectors(const Body& body) {
  std::vector<double> b(2 * body.size(), 0.0);
  for (const Outline& outline : body.outlines) {
    const std::size_t n = outline.particle.size();
    for (std::size_t k = 0; k < (outline.closed ? n : n - 1); ++k) {
      const std::size_t p = outline.particle[k], q = outline.particle[(k + 1) % n];
      const double tx = body.position[2 * q] - body.position[2 * p],
                   ty = body.position[2 * q + 1] - body.position[2 * p + 1];
      for (const std::size_t end : {p, q}) {
        b[2 * end] -= 0.5 * ty;
        b[2 * end + 1] += 0.5 * tx;
      }
    }
  }
  return b;
}

}  // namespace

double make_consistent(const Body& body, std::vector<GradientRow>& rows) {
  const std::size_t n = body.size();
  const double d = body.mean_spacing();
  const std::vector<double> boundary = boundary_vectors(body);
  std::vector<std::size_t> first{0};
  for (const GradientRow& row : rows) first.push_back(first.back() + row.neighbour.size());
  const auto pairs = static_cast<Eigen::Index>(first.back());
  // Rows 3i and 3i+1: moments of particle i. Row 3j+2: balance of particle j. Scaled to be without unit.
  std::vector<Eigen::Triplet<double>> entries;
  Vector scale(pairs);
  for (std::size_t i = 0; i < n; ++i) {
    double sum = 0;
    for (const double w : rows[i].weight) sum += w;
    for (std::size_t k = 0; k < rows[i].neighbour.size(); ++k) {
      const auto column = static_cast<int>(first[i] + k);
      const auto row = static_cast<int>(3 * i);
      const double share = rows[i].weight[k] / sum, volume = body.energy_volume[i] / (d * d);
      scale[column] = share;
      entries.emplace_back(row, column, rows[i].offset[k][0] / d);
      entries.emplace_back(row + 1, column, rows[i].offset[k][1] / d);
      entries.emplace_back(row + 2, column, -volume);
      entries.emplace_back(static_cast<int>(3 * rows[i].neighbour[k] + 2), column, volume);
    }
  }
  Sparse constraint(static_cast<Eigen::Index>(3 * n), pairs);
  constraint.setFromTriplets(entries.begin(), entries.end());
  // Constant fields and the area are constrained twice, so the system is singular but solvable; the shift
  // makes it definite, and repeating the solution removes what the shift changed.
  Sparse system = constraint * scale.asDiagonal() * constraint.transpose();
  Eigen::SimplicialLDLT<Sparse> solver;
  solver.setShift(1e-9);
  double worst = 0;
  for (std::size_t c = 0; c < 2; ++c) {
    Vector weights(pairs);
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < rows[i].neighbour.size(); ++k)
        weights[static_cast<Eigen::Index>(first[i] + k)] = rows[i].gradient[k][c] * d;
    Vector target = Vector::Zero(static_cast<Eigen::Index>(3 * n));
    for (std::size_t i = 0; i < n; ++i) {
      if (body.carried(i)) continue;
      target[static_cast<Eigen::Index>(3 * i + c)] = 1;
      target[static_cast<Eigen::Index>(3 * i + 2)] = boundary[2 * i + c] / d;
    }
    // Repeated, so that the solver's own accuracy does not limit the result.
    for (int round = 0; round < 6; ++round) {
      const Vector gap = target - constraint * weights;
      if (gap.lpNorm<Eigen::Infinity>() < 1e-13) break;
      if (round == 0 && c == 0) solver.compute(system);
      weights += scale.asDiagonal() * (constraint.transpose() * solver.solve(gap));
    }
    worst = std::max(worst, (target - constraint * weights).lpNorm<Eigen::Infinity>());
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t k = 0; k < rows[i].neighbour.size(); ++k)
        rows[i].gradient[k][c] = weights[static_cast<Eigen::Index>(first[i] + k)] / d;
  }
  return worst;
}

}  // namespace estuary::solid
