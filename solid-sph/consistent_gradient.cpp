#include "consistent_gradient.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "sparse_solver.hpp"

namespace estuary::solid {
namespace {

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

// The conditions on the weights, without unit. Rows 3i and 3i+1: moments of particle i. Row 3j+2: balance of
// particle j. Every weight, that of pair k of particle i, enters four of them.
class Conditions {
public:
  Conditions(const Body& body, const std::vector<GradientRow>& rows) : particles_(body.size()) {
    const double d = body.mean_spacing();
    for (std::size_t i = 0; i < particles_; ++i) {
      double sum = 0;
      for (const double w : rows[i].weight) sum += w;
      const double volume = body.energy_volume[i] / (d * d);
      for (std::size_t k = 0; k < rows[i].neighbour.size(); ++k) {
        row_.push_back({3 * i, 3 * i + 1, 3 * i + 2, std::size_t{3} * rows[i].neighbour[k] + 2});
        factor_.push_back({rows[i].offset[k][0] / d, rows[i].offset[k][1] / d, -volume, volume});
        share_.push_back(rows[i].weight[k] / sum);
      }
    }
  }
  [[nodiscard]] std::size_t weights() const { return row_.size(); }
  /// target - A weights
  [[nodiscard]] std::vector<double> gap(const std::vector<double>& target,
                                        const std::vector<double>& weights) const {
    std::vector<double> result = target;
    for (std::size_t pair = 0; pair < row_.size(); ++pair)
      for (std::size_t e = 0; e < 4; ++e) result[row_[pair][e]] -= factor_[pair][e] * weights[pair];
    return result;
  }
  /// Adds S A^T multiplier, S the shares of the kernel weights.
  void correct(std::vector<double>& weights, const std::vector<double>& multiplier) const {
    for (std::size_t pair = 0; pair < row_.size(); ++pair) {
      double sum = 0;
      for (std::size_t e = 0; e < 4; ++e) sum += factor_[pair][e] * multiplier[row_[pair][e]];
      weights[pair] += share_[pair] * sum;
    }
  }
  /// A S A^T
  [[nodiscard]] SparseMatrix system() const {
    std::vector<SparseEntry> entries;
    entries.reserve(16 * row_.size());
    for (std::size_t pair = 0; pair < row_.size(); ++pair)
      for (std::size_t r = 0; r < 4; ++r)
        for (std::size_t c = 0; c < 4; ++c)
          entries.push_back({static_cast<std::int32_t>(row_[pair][r]),
                             static_cast<std::int32_t>(row_[pair][c]),
                             share_[pair] * factor_[pair][r] * factor_[pair][c]});
    // Every diagonal is there, even of a particle without neighbours: the shift acts on it.
    for (std::size_t r = 0; r < 3 * particles_; ++r)
      entries.push_back({static_cast<std::int32_t>(r), static_cast<std::int32_t>(r), 0});
    return assemble_sparse(3 * particles_, entries);
  }

private:
  std::size_t particles_;
  std::vector<std::array<std::size_t, 4>> row_;
  std::vector<std::array<double, 4>> factor_;
  std::vector<double> share_;
};

double largest(const std::vector<double>& values) {
  double result = 0;
  for (const double v : values) result = std::max(result, std::abs(v));
  return result;
}

}  // namespace

double make_consistent(const Body& body, std::vector<GradientRow>& rows) {
  const std::size_t n = body.size();
  const double d = body.mean_spacing();
  const std::vector<double> boundary = boundary_vectors(body);
  const Conditions conditions(body, rows);
  // Constant fields and the area are constrained twice, so the system is singular but solvable; the shift
  // makes it definite, and repeating the solution removes what the shift changed.
  SparseSolver solver(SparseSolver::Kind::symmetric, 1e-9);
  bool factorised = false;
  double worst = 0;
  for (std::size_t c = 0; c < 2; ++c) {
    std::vector<double> weights;
    weights.reserve(conditions.weights());
    for (const GradientRow& row : rows)
      for (const auto& gradient : row.gradient) weights.push_back(gradient[c] * d);
    std::vector<double> target(3 * n, 0.0), multiplier;
    for (std::size_t i = 0; i < n; ++i) {
      if (body.carried(i)) continue;
      target[3 * i + c] = 1;
      target[3 * i + 2] = boundary[2 * i + c] / d;
    }
    // Repeated, so that the solver's own accuracy does not limit the result.
    for (int round = 0; round < 6; ++round) {
      const std::vector<double> gap = conditions.gap(target, weights);
      if (largest(gap) < 1e-13) break;
      if (!factorised) factorised = solver.factorise(conditions.system());
      if (!solver.solve(gap, multiplier)) break;
      conditions.correct(weights, multiplier);
    }
    worst = std::max(worst, largest(conditions.gap(target, weights)));
    std::size_t pair = 0;
    for (GradientRow& row : rows)
      for (auto& gradient : row.gradient) gradient[c] = weights[pair++] / d;
  }
  return worst;
}

}  // namespace estuary::solid
