#include "shell.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "guide.hpp"
#include "on_team.hpp"

namespace estuary::solid {
namespace {

double norm(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0;
  for (const double v : a) sum += v * v;
  for (const double v : b) sum += v * v;
  return std::sqrt(sum);
}

}  // namespace

ShellSolver::ShellSolver(const Body& body, std::vector<ShellSection> sections)
    : Solver(body, Neighbourhood{}), row_(body, std::move(sections)) {
  pairs_.first.assign(body.size() + 1, 0);
  history_ = rest_history_ = row_.rest_history();
}

std::int64_t ShellSolver::sweep(std::span<const double> displacement, bool commit,
                                std::span<const double> velocity) {
  std::fill(fields_.force.begin(), fields_.force.end(), 0.0);
  return row_.evaluate(displacement, history_, commit, fields_, velocity);
}

std::int64_t ShellSolver::evaluate(std::span<const double> displacement) {
  return sweep(displacement, false);
}

void ShellSolver::commit(std::span<const double> displacement) {
  sweep(displacement, true);
}

double ShellSolver::reference_stable_step() {
  rest_stiffness_ = 1;
  stable_step_ = 2 / std::sqrt(row_.squared_frequency());
  return stable_step_;
}

double ShellSolver::longest_step(const State& state, double courant) {
  return courant * 2 / std::sqrt(row_.squared_frequency(state.velocity, history_));
}

double ShellSolver::kinetic_energy(const State& state) const {
  return Solver::kinetic_energy(state) + row_.kinetic_energy(state.history);
}

NamedValues ShellSolver::totals(const State& state) const {
  if (!row_.breakable()) return {};
  const auto lost = row_.losses(state.history);
  return {{"broken_links", lost[0]},
          {"isolated_particles", lost[1]},
          {"isolated_mass", lost[2]},
          {"rupture_energy", lost[3]}};
}

NamedValues ShellSolver::quantities_of(std::size_t i, const State& state) const {
  const auto section = row_.section_at(i, state.history);
  NamedValues values{{"rotation", state.history[2 * i]},
                     {"angular_velocity", state.history[2 * i + 1]},
                     {"normal_force", section[0]},
                     {"shear_force", section[1]},
                     {"bending_moment", section[2]}};
  if (row_.remembers()) values.emplace_back("section_plastic_strain", section[3]);
  return values;
}

void ShellSolver::add_loads(const Loading& loading, const ExternalForces& external, double time,
                            double fraction) {
  external.add_to(fields_.force);
  for (std::size_t i = 0; i < body_.size(); ++i)
    for (std::size_t c = 0; c < 2; ++c) fields_.force[2 * i + c] += body_.mass[i] * loading.gravity[c];
  row_.add_moments(loading, time, fraction);
}

void ShellSolver::advance(State& state, const Loading& given, double duration, std::uint64_t steps,
                          double damping, const Monitor& monitor) {
  const std::size_t n = body_.size();
  const double dt = duration / static_cast<double>(steps), start = state.time;
  const double decay = 1 - 0.5 * damping * dt, gain = 1 / (1 + 0.5 * damping * dt);
  history_ = state.history;
  Loading loading = given;
  if (row_.breakable()) row_.drop_broken(history_, loading);
  ExternalForces external(body_, loading);
  Guide guide(body_, loading);
  const auto gravity_work = [&] {
    double sum = 0;
    for (std::size_t c = 0; c < 2 * n; ++c)
      sum += body_.mass[c / 2] * loading.gravity[c % 2] * state.displacement[c];
    return sum;
  };
  state.external_work -= gravity_work();
  // Velocities foreseen for the end of a step: artificial viscosity wants them.
  std::vector<double> foreseen(row_.viscous() ? 2 * n : 0);
  if (row_.viscous()) {
    foreseen = state.velocity;
    row_.turn(history_, 0, 1, 1, true);
  }
  sweep(state.displacement, false, foreseen);
  if (row_.viscous()) state.viscous_work += 0.5 * dt * row_.viscous_power();
  external.set(0, start, state.displacement);
  add_loads(loading, external, start, 0);
  guide.remember(fields_.force);
  for (std::uint64_t step = 1; step <= steps; ++step) {
    const double fraction = static_cast<double>(step) / static_cast<double>(steps);
    const double time = start + fraction * duration;
    const double middle = (static_cast<double>(step) - 0.5) / static_cast<double>(steps);
    const auto kick = [&](bool ends) {
      on_team(n > kSerialBelow, [&] {
#pragma omp for schedule(static) nowait
        for (std::size_t i = 0; i < n; ++i)
          for (std::size_t c = 0; c < 2; ++c) {
            if (body_.holds(i, c) || loading.held[c]) continue;
            if (!state.removed.empty() && state.removed[i] != 0) continue;
            double& v = state.velocity[2 * i + c];
            const double a = 0.5 * dt * fields_.force[2 * i + c] / body_.mass[i];
            v = ends ? gain * (v + a) : decay * v + a;
            if (!ends) state.displacement[2 * i + c] += dt * v;
            if (!ends && !foreseen.empty()) foreseen[2 * i + c] = v + a;
          }
      });
      row_.turn(history_, dt, decay, gain, ends);
    };
    kick(false);
    guide.move(state, time, dt);
    if (!foreseen.empty()) guide.copy_velocity(state.velocity, foreseen);
    // Half-way through the step, where the rates are those of the motion.
    if (!loading.moments.empty() || loading.couples)
      state.external_work += row_.moment_work(loading, time - 0.5 * dt, middle, dt, history_);
    if (sweep(state.displacement, row_.remembers(), foreseen) > 0) refuse_what_is_not_finite(step);
    if (row_.breakable() && row_.break_links(history_) > 0) {
      row_.drop_broken(history_, loading);
      sweep(state.displacement, false, foreseen);
    }
    row_.refuse_folded(step);
    if (row_.viscous()) state.viscous_work += (step < steps ? 1.0 : 0.5) * dt * row_.viscous_power();
    external.set(fraction, time, state.displacement);
    add_loads(loading, external, time, fraction);
    // Gravity's share on what is moved is counted with the rest of gravity's.
    state.external_work += external.work() + guide.work(fields_.force, {});
    kick(true);
    if (row_.filters()) {
      const auto [taken, work] = row_.filter_normals(history_, loading, time, fraction);
      state.viscous_work += taken;
      state.external_work += work;
    }
    if (damping > 0) {
      state.viscous_work +=
          2 * dt * damping * (Solver::kinetic_energy(state) + row_.kinetic_energy(history_));
    }
    if (step % 128 == 0) monitor(fraction, "shell");
  }
  state.history = history_;
  state.time = start + duration;
  state.external_work += gravity_work();
}

void ShellSolver::refuse_what_is_not_finite(std::uint64_t step) {
  for (std::size_t i = 0; i < body_.size(); ++i)
    if (!std::isfinite(fields_.force[2 * i] + fields_.force[2 * i + 1] + row_.moments()[i]))
      throw Breakdown(i, step, std::numeric_limits<double>::quiet_NaN());
}

EquilibriumReport ShellSolver::relax(std::vector<double>& displacement, const Loading& loading, double time,
                                     const EquilibriumSettings& settings, const Monitor& monitor) {
  constexpr std::uint64_t kBlock = 50;
  const std::size_t n = body_.size();
  std::vector<double> mass, inertia, velocity(2 * n, 0.0), rate(n, 0.0);
  row_.relaxation_masses(mass, inertia);
  std::vector<double>& moment = row_.moments();
  for (const PrescribedMotion& motion : loading.prescribed)
    for (const std::uint32_t i : motion.particle)
      displacement[2 * i + motion.component] =
          motion.displacement(body_.position[2 * i], body_.position[2 * i + 1], time);
  std::vector<double> before = displacement, before_turn(n), before_force(2 * n), before_moment(n);
  ExternalForces external(body_, loading);
  EquilibriumReport report;
  double damping = 0, dt = 0.9, reference = 0, last_change = 0;
  bool near_before = false;
  const double round_off = row_.round_off();
  // Moments count by the force that makes them along a link.
  const double arm = body_.mean_spacing();
  for (;; ++report.steps) {
    if (evaluate(displacement) > 0) refuse_what_is_not_finite(report.steps);
    const double energy_scale = energy(displacement);
    external.set(1, time, displacement);
    add_loads(loading, external, time, 1);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t c = 0; c < 2; ++c)
        if (body_.holds(i, c)) fields_.force[2 * i + c] = 0;
      if (!row_.turns(i)) moment[i] = 0;
    }
    if (report.steps % kBlock == 0) {
      std::vector<double> turned(n);
      for (std::size_t i = 0; i < n; ++i) turned[i] = moment[i] / arm;
      const double residual = norm(fields_.force, turned);
      if (report.steps == 0) {
        reference = residual;
        if (!(reference > 0)) {
          report.converged = true;
          return report;
        }
      }
      report.residual = residual / reference;
      if (report.steps > 0) {
        double change = 0, size = 0, stiffness = 0, weight = 0;
        for (std::size_t i = 0; i < n; ++i) {
          for (std::size_t c = 2 * i; c < 2 * i + 2; ++c) {
            const double d = displacement[c] - before[c];
            change += d * d;
            size += displacement[c] * displacement[c];
            stiffness += d * (before_force[c] - fields_.force[c]);
            weight += d * d * mass[i];
          }
          const double d = history_[2 * i] - before_turn[i];
          stiffness += d * (before_moment[i] - moment[i]);
          weight += d * d * inertia[i];
        }
        change = std::sqrt(change);
        const double ratio = last_change > 0 ? std::min(change / last_change, 0.9999) : 0.9999;
        report.remaining_change = size > 0 ? change * ratio / (1 - ratio) / std::sqrt(size) : 0;
        last_change = change;
        const bool near = (report.residual < settings.tolerance || residual < round_off) &&
                          report.remaining_change < settings.tolerance;
        if (near && near_before) {
          row_.refuse_folded(report.steps);
          report.converged = true;
          return report;
        }
        near_before = near;
        damping = weight > 0 && stiffness > 0 ? 2 * std::sqrt(stiffness / weight) : 0;
      }
      if (report.steps >= settings.maximum_steps || !std::isfinite(energy_scale)) {
        // It may be what keeps the rest from coming to rest, and says more than that it does not.
        row_.refuse_folded(report.steps);
        return report;
      }
      dt = 0.9 / std::sqrt(row_.largest_stiffening());
      damping = std::min(damping, 1 / dt);
      before = displacement;
      before_force = fields_.force;
      before_moment = moment;
      for (std::size_t i = 0; i < n; ++i) before_turn[i] = history_[2 * i];
      monitor(-1, "shell, residual " + std::to_string(report.residual));
    }
    const double decay = (2 - damping * dt) / (2 + damping * dt), gain = 2 * dt / (2 + damping * dt);
    for (std::size_t i = 0; i < n; ++i) {
      for (std::size_t c = 0; c < 2; ++c) {
        if (body_.holds(i, c)) continue;
        velocity[2 * i + c] = decay * velocity[2 * i + c] + gain * fields_.force[2 * i + c] / mass[i];
        displacement[2 * i + c] += dt * velocity[2 * i + c];
      }
      if (!row_.turns(i)) continue;
      rate[i] = decay * rate[i] + gain * moment[i] / inertia[i];
      history_[2 * i] += dt * rate[i];
    }
  }
}

}  // namespace estuary::solid
