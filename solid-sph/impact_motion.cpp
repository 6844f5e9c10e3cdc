// How bodies that meet by impulses move: forces, kicks, impulses and drifts of a step.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <limits>
#include <utility>

#include "impact.hpp"
#include "rigid_motion.hpp"

namespace estuary::solid {
namespace {

class Stopwatch {
public:
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

}  // namespace

void ImpactSolver::leave_out(const std::vector<std::uint8_t>& removed) {
  if (removed == removed_) return;
  removed_ = removed;
  inverse_mass_ = impulses_.inverse_mass();
  for (std::size_t i = 0; i < removed_.size(); ++i)
    if (removed_[i] != 0) inverse_mass_[2 * i] = inverse_mass_[2 * i + 1] = 0;
  pinball_.leave_out(removed_);
}

void ImpactSolver::open_torn() {
  std::vector<std::array<std::uint32_t, 2>> pieces = torn_surface_;
  if (rows_ && rows_->breakable()) {
    const auto broken = rows_->broken_links(row_history_);
    pieces.insert(pieces.end(), broken.begin(), broken.end());
  }
  TornContours solids = solid_ ? solid_->torn_contours() : TornContours{};
  for (const auto& [a, b] : solids.pieces) pieces.push_back({solid_particle_[a], solid_particle_[b]});
  for (std::uint32_t& i : solids.exposed) i = solid_particle_[i];
  if (!removed_.empty()) std::erase_if(solids.exposed, [&](std::uint32_t i) { return removed_[i] != 0; });
  pinball_.tear(pieces, solids.exposed);
  tears_ = solid_ ? solid_->tears() : 0;
}

// Adds the forces of shells; links that are past a limit break. Returns whether any did.
bool ImpactSolver::bend_shells(const State& state, bool commit, std::uint64_t step) {
  if (!rows_) return false;
  const std::span<const double> displacement = state.displacement;
  const auto velocity =
      rows_->viscous() ? std::span<const double>(state.velocity) : std::span<const double>{};
  std::int64_t bad =
      rows_->evaluate(displacement, row_history_, commit && rows_->remembers(), fields_, velocity);
  const bool broke = commit && rows_->breakable() && rows_->break_links(row_history_) > 0;
  if (broke) {
    open_torn();
    copy_fields();
    bad += rows_->evaluate(displacement, row_history_, false, fields_, velocity);
  }
  if (bad > 0)
    for (const std::uint32_t i : rows_->particles())
      if (!std::isfinite(fields_.force[2 * i] + fields_.force[2 * i + 1]))
        throw Breakdown(i, step, std::numeric_limits<double>::quiet_NaN());
  rows_->refuse_folded(step);
  return broke;
}

bool ImpactSolver::find_forces(State& state, double time_step, std::uint64_t step) {
  place(state.displacement);
  Stopwatch watch;
  if (!density_.empty() && (time_step > 0 || !forces_kept_)) {
    copy_out(fluid_particle_, state.velocity, fluid_velocity_);
    if (fluid_.measure(fluid_position_, fluid_velocity_, time_step, density_) > 0) {
      for (std::size_t k = 0; k < fluid_particle_.size(); ++k)
        if (!std::isfinite(fluid_position_[2 * k] + fluid_position_[2 * k + 1] + density_[k]))
          throw Breakdown(fluid_particle_[k], step, std::numeric_limits<double>::quiet_NaN());
      throw Breakdown(fluid_particle_[fluid_.first_bad()], step, "density",
                      "of a fluid has lost its volume within one step",
                      "use tension_limit = 0, with which a fluid parts where it leaves a wall instead of "
                      "hanging on, a smaller courant, or more artificial viscosity");
    }
    fluid_.find_forces(fluid_position_, fluid_velocity_, density_);
    state.viscous_work += fluid_.diffusion_work();
    forces_kept_ = true;
  }
  fluid_seconds_ += watch.seconds();
  if (solid_) {
    watch = {};
    copy_out(solid_particle_, state.velocity, solid_velocity_);
    try {
      solid_viscous_power_ = solid_->forces_in_motion(solid_displacement_, solid_velocity_, time_step, step);
    } catch (const Breakdown& breakdown) {
      throw Breakdown(solid_particle_[breakdown.particle], step, breakdown.j);
    }
    if (solid_->tears() != tears_) open_torn();
    solid_seconds_ += watch.seconds();
  }
  copy_fields();
  return bend_shells(state, time_step > 0, step);
}

// Velocities of what follows a prescribed motion, of the coming step.
void ImpactSolver::drive(State& state, const Loading& loading, double time, double time_step) {
  for (const RigidDrive& one : loading.rigid_drives) {
    double& rate = state.rigid[6 * one.rigid + 3 + one.freedom];
    const double inertia = body_.rigid[one.rigid].inertia_of(one.freedom), before = rate;
    rate = (one.displacement(time + time_step) - one.displacement(time)) / time_step;
    state.external_work += 0.5 * inertia * (rate * rate - before * before);
  }
  if (!loading.surface) return;
  const SurfaceMotion& surface = *loading.surface;
  for (std::size_t c = 0; c < surface.start.size(); ++c)
    state.velocity[2 * surface.first + c] =
        (surface.at(c, time + time_step) - surface.at(c, time)) / time_step;
}

void ImpactSolver::kick_rigid(State& state, const Loading& loading, double duration) {
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const RigidBody& rigid = body_.rigid[r];
    const std::span<double> values = std::span<double>(state.rigid).subspan(6 * r, 6);
    auto force = resultant(rigid, body_, state.displacement, external_, values);
    for (std::size_t c = 0; c < 3; ++c) {
      const double rate = values[3 + c];
      if (rigid.held[c]) continue;
      if (c < 2) force[c] += rigid.mass * loading.gravity[c];
      force[c] -= rigid.spring[c] * (values[c] - rigid.rest[c]);
      // The damper acts at the mean of both rates.
      const double inertia = rigid.inertia_of(c), half = 0.5 * duration * rigid.damper[c] / inertia;
      values[3 + c] = ((1 - half) * rate + duration * force[c] / inertia) / (1 + half);
      const double mean = 0.5 * (rate + values[3 + c]);
      state.viscous_work += rigid.damper[c] * mean * mean * duration;
    }
  }
}

void ImpactSolver::kick(State& state, const Loading& loading, const ExternalForces& external, double duration,
                        double time_step, double damping) {
  const std::size_t n = body_.size();
  external_.assign(2 * n, 0.0);
  external.add_to(external_);
  const double decay = 1 / (1 + duration * damping);
  double* v = state.velocity.data();
  collect_velocities(state, before_);
  state.viscous_work += duration * solid_viscous_power_;
  if (rows_ && rows_->viscous()) state.viscous_work += duration * rows_->viscous_power();
  const double taken = ordered_sum(n, [&](std::size_t i) {
    double lost = 0;
    for (std::size_t c = 2 * i; c < 2 * i + 2; ++c) {
      if (inverse_mass_[c] == 0) continue;
      v[c] += duration * ((fields_.force[c] + external_[c]) * inverse_mass_[c] + loading.gravity[c % 2]);
      if (damping > 0) {
        lost += 0.5 * body_.mass[i] * v[c] * v[c] * (1 - decay * decay);
        v[c] *= decay;
      }
    }
    return lost;
  });
  state.viscous_work += taken;
  kick_rigid(state, loading, duration);
  const Stopwatch watch;
  touch(state, time_step);
  contact_seconds_ += watch.seconds();
  // Work is done at the mean of the velocities before and after the kick, impulses included.
  const std::vector<double>& viscous = fluid_.viscous_force();
  state.viscous_work -= duration * ordered_sum(fluid_particle_.size(), [&](std::size_t k) {
                          const std::size_t c = 2 * fluid_particle_[k];
                          return 0.5 * (viscous[2 * k] * (before_[c] + v[c]) +
                                        viscous[2 * k + 1] * (before_[c + 1] + v[c + 1]));
                        });
}

void ImpactSolver::collect_velocities(const State& state, std::vector<double>& velocity) const {
  std::copy(state.velocity.begin(), state.velocity.end(), velocity.begin());
  for (std::size_t r = 0; r < body_.rigid.size(); ++r)
    for (std::size_t c = 0; c < 3; ++c) velocity[2 * body_.size() + 3 * r + c] = state.rigid[6 * r + 3 + c];
  const std::size_t first = fibres_first();
  for (std::size_t k = first; k < velocity.size(); ++k) velocity[k] = row_history_[2 * (k - first) + 1];
}

double ImpactSolver::coming_rate(std::size_t k, double time_step) {
  return rows_->turns(k) ? 0.5 * time_step * rows_->moments()[k] / rows_->inertia()[k] : 0;
}

// Impulses between the bodies.
void ImpactSolver::touch(State& state, double time_step) {
  const std::size_t n = body_.size();
  touching_ = false;
  pinball_.find(position_, state.rigid, time_step);
  std::vector<ContactRow>& rows = pinball_.rows();
  if (rows.empty()) return;
  collect_velocities(state, velocity_);
  // Velocities of particles are half a step ahead, those of fibres follow after the next half-kick.
  const std::size_t fibres = fibres_first(), count = velocity_.size();
  for (std::size_t k = fibres; k < count; ++k) velocity_[k] += coming_rate(k - fibres, time_step);
  impulses_.solve(rows, friction_, velocity_);
  for (std::size_t k = fibres; k < count; ++k) velocity_[k] -= coming_rate(k - fibres, time_step);
  for (const ContactRow& row : rows) {
    if (!(row.impulse > 0)) continue;
    touching_ = true;
    double twice = 0;
    for (std::uint32_t k = 0; k < row.count; ++k) {
      const std::uint32_t f = row.freedom[k];
      const double push = row.impulse * row.normal[k] + row.friction * row.tangent[k];
      twice += push * (before_[f] + velocity_[f]);
      // A body that follows its prescribed motion does work against what pushes it.
      if (f >= 2 * surface_first_ && f < 2 * n) surface_impulse_[f - 2 * surface_first_] += push;
      if (inverse_mass_[f] == 0) state.external_work -= push * 0.5 * (before_[f] + velocity_[f]);
    }
    state.contact_work -= 0.5 * twice;
    const double nx = row.direction[0], ny = row.direction[1];
    const double jx = row.impulse * nx - row.friction * ny, jy = row.impulse * ny + row.friction * nx;
    impulse_[2 * row.point_member] += jx;
    impulse_[2 * row.point_member + 1] += jy;
    impulse_[2 * row.surface_member] -= jx;
    impulse_[2 * row.surface_member + 1] -= jy;
  }
  if (!touching_) return;
  for (std::size_t c = 0; c < 2 * n; ++c)
    if (inverse_mass_[c] != 0) state.velocity[c] = velocity_[c];
  for (std::size_t r = 0; r < body_.rigid.size(); ++r)
    for (std::size_t c = 0; c < 3; ++c) state.rigid[6 * r + 3 + c] = velocity_[2 * n + 3 * r + c];
  for (std::size_t k = fibres; k < count; ++k)
    if (inverse_mass_[k] != 0) row_history_[2 * (k - fibres) + 1] = velocity_[k];
}

void ImpactSolver::drift(State& state, const Loading& loading, double time, double time_step) {
  const std::size_t n = body_.size();
  for (std::size_t c = 0; c < 2 * n; ++c)
    if (inverse_mass_[c] != 0) state.displacement[c] += time_step * state.velocity[c];
  if (loading.surface)
    for (std::size_t c = 0; c < loading.surface->start.size(); ++c)
      state.displacement[2 * loading.surface->first + c] = loading.surface->at(c, time);
  for (std::size_t r = 0; r < body_.rigid.size(); ++r) {
    const std::span<double> values = std::span<double>(state.rigid).subspan(6 * r, 6);
    for (std::size_t c = 0; c < 3; ++c)
      if (!body_.rigid[r].held[c]) {
        values[c] += time_step * values[3 + c];
        if (c < 2)
          state.external_work += body_.rigid[r].mass * loading.gravity[c] * time_step * values[3 + c];
      }
    for (const RigidDrive& one : loading.rigid_drives)
      if (one.rigid == r) values[one.freedom] = one.displacement(time);
    carry(body_.rigid[r], body_, values, state.displacement, state.velocity);
  }
}

void ImpactSolver::begin_window() {
  std::fill(impulse_.begin(), impulse_.end(), 0.0);
  std::fill(surface_impulse_.begin(), surface_impulse_.end(), 0.0);
  window_begins_ = true;
}

// Whenever one more in ten have lost a degree.
void ImpactSolver::say_degrees() {
  if (fluid_.degrees().empty()) return;
  const auto count = fluid_.degree_counts();
  bool more = false;
  for (std::size_t d = 0; d < 2; ++d) more = more || count[d] > 1.1 * said_degrees_[d];
  if (!more) return;
  for (std::size_t d = 0; d < 2; ++d) said_degrees_[d] = std::max(said_degrees_[d], count[d]);
  fmt::print(
      "moving least squares: {:.0f} particles of degree 2, {:.0f} of 1, {:.0f} of 0 (too few neighbours)\n",
      count[2], count[1], count[0]);
  std::fflush(stdout);
}

void ImpactSolver::advance(State& state, const Loading& given, double duration, std::uint64_t steps,
                           double damping, const Monitor& monitor) {
  const double dt = duration / static_cast<double>(steps), start = state.time;
  spread_history(state.history);
  leave_out(state.removed);
  torn_surface_ = given.surface ? given.surface->torn : std::vector<std::array<std::uint32_t, 2>>{};
  open_torn();
  Loading kept;
  if (rows_ && rows_->breakable()) {
    kept = given;
    rows_->drop_broken(row_history_, kept);
  }
  const Loading& loading = rows_ && rows_->breakable() ? kept : given;
  if (std::exchange(window_begins_, false)) window_begin_ = start;
  const auto gravity_work = [&] {
    return ordered_sum(body_.size(), [&](std::size_t i) {
      return body_.mass[i] * (loading.gravity[0] * state.displacement[2 * i] +
                              loading.gravity[1] * state.displacement[2 * i + 1]);
    });
  };
  state.external_work -= gravity_work();
  ExternalForces external(body_, loading);
  external.set(0.0, start, state.displacement);
  const double decay = 1 - 0.5 * damping * dt, gain = 1 / (1 + 0.5 * damping * dt);
  if (rows_ && rows_->viscous()) rows_->turn(row_history_, 0, 1, 1, true);
  find_forces(state, 0, 0);
  if (rows_) rows_->add_moments(loading, start, 0);
  drive(state, loading, start, dt);
  kick(state, loading, external, 0.5 * dt, dt, damping);
  for (std::uint64_t step = 1; step <= steps; ++step) {
    const double fraction = static_cast<double>(step) / static_cast<double>(steps);
    const double time = start + fraction * duration;
    // Rotations go with the half-steps: kicked and drifted here, kicked again below.
    if (rows_) rows_->turn(row_history_, dt, decay, gain, false);
    drift(state, loading, time, dt);
    if (rows_ && (!loading.moments.empty() || loading.couples))
      state.external_work += rows_->moment_work(
          loading, time - 0.5 * dt, fraction - 0.5 / static_cast<double>(steps), dt, row_history_);
    if (find_forces(state, dt, step)) rows_->drop_broken(row_history_, kept);
    if (rows_) {
      rows_->add_moments(loading, time, fraction);
      rows_->turn(row_history_, dt, decay, gain, true);
      if (rows_->filters()) {
        const auto [taken, work] = rows_->filter_normals(row_history_, loading, time, fraction);
        state.viscous_work += taken;
        state.external_work += work;
      }
    }
    external.set(fraction, time, state.displacement);
    state.external_work += external.work();
    drive(state, loading, time, dt);
    kick(state, loading, external, step < steps ? dt : 0.5 * dt, dt, damping);
    if (touching_) state.contact_time += dt;
    if (step % 128 == 0) monitor(fraction, "step " + std::to_string(step) + " of " + std::to_string(steps));
  }
  for (std::size_t r = 0; r < body_.rigid.size(); ++r)
    carry(body_.rigid[r], body_, std::span<const double>(state.rigid).subspan(6 * r, 6), state.displacement,
          state.velocity);
  const double since = start + duration - window_begin_;
  for (std::size_t c = 0; c < impulse_.size(); ++c) contact_force_[c] = impulse_[c] / since;
  if (loading.surface)
    std::copy(loading.surface->end_velocity.begin(), loading.surface->end_velocity.end(),
              state.velocity.begin() + 2 * static_cast<std::ptrdiff_t>(surface_first_));
  say_degrees();
  state.history = history_ = gathered_history();
  state.time = start + duration;
  state.external_work += gravity_work();
}

}  // namespace estuary::solid
