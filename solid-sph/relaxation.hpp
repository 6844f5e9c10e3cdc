// Dynamic relaxation: the damped motion towards equilibrium, with the damping of the slowest mode still
// moving estimated from the motion itself by a Rayleigh quotient (Underwood 1983). Included by
// compiled_solver.hpp.
//
// Steps are taken in units of the largest stable step, so the number of steps depends on the shape and on the
// number of particles only, not on density or stiffness.
#pragma once

#include <limits>

#include "compiled_solver.hpp"
#include "on_team.hpp"

namespace estuary::solid {

template <class Law, bool Stabilised, bool Viscous>
EquilibriumReport CompiledSolver<Law, Stabilised, Viscous>::relax(std::vector<double>& displacement,
                                                                  const Loading& loading, double time,
                                                                  const EquilibriumSettings& settings,
                                                                  const Monitor& monitor) {
  constexpr std::uint64_t kBlock = 50;  // steps between two looks at the motion
  const std::size_t n = body_.size();
  const auto free = [&](std::size_t c) { return !body_.holds(c / 2, c % 2); };
  for (const PrescribedMotion& motion : loading.prescribed)
    for (const std::uint32_t i : motion.particle)
      displacement[2 * i + motion.component] =
          motion.displacement(body_.position[2 * i], body_.position[2 * i + 1], time);
  const double reference_step = reference_stable_step();
  std::vector<double> external;
  external_force(loading, time, displacement, external);
  std::vector<double> velocity(2 * n, 0.0), block_displacement = displacement, block_force(2 * n);
  const auto free_norm = [&](const auto& value) {
    return std::sqrt(ordered_sum(2 * n, [&](std::size_t c) { return free(c) ? value(c) * value(c) : 0.0; }));
  };
  const double load_norm = free_norm([&](std::size_t c) { return external[c]; });

  EquilibriumReport report;
  double dt = 0, damping = 0, last_change = 0;
  double reference_norm = load_norm;
  bool near_before = false;
  for (;; ++report.steps) {
    if (stresses<false>(displacement) > 0) report_breakdown(report.steps);
    forces<false>(displacement, {});
    const double* force = fields_.force.data();

    if (report.steps % kBlock == 0) {
      const double residual = free_norm([&](std::size_t c) { return external[c] + force[c]; });
      // Without a load, the way back to rest is measured by the force it starts from.
      if (report.steps == 0 && !(reference_norm > 0)) reference_norm = residual;
      report.residual = reference_norm > 0 ? residual / reference_norm : 0;
      if (!(reference_norm > 0)) {
        report.converged = true;
        return report;
      }
      if (report.steps > 0) {
        const double change =
            free_norm([&](std::size_t c) { return displacement[c] - block_displacement[c]; });
        const double size = free_norm([&](std::size_t c) { return displacement[c]; });
        const double ratio = last_change > 0 ? std::min(change / last_change, 0.9999) : 0.9999;
        // What a geometric sequence of changes would still add.
        report.remaining_change = size > 0 ? change * ratio / (1 - ratio) / size : 0;
        last_change = change;
        const bool near =
            report.residual < settings.tolerance &&
            (report.remaining_change < settings.tolerance || size < 1e-14 * body_.mean_spacing());
        if (near && near_before) {
          report.converged = true;
          return report;
        }
        near_before = near;
        const double stiffness = ordered_sum(2 * n, [&](std::size_t c) {
          return free(c) ? (displacement[c] - block_displacement[c]) * (block_force[c] - force[c]) : 0.0;
        });
        const double inertia = ordered_sum(2 * n, [&](std::size_t c) {
          const double d = displacement[c] - block_displacement[c];
          return free(c) ? d * d * body_.mass[c / 2] : 0.0;
        });
        damping = inertia > 0 && stiffness > 0 ? 2 * std::sqrt(stiffness / inertia) : 0;
      }
      if (report.steps >= settings.maximum_steps) return report;
      if (!loading.pressures.empty()) external_force(loading, time, displacement, external);
      dt = 0.9 * reference_step / std::sqrt(std::max(1.0, stiffening()));
      damping = std::min(damping, 1.0 / dt);
      block_displacement = displacement;
      std::copy(force, force + 2 * n, block_force.begin());
      char note[96];
      std::snprintf(note, sizeof note, "step %llu, residual %.1e, remaining change %.1e",
                    static_cast<unsigned long long>(report.steps), report.residual, report.remaining_change);
      monitor(
          std::clamp(std::log(std::max(report.residual, settings.tolerance)) / std::log(settings.tolerance),
                     0.0, 1.0),
          note);
    }

    const double decay = (2 - damping * dt) / (2 + damping * dt), gain = 2 * dt / (2 + damping * dt);
    on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
      for (std::size_t c = 0; c < 2 * n; ++c) {
        if (body_.holds(c / 2, c % 2)) continue;
        velocity[c] = decay * velocity[c] + gain * (external[c] + force[c]) / body_.mass[c / 2];
        displacement[c] += dt * velocity[c];
      }
    });
  }
}

}  // namespace estuary::solid
