// Through a window: in motion, or to the equilibrium under its loads.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "rigid_motion.hpp"
#include "shell_row.hpp"
#include "solid.hpp"

namespace estuary::solid {
namespace {

// At least so many steps in a stretch of time with rigid bodies.
constexpr double kRigidSteps = 16;

}  // namespace

std::uint64_t Solid::steps_for(double duration) {
  if (scene_.impact()) {
    const double step = std::min(solver_->longest_step(state_, scene_.courant), rigid_step(body_, state_));
    const double steps = std::ceil(duration / step);
    if (!(steps < 1e15))
      throw Diverged("displacement", "the stable time step vanished",
                     "look at the last frames: something has become infinitely fast or stiff");
    return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(steps));
  }
  double stable = solver_->reference_stable_step();
  solver_->evaluate(state_.displacement);
  stable /= std::sqrt(solver_->steepening());
  if (const double now = solver_->longest_step(state_, 1); now > 0) stable = std::min(stable, now);
  const double stiffening = std::sqrt(std::max(1.0, solver_->stiffening()));
  // The wave through a spacing, and never beyond what the discrete operator itself allows.
  double elastic = std::min(scene_.courant_step(body_.spacing), 0.9 * stable) / stiffening;
  // Contact adds its stiffness to the contours.
  if (contact_)
    elastic = std::min(elastic, 1.8 / std::sqrt(4 * stiffening * stiffening / (stable * stable) +
                                                contact_->squared_frequency()));
  // Springs of rigid bodies are integrated exactly; that their loads vary on the way needs some steps.
  const double step =
      body_.rigid.empty() ? elastic : std::min({elastic, rigid_step(body_, state_), duration / kRigidSteps});
  const double steps = std::ceil(duration / step);
  if (!(steps < 1e15))
    throw Diverged("displacement", "the stable time step vanished: the material has become infinitely stiff",
                   "use a smaller window or a softer load");
  return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(steps));
}

// In stretches short enough that the stable step is looked at again as the state stiffens.
void Solid::integrate(const Window& window, const Monitor& monitor) {
  // Fluids stiffen within a few steps where they are hit.
  const double stretch_steps = scene_.impact() ? 25 : 200;
  state_ = accepted_;
  state_.time = window.time;
  solver_->begin_window();
  const Loading whole = loading_;
  double done = 0;
  while (done < window.duration * (1 - 1e-12)) {
    solver_->set_history(state_.history);
    const std::uint64_t all = steps_for(window.duration - done);
    const double stretches = std::max(1.0, std::round(static_cast<double>(all) / stretch_steps));
    const double duration = (window.duration - done) / stretches;
    const std::uint64_t steps =
        (all + static_cast<std::uint64_t>(stretches) - 1) / static_cast<std::uint64_t>(stretches);
    const double part = duration / window.duration;
    const auto cut = [&](const ParticleLoad& uncut, ParticleLoad& load) {
      for (std::size_t c = 0; c < load.start.size(); ++c) {
        load.start[c] = uncut.at(c, done / window.duration);
        load.end[c] = uncut.at(c, (done + duration) / window.duration);
      }
      for (std::size_t c = 0; c < load.bend.size(); ++c) load.bend[c] = part * part * uncut.bend[c];
    };
    for (std::size_t l = 0; l < loading_.loads.size(); ++l) cut(whole.loads[l], loading_.loads[l]);
    if (loading_.couples) cut(*whole.couples, *loading_.couples);
    work_.steps += steps;
    work_.updates += static_cast<double>(steps) * static_cast<double>(body_.particles());
    solver_->advance(state_, loading_, duration, steps, scene_.damping,
                     [&](double fraction, const std::string& note) {
                       monitor((done + fraction * duration) / window.duration, note);
                     });
    if (scene_.remove_isolated) remove_isolated();
    done = stretches > 1 ? done + duration : window.duration;
    state_.time = window.time + done;
  }
  for (std::size_t l = 0; l < loading_.loads.size(); ++l) {
    loading_.loads[l].start = whole.loads[l].start;
    loading_.loads[l].end = whole.loads[l].end;
    loading_.loads[l].bend = whole.loads[l].bend;
  }
  loading_.couples = whole.couples;
}

void Solid::remove_isolated() {
  solver_->cut_hanging(state_.displacement, state_.history);
  const ShellRow* rows = solver_->shells();
  for (const std::uint32_t i : solver_->isolated()) {
    if (!state_.removed.empty() && state_.removed[i] != 0) continue;
    state_.removed.resize(body_.size(), 0);
    state_.removed[i] = 1;
    double* v = &state_.velocity[2 * i];
    const double m = body_.mass[i], x = body_.position[2 * i] + state_.displacement[2 * i],
                 y = body_.position[2 * i + 1] + state_.displacement[2 * i + 1];
    Removed& lost = state_.lost;
    lost.count += 1;
    lost.mass += m;
    for (std::size_t c = 0; c < 2; ++c) lost.momentum[c] += m * v[c];
    lost.angular_momentum += m * (x * v[1] - y * v[0]);
    lost.energy += 0.5 * m * (v[0] * v[0] + v[1] * v[1]);
    v[0] = v[1] = 0;
    if (rows == nullptr) continue;
    const auto at = std::lower_bound(rows->particles().begin(), rows->particles().end(), i);
    if (at == rows->particles().end() || *at != i) continue;
    const auto k = static_cast<std::size_t>(at - rows->particles().begin());
    double& rate = state_.history[2 * k + 1];
    lost.angular_momentum += rows->inertia()[k] * rate;
    lost.energy += 0.5 * rows->inertia()[k] * rate * rate;
    rate = 0;
  }
}

double Solid::find_equilibrium(const Window& window, const Monitor& monitor) {
  const double time = window.time + window.duration;
  // A law with history starts each search from the last accepted state: it must not remember a trial.
  solver_->set_history(accepted_.history);
  std::vector<double> displacement = state_.history.empty() ? state_.displacement : accepted_.displacement;
  if (scene_.all_rigid()) return settle_rigid_bodies(time);
  EquilibriumReport report;
  // Pressures follow the surface: found again on each equilibrium until it stays.
  const int rounds = loading_.pressures.empty() || !newton_ ? 1 : 40;
  for (int round = 0; round < rounds; ++round) {
    const std::vector<double> before = displacement;
    const EquilibriumReport one = newton_
                                      ? newton_->solve(displacement, loading_, time, scene_.steady, monitor)
                                      : solver_->relax(displacement, loading_, time, scene_.steady, monitor);
    report.converged = one.converged;
    report.steps += one.steps;
    report.residual = one.residual;
    report.remaining_change = one.remaining_change;
    report.reached = one.reached;
    report.stable = one.stable;
    if (!one.converged || rounds == 1) break;
    double change = 0, size = 0;
    for (std::size_t c = 0; c < before.size(); ++c) {
      change += std::pow(displacement[c] - before[c], 2);
      size += displacement[c] * displacement[c];
    }
    report.remaining_change = size > 0 ? std::sqrt(change / size) : 0;
    report.converged = report.remaining_change <= scene_.steady.tolerance;
    if (report.converged) break;
  }
  work_.steps += report.steps;
  work_.updates += static_cast<double>(report.steps) * static_cast<double>(body_.particles());
  if (!report.converged) {
    const std::string so_far =
        newton_ ? fmt::format("found up to {:.3g} % of the load", 100 * report.reached)
                : fmt::format(
                      "residual {:.2e} of the load, estimated remaining change {:.2e} of the "
                      "displacement, wanted {:.1e}",
                      report.residual, report.remaining_change, scene_.steady.tolerance);
    throw NotConverged(fmt::format("no equilibrium after {} {}: {}", report.steps,
                                   newton_ ? "linear solves" : "steps", so_far),
                       newton_ ? "the load may be beyond what the body can carry; try [solid.steady] method "
                                 "= \"relaxation\", more "
                                 "particles_across, or a larger maximum_steps"
                               : "raise [solid.steady] maximum_steps, or use method = \"newton\"");
  }
  // On the way to a coupled equilibrium the loads are not yet those of the end; and with one increment of
  // flow, as in a pressed block of perfect plasticity, a tangent that is not positive definite says little.
  if (!report.stable && !scene_.plastic() && !scene_.accepts_unstable && !scene_.coupled)
    throw NotConverged(
        fmt::format(
            "after {} linear solves the only equilibrium found is unstable: at the least push the body would "
            "leave it",
            report.steps),
        "where it buckles or its law softens (saint_venant_kirchhoff does when compressed) "
        "try law = "
        "\"neo_hooke\", [solid.steady] method = \"relaxation\", or a smaller load; [solid.steady] unstable = "
        "\"accept\" takes it all the same");
  state_.displacement = std::move(displacement);
  if (!body_.rigid.empty()) settle_rigid_bodies(time);
  state_.time = time;
  solver_->commit(state_.displacement);
  state_.history = solver_->history();
  return std::max(report.residual, report.remaining_change);
}

double Solid::settle_rigid_bodies(double time) {
  std::vector<double> force;
  double change = 0;
  // Pressures follow the surface.
  for (int round = 0; round < 100; ++round) {
    solver_->external_force(loading_, time, state_.displacement, force);
    change = settle_rigid(body_, loading_, time, force, state_);
    if (change <= 1e-3 * scene_.steady.tolerance) break;
  }
  state_.time = time;
  ++work_.steps;
  if (!(change <= scene_.steady.tolerance))
    throw NotConverged(fmt::format("a rigid body finds no equilibrium: its position still changes by {:.2e} "
                                   "of its displacement or of a spacing",
                                   change),
                       "its springs may be too weak for loads that turn with it");
  return change;
}

}  // namespace estuary::solid
