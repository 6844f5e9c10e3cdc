#include "newton.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "least_norm.hpp"

namespace estuary::solid {
namespace {

// Second Piola-Kirchhoff stress F^-1 P.
Tensor<double> second_piola_kirchhoff(const Tensor<double>& f, const Tensor<double>& p) {
  return product(scaled(transposed(cofactor(f)), 1 / determinant(f)), p);
}

double length_of(const std::vector<double>& a) {
  return std::sqrt(dot(a, a));
}

}  // namespace

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
          prescribed_step[2 * i + c] + (unknown_[i] < 0 ? 0.0 : solution_[row_of(i, c)]);
  return true;
}

bool NewtonSolver::factorise() {
  return linear_.factorise(matrix_) && linear_.solve(right_hand_side_, solution_);
}

// Newton's method on the total potential with a line search: slower than `iterate` far from equilibrium, but
// it cannot leave a stable one. Where the tangent is not positive definite, a multiple of its diagonal is
// added (Nocedal & Wright 2006, ch. 3.4). Such steps may end on a saddle that the start's symmetry leads to,
// so what is left factorised at the end is the tangent itself.
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
  double shift = 0, shift_factorised = 0, energy = potential(displacement);
  std::vector<double> trial(2 * n);
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    outcome.residual = set_residual(target) / scale;
    if (iteration > 0 && outcome.change < tolerance &&
        (outcome.residual < tolerance || outcome.residual < round_off() / scale)) {
      outcome.converged = true;
      if (shift_factorised > 0) {
        use_current_stress();
        assemble();
        ++report.steps;
        factorise();  // a singular tangent is not positive definite either
      }
      return outcome;
    }
    if (report.steps >= settings.maximum_steps) return outcome;
    use_current_stress();
    assemble();
    if (shift > 0)
      for (std::size_t c = 0; c < matrix_.columns(); ++c)
        for (std::int32_t k = matrix_.first[c]; k < matrix_.first[c + 1]; ++k)
          if (matrix_.row[static_cast<std::size_t>(k)] == static_cast<std::int32_t>(c))
            matrix_.value[static_cast<std::size_t>(k)] *= 1 + shift;
    ++report.steps;
    if (!factorise() || !linear_.positive_definite()) {
      shift = shift > 0 ? 4 * shift : 1e-4;
      if (shift > 1e3) return outcome;
      continue;
    }
    shift_factorised = shift;
    const double slope = -dot(right_hand_side_, solution_);
    double share = 1, next = energy;
    bool descended = false;
    for (int halvings = 0; halvings < 14; ++halvings, share *= 0.5) {
      for (std::size_t i = 0; i < n; ++i)
        for (std::size_t c = 0; c < 2; ++c)
          trial[2 * i + c] =
              displacement[2 * i + c] + (unknown_[i] < 0 ? 0.0 : share * solution_[row_of(i, c)]);
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
    outcome.change = share * length_of(solution_) /
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
      right_hand_side_[row_of(i, c)] = target[2 * i + c] + solver_.fields().force[2 * i + c];
  }
  for (const std::int64_t row : held_row_) right_hand_side_[row] = 0;
  return length_of(right_hand_side_);
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
        const double d = unknown_[i] < 0 ? 0.0 : solution_[row_of(i, c)];
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
  if (!(scale > 0) || right_hand_side_.size() == held_row_.size()) {
    // Nothing pulls, or nothing is free.
    for (std::size_t c = 0; c < 2 * n; ++c) displacement[c] += prescribed[c];
    if (solver_.evaluate(displacement) > 0) solver_.report_breakdown(0);
    report.converged = true;
    return report;
  }
  // The load in steps; with `strictly`, only over stable equilibria.
  const auto follow = [&](bool strictly) {
    double reached = 0, step = 1;
    report.reached = 0;
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
      if (outcome.converged && (!strictly || linear_.positive_definite())) {
        displacement = std::move(trial);
        report.reached = reached = next;
        step *= 2;
        continue;
      }
      if (report.steps >= settings.maximum_steps || step < 1e-3) return false;
      step *= 0.5;
      if (step > 1 - reached) step = 0.5 * (1 - reached);
    }
    if (solver_.symmetric_tangent()) report.stable = linear_.positive_definite();
    report.converged = true;
    return true;
  };
  if (!follow(false)) {
    solver_.evaluate(displacement);
    return report;
  }
  // A long step may land on an equilibrium that the body would leave at once, beside a stable one that
  // shorter steps lead to. (Not so with plastic flow, which is one increment.)
  if (!report.stable && solver_.history().empty()) {
    std::vector<double> unstable = displacement;
    EquilibriumReport of_unstable = report;
    displacement = start;
    report.converged = false;
    if (!follow(true)) {
      of_unstable.steps = report.steps;
      report = of_unstable;
      displacement = std::move(unstable);
      solver_.evaluate(displacement);
    }
  }
  return report;
}

}  // namespace estuary::solid
