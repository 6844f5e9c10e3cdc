#include "newton.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

namespace estuary::solid {
namespace {

// Second Piola-Kirchhoff stress F^-1 P.
Tensor<double> second_piola_kirchhoff(const Tensor<double>& f, const Tensor<double>& p) {
  return product(scaled(transposed(cofactor(f)), 1 / determinant(f)), p);
}

}  // namespace

NewtonSolver::NewtonSolver(Solver& solver, bool split_pressure) : solver_(solver) {
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
  std::vector<Eigen::Triplet<double>> entries;
  Eigen::VectorXi column_size(2 * free);
  for (std::size_t c = 0; c < coupled.size(); ++c) {
    auto& rows = coupled[c];
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    column_size[static_cast<Eigen::Index>(2 * c)] = column_size[static_cast<Eigen::Index>(2 * c + 1)] =
        static_cast<int>(2 * rows.size());
  }
  matrix_.resize(2 * free, 2 * free);
  matrix_.reserve(column_size);
  for (std::size_t c = 0; c < coupled.size(); ++c)
    for (int component = 0; component < 2; ++component)
      for (const std::int32_t row : coupled[c])
        for (int r = 0; r < 2; ++r)
          matrix_.insert(2 * row + r, static_cast<Eigen::Index>(2 * c) + component) = 0;
  matrix_.makeCompressed();

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
        block_.push_back(matrix_.outerIndexPtr()[2 * column] + static_cast<std::int32_t>(2 * place));
      }
    first_block_.push_back(block_.size());
  }
  right_hand_side_.resize(2 * free);
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
      for (std::int64_t k = matrix_.outerIndexPtr()[column]; k < matrix_.outerIndexPtr()[column + 1]; ++k) {
        const std::int64_t row = matrix_.innerIndexPtr()[k];
        if (!held[static_cast<std::size_t>(row)] && !held[static_cast<std::size_t>(column)]) continue;
        (row == column ? diagonal_ : zeroed_).push_back(k);
      }
  if (!pairs.spring.empty()) add_springs();
}

// A held component keeps its place in the system with an equation of its own, of the size of the others.
void NewtonSolver::hold_components() {
  double* values = matrix_.valuePtr();
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
  spring_values_.assign(static_cast<std::size_t>(matrix_.nonZeros()), 0.0);
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
          const std::int64_t height =
              matrix_.outerIndexPtr()[2 * column + 1] - matrix_.outerIndexPtr()[2 * column];
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
  double* values = matrix_.valuePtr();
  if (spring_values_.empty()) {
    std::fill(values, values + matrix_.nonZeros(), 0.0);
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
      const std::int64_t height =
          matrix_.outerIndexPtr()[2 * column + 1] - matrix_.outerIndexPtr()[2 * column];
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

// One linear step in which the prescribed components move as they should and the others follow.
bool NewtonSolver::follow_prescribed(std::vector<double>& displacement, const std::vector<double>& target,
                                     const std::vector<double>& prescribed_step) {
  const std::size_t n = solver_.body().size();
  double largest = 0;
  for (const double d : prescribed_step) largest = std::max(largest, std::abs(d));
  if (!(largest > 0)) return true;
  if (solver_.evaluate(displacement) > 0) return false;
  // The columns of the prescribed components act through the derivative of the force along their motion.
  const double share = 1e-7 * solver_.body().mean_spacing() / largest;
  const std::vector<double> force = solver_.fields().force;
  std::vector<double> trial = displacement;
  for (std::size_t c = 0; c < 2 * n; ++c) trial[c] += share * prescribed_step[c];
  if (solver_.evaluate(trial) > 0) return false;
  std::vector<double> pushed(2 * n);
  for (std::size_t c = 0; c < 2 * n; ++c)
    pushed[c] = target[c] + (solver_.fields().force[c] - force[c]) / share;
  if (solver_.evaluate(displacement) > 0) return false;
  use_current_stress();
  set_residual(pushed);
  assemble();
  if (!factorise()) return false;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t c = 0; c < 2; ++c)
      displacement[2 * i + c] +=
          prescribed_step[2 * i + c] +
          (unknown_[i] < 0
               ? 0.0
               : solution_[static_cast<Eigen::Index>(2 * unknown_[i]) + static_cast<Eigen::Index>(c)]);
  return true;
}

bool NewtonSolver::factorise() {
  if (solver_.symmetric_tangent()) {
    if (!analysed_) symmetric_.analyzePattern(matrix_);
    analysed_ = true;
    symmetric_.factorize(matrix_);
    if (symmetric_.info() != Eigen::Success) return false;
    solution_ = symmetric_.solve(right_hand_side_);
  } else {
    if (!analysed_) general_.analyzePattern(matrix_);
    analysed_ = true;
    general_.factorize(matrix_);
    if (general_.info() != Eigen::Success) return false;
    solution_ = general_.solve(right_hand_side_);
  }
  return solution_.allFinite();
}

// Newton's method on the total potential with a line search: slower than `iterate` far from equilibrium, but
// it cannot leave a stable one. Where the tangent is not positive definite, a multiple of its diagonal is
// added (Nocedal & Wright 2006, ch. 3.4).
NewtonSolver::Outcome NewtonSolver::minimise(std::vector<double>& displacement,
                                             const std::vector<double>& target, double scale,
                                             double tolerance, const EquilibriumSettings& settings,
                                             EquilibriumReport& report, const Monitor& monitor) {
  constexpr int kIterations = 60;
  const Body& body = solver_.body();
  const std::size_t n = body.size();
  Outcome outcome;
  if (solver_.evaluate(displacement) > 0) return outcome;
  const auto potential = [&](const std::vector<double>& u) {
    return solver_.energy(u) - ordered_sum(2 * n, [&](std::size_t c) {
             return body.holds(c / 2, c % 2) ? 0.0 : target[c] * u[c];
           });
  };
  double shift = 0, energy = potential(displacement);
  std::vector<double> trial(2 * n);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    outcome.residual = set_residual(target) / scale;
    if (iteration > 0 && outcome.change < tolerance &&
        (outcome.residual < tolerance || outcome.residual < round_off() / scale)) {
      outcome.converged = true;
      return outcome;
    }
    if (report.steps >= settings.maximum_steps) return outcome;
    use_current_stress();
    assemble();
    if (shift > 0)
      for (Eigen::Index c = 0; c < matrix_.cols(); ++c) matrix_.coeffRef(c, c) *= 1 + shift;
    ++report.steps;
    if (!factorise() || !(symmetric_.vectorD().array() > 0).all()) {
      shift = shift > 0 ? 4 * shift : 1e-4;
      if (shift > 1e3) return outcome;
      continue;
    }
    const double slope = -right_hand_side_.dot(solution_);
    double share = 1, next = energy;
    bool descended = false;
    for (; share > 1e-4; share *= 0.5) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t c = 0; c < 2; ++c)
          trial[2 * i + c] = displacement[2 * i + c] +
                             (unknown_[i] < 0 ? 0.0
                                              : share * solution_[static_cast<Eigen::Index>(2 * unknown_[i]) +
                                                                  static_cast<Eigen::Index>(c)]);
      if (solver_.evaluate(trial) > 0) continue;
      next = potential(trial);
      // Near the minimum the energy's round-off hides the descent; the residual then decides.
      if (next <= energy + 1e-4 * share * slope || -slope < 1e-11 * std::abs(energy)) {
        descended = true;
        break;
      }
    }
    if (!descended) return outcome;
    energy = next;
    outcome.change = share * solution_.norm() /
                     std::sqrt(ordered_sum(2 * n, [&](std::size_t c) { return trial[c] * trial[c]; }));
    displacement.swap(trial);
    shift = share == 1 && shift > 1e-8 ? 0.1 * shift : 0;
    char note[96];
    std::snprintf(note, sizeof note, "linear solve %llu, residual %.1e, change %.1e",
                  static_cast<unsigned long long>(report.steps), outcome.residual, outcome.change);
    monitor(-1, note);
  }
  return outcome;
}

// With the shear modulus at rest in P = mu F + p cof F, the p nearest to it; the rest stays in S.
NewtonSolver::Parts NewtonSolver::parts_at(std::size_t i) const {
  const Tensor<double> f = tensor_at(solver_.fields().deformation_gradient, i);
  Tensor<double> p = solver_.first_piola_kirchhoff_at(i);
  Parts parts;
  if (!shear_modulus_.empty()) {
    const Tensor<double> c = cofactor(f);
    parts.pressure = contraction(p - scaled(f, shear_modulus_[i]), c) / contraction(f, f);
    p = p - scaled(c, parts.pressure);
  }
  parts.s = second_piola_kirchhoff(f, p);
  return parts;
}

void NewtonSolver::use_current_stress() {
  for (std::size_t i = 0; i < solver_.body().size(); ++i) {
    const auto [pressure, s] = parts_at(i);
    predicted_pressure_[i] = pressure;
    predicted_stress_[4 * i] = s.xx;
    predicted_stress_[4 * i + 1] = s.xy;
    predicted_stress_[4 * i + 2] = s.yx;
    predicted_stress_[4 * i + 3] = s.yy;
  }
}

// A stiff volume's stress cannot be known better than the rounding of the positions allows, however small the
// load.
double NewtonSolver::round_off() const {
  const Body& body = solver_.body();
  const Neighbourhood& pairs = solver_.pairs();
  double sum = 0;
  for (std::size_t i = 0; i < body.size(); ++i) {
    double modulus = 0;
    for (const double a : solver_.tangent_at(i)) modulus = std::max(modulus, std::abs(a));
    const Tensor<double> f = tensor_at(solver_.fields().deformation_gradient, i);
    const double stress = body.energy_volume[i] * modulus * std::sqrt(contraction(f, f));
    for (std::size_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k)
      sum += stress * stress *
             (pairs.gradient[2 * k] * pairs.gradient[2 * k] +
              pairs.gradient[2 * k + 1] * pairs.gradient[2 * k + 1]);
  }
  return std::numeric_limits<double>::epsilon() * std::sqrt(sum);
}

double NewtonSolver::set_residual(const std::vector<double>& target) {
  for (std::size_t i = 0; i < solver_.body().size(); ++i) {
    if (unknown_[i] < 0) continue;
    for (std::size_t c = 0; c < 2; ++c)
      right_hand_side_[static_cast<Eigen::Index>(2 * unknown_[i]) + static_cast<Eigen::Index>(c)] =
          target[2 * i + c] + solver_.fields().force[2 * i + c];
  }
  for (const std::int64_t row : held_row_) right_hand_side_[row] = 0;
  return right_hand_side_.norm();
}

void NewtonSolver::predict_stress(const std::vector<double>& change) {
  const Neighbourhood& pairs = solver_.pairs();
  for (std::size_t i = 0; i < solver_.body().size(); ++i) {
    Tensor<double> d;
    for (std::size_t k = pairs.first[i]; k < pairs.first[i + 1]; ++k) {
      const std::size_t j = pairs.neighbour[k];
      const double dx = change[2 * j] - change[2 * i], dy = change[2 * j + 1] - change[2 * i + 1];
      d.xx += dx * pairs.gradient[2 * k];
      d.xy += dx * pairs.gradient[2 * k + 1];
      d.yx += dy * pairs.gradient[2 * k];
      d.yy += dy * pairs.gradient[2 * k + 1];
    }
    const Tensor<double> f = tensor_at(solver_.fields().deformation_gradient, i);
    const auto [pressure, s] = parts_at(i);
    const std::array<double, 16> a = solver_.tangent_at(i);
    const std::array<double, 4> dv{d.xx, d.xy, d.yx, d.yy};
    std::array<double, 4> dp{};
    for (std::size_t r = 0; r < 4; ++r)
      for (std::size_t c = 0; c < 4; ++c) dp[r] += a[4 * r + c] * dv[c];
    Tensor<double> change_of_p{dp[0], dp[1], dp[2], dp[3]};
    if (!shear_modulus_.empty()) {
      const Tensor<double> c = cofactor(f), dc = cofactor(d), p = solver_.first_piola_kirchhoff_at(i);
      const double mu = shear_modulus_[i];
      const double more = (contraction(change_of_p - scaled(d, mu), c) + contraction(p - scaled(f, mu), dc) -
                           2 * pressure * contraction(f, d)) /
                          contraction(f, f);
      predicted_pressure_[i] = pressure + more;
      change_of_p = change_of_p - scaled(c, more) - scaled(dc, pressure);
    }
    // dS = F^-1 (dP - dF S), of what the pressure leaves.
    const Tensor<double> material = change_of_p - product(d, s);
    const Tensor<double> predicted = s + second_piola_kirchhoff(f, material);
    predicted_stress_[4 * i] = predicted.xx;
    predicted_stress_[4 * i + 1] = predicted.xy;
    predicted_stress_[4 * i + 2] = predicted.yx;
    predicted_stress_[4 * i + 3] = predicted.yy;
  }
}

NewtonSolver::Outcome NewtonSolver::iterate(std::vector<double>& displacement,
                                            const std::vector<double>& target, double scale, double tolerance,
                                            const EquilibriumSettings& settings, EquilibriumReport& report,
                                            const Monitor& monitor) {
  constexpr int kIterations = 14;
  const std::size_t n = solver_.body().size();
  Outcome outcome;
  if (solver_.evaluate(displacement) > 0) return outcome;
  use_current_stress();
  double first_residual = 0, last_step = 0, previous_step = 0;
  for (int iteration = 0; iteration <= kIterations; ++iteration) {
    outcome.residual = set_residual(target) / scale;
    if (iteration == 0) first_residual = outcome.residual;
    if (iteration > 0 && outcome.change < tolerance &&
        (outcome.residual < tolerance || outcome.residual < round_off() / scale)) {
      outcome.converged = true;
      return outcome;
    }
    if (iteration == kIterations || report.steps >= settings.maximum_steps) return outcome;
    if (!std::isfinite(outcome.residual) || outcome.residual > 1e8 * (1 + first_residual)) return outcome;

    assemble();
    ++report.steps;
    if (!factorise()) return outcome;
    double change = 0, size = 0;
    for (std::size_t i = 0; i < n; ++i)
      for (std::size_t c = 0; c < 2; ++c) {
        const double d =
            unknown_[i] < 0
                ? 0.0
                : solution_[static_cast<Eigen::Index>(2 * unknown_[i]) + static_cast<Eigen::Index>(c)];
        change_[2 * i + c] = d;
        displacement[2 * i + c] += d;
        change += d * d;
        size += displacement[2 * i + c] * displacement[2 * i + c];
      }
    last_step = size > 0 ? std::sqrt(change / size) : 0;
    // Steps shrink at least as fast as they last did, so this bounds what is still to come.
    outcome.change = previous_step > 0 ? last_step * std::min(1.0, last_step / previous_step) : last_step;
    previous_step = last_step;
    predict_stress(change_);
    // A step too long for the body's volume is taken in part.
    double share = 1;
    while (solver_.evaluate(displacement) > 0) {
      share *= 0.5;
      if (share < 0.05) return outcome;
      for (std::size_t c = 0; c < 2 * n; ++c) displacement[c] -= share * change_[c];
    }
    char note[96];
    std::snprintf(note, sizeof note, "linear solve %llu, residual %.1e, change %.1e",
                  static_cast<unsigned long long>(report.steps), outcome.residual, outcome.change);
    monitor(-1, note);
  }
  return outcome;
}

EquilibriumReport NewtonSolver::solve(std::vector<double>& displacement, const Loading& loading, double time,
                                      const EquilibriumSettings& settings, const Monitor& monitor) {
  const std::size_t n = solver_.body().size();
  EquilibriumReport report;
  std::vector<double> external, target(2 * n), start = displacement, start_force(2 * n);
  solver_.external_force(loading, time, displacement, external);
  std::vector<double> prescribed(2 * n, 0.0), step_of_prescribed(2 * n, 0.0);
  bool moves = false;
  for (const PrescribedMotion& motion : loading.prescribed)
    for (const std::uint32_t i : motion.particle) {
      const std::size_t c = 2 * i + motion.component;
      prescribed[c] =
          motion.displacement(solver_.body().position[2 * i], solver_.body().position[2 * i + 1], time) -
          displacement[c];
      moves = moves || prescribed[c] != 0;
    }
  if (solver_.evaluate(displacement) > 0) solver_.report_breakdown(0);
  // The start is in equilibrium under minus its own internal force: the load is moved from there to the one
  // wanted.
  double load = 0, gap = 0;
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t c = 0; c < 2; ++c) {
      start_force[2 * i + c] = -solver_.fields().force[2 * i + c];
      if (solver_.body().holds(i, c)) continue;
      load += external[2 * i + c] * external[2 * i + c];
      gap += start_force[2 * i + c] * start_force[2 * i + c];
    }
  if (moves) {
    // Where motion is prescribed its own force is the measure: that of the first linear step.
    std::vector<double> trial = displacement;
    for (std::size_t c = 0; c < 2 * n; ++c) trial[c] += 1e-6 * prescribed[c];
    if (solver_.evaluate(trial) == 0) {
      double pushed = 0;
      for (std::size_t c = 0; c < 2 * n; ++c)
        if (!solver_.body().holds(c / 2, c % 2))
          pushed += std::pow((solver_.fields().force[c] + start_force[c]) / 1e-6, 2);
      load = std::max(load, pushed);
    }
    solver_.evaluate(displacement);
  }
  const double scale = std::sqrt(load > 0 ? load : gap);
  if (!(scale > 0) || right_hand_side_.size() == static_cast<Eigen::Index>(held_row_.size())) {
    // Nothing pulls, or nothing is free.
    for (std::size_t c = 0; c < 2 * n; ++c) displacement[c] += prescribed[c];
    if (solver_.evaluate(displacement) > 0) solver_.report_breakdown(0);
    report.converged = true;
    return report;
  }
  double reached = 0, step = 1;
  while (reached < 1) {
    const double next = std::min(1.0, reached + step);
    for (std::size_t c = 0; c < 2 * n; ++c)
      target[c] = start_force[c] + next * (external[c] - start_force[c]);
    std::vector<double> trial = displacement;
    const double tolerance = next < 1 ? std::max(1e-4, settings.tolerance) : settings.tolerance;
    bool followed = true;
    if (moves) {
      for (std::size_t c = 0; c < 2 * n; ++c) step_of_prescribed[c] = (next - reached) * prescribed[c];
      followed = follow_prescribed(trial, target, step_of_prescribed);
      ++report.steps;
    }
    Outcome outcome;
    if (followed) outcome = iterate(trial, target, scale, tolerance, settings, report, monitor);
    if (followed && !outcome.converged && solver_.symmetric_tangent() && outcome.residual < 10)
      outcome = minimise(trial, target, scale, tolerance, settings, report, monitor);
    report.residual = outcome.residual;
    report.remaining_change = outcome.change;
    if (outcome.converged) {
      displacement = std::move(trial);
      reached = next;
      step *= 2;
      continue;
    }
    if (report.steps >= settings.maximum_steps || step < 1e-3) {
      solver_.evaluate(displacement);
      return report;
    }
    step *= 0.5;
    if (step > 1 - reached) step = 0.5 * (1 - reached);
  }
  if (solver_.symmetric_tangent()) report.stable = (symmetric_.vectorD().array() > 0).all();
  report.converged = true;
  return report;
}

}  // namespace estuary::solid
