#include "newton.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {

NewtonSolver::NewtonSolver(Solver& solver, bool split_pressure)
    : solver_(solver),
      linear_(solver.symmetric_tangent() ? SparseSolver::Kind::symmetric : SparseSolver::Kind::general) {
  const Body& body = solver.body();
  const Neighbourhood& pairs = solver.pairs();
  const std::size_t n = body.size();
  unknown_.assign(n, -1);
  std::int64_t free = 0;
  for (std::size_t i = 0; i < n; ++i)
    if ((body.fixed[i] & 3U) != 3) unknown_[i] = free++;

  // Coupled unknowns: every two particles of one stencil.
  std::vector<std::vector<std::int32_t>> coupled(static_cast<std::size_t>(free));
  const auto stencil = [&](std::size_t i, std::size_t a) {
    return a == 0 ? i : static_cast<std::size_t>(pairs.neighbour[pairs.first[i] + a - 1]);
  };
  const auto stencil_size = [&](std::size_t i) {
    return std::size_t{1} + pairs.first[i + 1] - pairs.first[i];
  };
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t b = 0; b < stencil_size(i); ++b) {
      const std::int64_t column = unknown_[stencil(i, b)];
      if (column < 0) continue;
      for (std::size_t a = 0; a < stencil_size(i); ++a) {
        const std::int64_t row = unknown_[stencil(i, a)];
        if (row >= 0) coupled[static_cast<std::size_t>(column)].push_back(static_cast<std::int32_t>(row));
      }
    }
  for (auto& rows : coupled) {
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    for (int component = 0; component < 2; ++component) {
      for (const std::int32_t row : rows) matrix_.row.insert(matrix_.row.end(), {2 * row, 2 * row + 1});
      matrix_.first.push_back(static_cast<std::int32_t>(matrix_.row.size()));
    }
  }
  matrix_.value.assign(matrix_.row.size(), 0.0);

  first_block_.push_back(0);
  for (std::size_t i = 0; i < n; ++i) {
    const std::size_t m = stencil_size(i);
    for (std::size_t a = 0; a < m; ++a)
      for (std::size_t b = 0; b < m; ++b) {
        const std::int64_t row = unknown_[stencil(i, a)], column = unknown_[stencil(i, b)];
        if (row < 0 || column < 0) {
          block_.push_back(-1);
          continue;
        }
        const auto& rows = coupled[static_cast<std::size_t>(column)];
        const auto place =
            std::lower_bound(rows.begin(), rows.end(), static_cast<std::int32_t>(row)) - rows.begin();
        block_.push_back(matrix_.first[2 * column] + static_cast<std::int32_t>(2 * place));
      }
    first_block_.push_back(block_.size());
  }
  right_hand_side_.assign(static_cast<std::size_t>(2 * free), 0.0);
  change_.assign(2 * n, 0.0);
  predicted_stress_.assign(4 * n, 0.0);
  predicted_pressure_.assign(n, 0.0);
  if (split_pressure) {
    solver.evaluate(std::vector<double>(2 * n, 0.0));
    for (std::size_t i = 0; i < n; ++i) shear_modulus_.push_back(solver.tangent_at(i)[5]);
  }
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t c = 0; c < 2; ++c)
      if (unknown_[i] >= 0 && body.holds(i, c))
        held_row_.push_back(2 * unknown_[i] + static_cast<std::int64_t>(c));
  std::vector<std::uint8_t> held(static_cast<std::size_t>(2 * free), 0);
  for (const std::int64_t row : held_row_) held[static_cast<std::size_t>(row)] = 1;
  if (!held_row_.empty())
    for (std::int64_t column = 0; column < 2 * free; ++column)
      for (std::int64_t k = matrix_.first[column]; k < matrix_.first[column + 1]; ++k) {
        const std::int64_t row = matrix_.row[k];
        if (!held[static_cast<std::size_t>(row)] && !held[static_cast<std::size_t>(column)]) continue;
        (row == column ? diagonal_ : zeroed_).push_back(k);
      }
  if (!pairs.spring.empty()) add_springs();
}

// A held component keeps its place in the system with an equation of its own, of the size of the others.
void NewtonSolver::hold_components() {
  double* values = matrix_.value.data();
  for (const std::int64_t k : zeroed_) values[k] = 0;
  for (const std::int64_t k : diagonal_) values[k] = std::abs(values[k]) > 0 ? std::abs(values[k]) : 1.0;
}

std::int64_t NewtonSolver::block(std::size_t i, std::size_t a, std::size_t b) const {
  const auto& pairs = solver_.pairs();
  const std::size_t m = std::size_t{1} + pairs.first[i + 1] - pairs.first[i];
  return block_[first_block_[i] + a * m + b];
}

void NewtonSolver::add_springs() {
  const Neighbourhood& pairs = solver_.pairs();
  spring_values_.assign(matrix_.value.size(), 0.0);
  std::vector<double> row;
  for (std::size_t i = 0; i < solver_.body().size(); ++i) {
    const std::size_t m = std::size_t{1} + pairs.first[i + 1] - pairs.first[i];
    for (std::size_t k = 1; k < m; ++k) {
      const std::size_t pair = pairs.first[i] + k - 1;
      const double stiffness = pairs.spring[pair];
      if (stiffness == 0) continue;
      // Deviation of neighbour k as a linear form of the stencil's displacements.
      const double ox = pairs.offset[2 * pair], oy = pairs.offset[2 * pair + 1];
      row.assign(m, 0.0);
      row[0] = -1 + pairs.gradient_sum[2 * i] * ox + pairs.gradient_sum[2 * i + 1] * oy;
      row[k] = 1;
      for (std::size_t a = 1; a < m; ++a) {
        const std::size_t p = pairs.first[i] + a - 1;
        row[a] -= pairs.gradient[2 * p] * ox + pairs.gradient[2 * p + 1] * oy;
      }
      for (std::size_t a = 0; a < m; ++a)
        for (std::size_t b = 0; b < m; ++b) {
          const std::int64_t position = block(i, a, b);
          if (position < 0) continue;
          const std::int64_t column = unknown_[b == 0 ? i : pairs.neighbour[pairs.first[i] + b - 1]];
          const std::int64_t height = matrix_.first[2 * column + 1] - matrix_.first[2 * column];
          const double value = stiffness * row[a] * row[b];
          spring_values_[static_cast<std::size_t>(position)] += value;
          spring_values_[static_cast<std::size_t>(position + height + 1)] += value;
        }
    }
  }
}

void NewtonSolver::assemble() {
  const Body& body = solver_.body();
  const Neighbourhood& pairs = solver_.pairs();
  double* values = matrix_.value.data();
  if (spring_values_.empty()) {
    std::fill(values, values + matrix_.value.size(), 0.0);
  } else {
    std::copy(spring_values_.begin(), spring_values_.end(), values);
  }
  std::vector<double> half;  // for each stencil particle a: sum_q V g_a[q] A[p q, r s], 2 x 4
  for (std::size_t i = 0; i < body.size(); ++i) {
    std::array<double, 16> a = solver_.tangent_at(i);
    const auto [pressure, s] = parts_at(i);
    // d cof F / dF is constant.
    const double more = predicted_pressure_[i] - pressure;
    a[3] += more;
    a[12] += more;
    a[6] -= more;
    a[9] -= more;
    const std::array<double, 4> correction{
        predicted_stress_[4 * i] - s.xx, predicted_stress_[4 * i + 1] - s.xy,
        predicted_stress_[4 * i + 2] - s.yx, predicted_stress_[4 * i + 3] - s.yy};
    for (std::size_t p = 0; p < 2; ++p)
      for (std::size_t q = 0; q < 2; ++q)
        for (std::size_t r = 0; r < 2; ++r) a[4 * (2 * p + q) + 2 * p + r] += correction[2 * q + r];
    const std::size_t m = std::size_t{1} + pairs.first[i + 1] - pairs.first[i];
    const auto gradient = [&](std::size_t k, std::size_t c) {
      return k == 0 ? -pairs.gradient_sum[2 * i + c] : pairs.gradient[2 * (pairs.first[i] + k - 1) + c];
    };
    half.resize(8 * m);
    for (std::size_t k = 0; k < m; ++k) {
      const double gx = body.energy_volume[i] * gradient(k, 0), gy = body.energy_volume[i] * gradient(k, 1);
      for (std::size_t p = 0; p < 2; ++p)
        for (std::size_t rs = 0; rs < 4; ++rs)
          half[8 * k + 4 * p + rs] = gx * a[8 * p + rs] + gy * a[8 * p + 4 + rs];
    }
    for (std::size_t l = 0; l < m; ++l) {
      const std::int64_t column = unknown_[l == 0 ? i : pairs.neighbour[pairs.first[i] + l - 1]];
      if (column < 0) continue;
      const double gx = gradient(l, 0), gy = gradient(l, 1);
      const std::int64_t height = matrix_.first[2 * column + 1] - matrix_.first[2 * column];
      for (std::size_t k = 0; k < m; ++k) {
        const std::int64_t position = block(i, k, l);
        if (position < 0) continue;
        const double* h = &half[8 * k];
        values[position] += h[0] * gx + h[1] * gy;
        values[position + 1] += h[4] * gx + h[5] * gy;
        values[position + height] += h[2] * gx + h[3] * gy;
        values[position + height + 1] += h[6] * gx + h[7] * gy;
      }
    }
  }
  hold_components();
}

}  // namespace estuary::solid
