#include "solid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

#include "wet_surface.hpp"

namespace estuary::solid {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

// Fowler-Noll-Vo hash of everything a receiver relies on.
std::uint64_t identity_of(const v1::WetSurface& surface) {
  std::uint64_t hash = 1469598103934665603ULL;
  const auto mix = [&](std::uint64_t bits) {
    for (int byte = 0; byte < 8; ++byte, bits >>= 8) hash = (hash ^ (bits & 0xff)) * 1099511628211ULL;
  };
  for (const double x : surface.reference_positions()) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof bits);
    mix(bits);
  }
  for (const auto node : surface.connectivity()) mix(node);
  mix(surface.closed() ? 1 : 0);
  return hash == 0 ? 1 : hash;
}

}  // namespace

Identity Solid::identity() const {
  return {.name = "solid-sph",
          .version = ESTUARY_VERSION,
          .roles = {"solid"},
          .capabilities = {"steady", "transient", "wet-surface"},
          .dimensions = {2}};
}

Plan Solid::configure(Scene& scene, const std::string& role) {
  scene_ = read_solid_scene(scene, role);
  return scene.problems().empty() ? plan_of(scene_) : Plan{};
}

void Solid::build() {
  body_ = fill(scene_.box, scene_.density, scene_.smoothing_ratio, scene_.order == Order::quadratic);
  SolverOptions options = scene_.solver_options();
  options.viscosity.smoothing_length = body_.smoothing_length;
  solver_ = make_solver(scene_.law, body_, options);
  newton_.reset();
  if (scene_.mode == Mode::steady && scene_.method == SteadyMethod::newton)
    newton_ = std::make_unique<NewtonSolver>(*solver_);
  state_ = accepted_ = at_rest(body_);
  work_ = {};
  step_seconds_ = transfer_seconds_ = 0;
  // Traffic of the two sweeps: per pair two indices and two weights, per particle its tensors and vectors.
  const double pairs = static_cast<double>(solver_->pairs().pairs()) / static_cast<double>(body_.size());
  const bool stabilised = scene_.stabilisation > 0;
  work_.bytes_per_update = pairs * (40 + (stabilised ? 48 : 0)) + 320;
}

void Solid::build_loads() {
  loading_ = {};
  loading_.gravity = scene_.gravity;
  loading_.held = scene_.held;
  ramps_.clear();
  line_ = {};
  surface_.Clear();
  if (!scene_.wet.empty()) {
    line_ = contour_line(body_, scene_.wet);
    transfer_ = contour_transfer(body_, line_);
    ParticleLoad wet;
    wet.particle = transfer_.touched;
    wet.start.assign(2 * wet.particle.size(), 0.0);
    wet.end = wet.start;
    loading_.loads.push_back(std::move(wet));
    surface_.set_dimension(2);
    surface_.mutable_reference_positions()->Add(line_.position.begin(), line_.position.end());
    for (std::size_t s = 0; s < line_.segments(); ++s) {
      surface_.add_connectivity(static_cast<std::uint32_t>(s));
      surface_.add_connectivity(static_cast<std::uint32_t>((s + 1) % line_.size()));
    }
    surface_.set_closed(line_.closed);
    surface_.set_identity(identity_of(surface_));
    forces_.assign(2 * line_.size(), 0.0);
    accepted_forces_ = forces_;
  }
  for (const SideLoadScene& side : scene_.loads) {
    const ContourLine line = contour_line(body_, {&side.side, 1});
    const Transfer transfer = contour_transfer(body_, line);
    ParticleLoad load;
    load.particle = transfer.touched;
    spread(transfer, uniform_traction(line, side.force[0], side.force[1]), load.end);
    load.start = load.end;
    if (!side.ramp.empty()) {
      ramps_.push_back(std::make_unique<Expression>(side.ramp));
      load.factor = [ramp = ramps_.back().get()](double t) { return (*ramp)(0, 0, 0, t); };
    }
    loading_.loads.push_back(std::move(load));
  }
}

v1::Exchange Solid::start(const v1::Exchange&, const std::filesystem::path& folder) {
  folder_ = folder;
  std::filesystem::create_directories(folder_);
  build();
  build_loads();
  watches_.clear();
  for (const WatchScene& watch : scene_.watches) {
    PointWatch entry{watch.name, std::nullopt};
    if (watch.point) entry.transfer = point_transfer(body_, *watch.point);
    watches_.push_back(std::move(entry));
  }
  particle_series_ = std::make_unique<FieldSeries>(folder_, "frame");
  surface_series_ = std::make_unique<FieldSeries>(folder_, "surface");
  v1::Exchange brought;
  if (line_.position.empty()) return brought;
  *brought.mutable_wet_surface() = surface_;
  fill_displacements(*brought.mutable_displacements());
  return brought;
}

void Solid::fill_displacements(v1::Displacements& field) const {
  field.set_surface(surface_.identity());
  const auto count = static_cast<int>(2 * line_.size());
  field.mutable_displacement()->Resize(count, 0.0);
  field.mutable_velocity()->Resize(count, 0.0);
  const auto n = static_cast<std::size_t>(count);
  interpolate(transfer_, state_.displacement, {field.mutable_displacement()->mutable_data(), n});
  interpolate(transfer_, state_.velocity, {field.mutable_velocity()->mutable_data(), n});
}

void Solid::take_forces(const v1::Exchange& inputs) {
  if (line_.position.empty()) {
    if (inputs.has_forces())
      throw BadInput("inputs.forces", "forces were sent, but this solid has no wet side");
    return;
  }
  // A solid running alone is given none.
  if (inputs.has_forces()) {
    try {
      check_forces(inputs.forces(), surface_);
    } catch (const std::invalid_argument& error) {
      throw BadInput("inputs.forces", error.what());
    }
    forces_.assign(inputs.forces().force().begin(), inputs.forces().force().end());
  } else {
    std::fill(forces_.begin(), forces_.end(), 0.0);
  }
  // By default the mean of the loads at both ends acts through the whole window. It makes the same impulse as
  // a load that changes linearly, but on a body much softer than what pushes it (a closed fluid layer) it is
  // the method of constant average acceleration, stable for any window, where the ramp is that of linear
  // acceleration, which is not. A partner that sends the mean of its own window wants it unchanged.
  std::vector<double> start = forces_, end = forces_;
  if (scene_.mode == Mode::transient && scene_.window_load != WindowLoad::received)
    for (std::size_t k = 0; k < end.size(); ++k) {
      const bool linear = scene_.window_load == WindowLoad::linear;
      start[k] = linear ? accepted_forces_[k] : 0.5 * (accepted_forces_[k] + forces_[k]);
      if (!linear) end[k] = start[k];
    }
  ParticleLoad& wet = loading_.loads.front();
  spread(transfer_, start, wet.start);
  spread(transfer_, end, wet.end);
}

std::uint64_t Solid::steps_for(double duration) {
  const double stable = solver_->reference_stable_step();
  solver_->evaluate(state_.displacement);
  const double stiffening = std::sqrt(std::max(1.0, solver_->stiffening()));
  // The wave through a spacing, and never beyond what the discrete operator itself allows.
  const double step = std::min(scene_.courant_step(body_.spacing), 0.9 * stable) / stiffening;
  const double steps = std::ceil(duration / step);
  if (!(steps < 1e15))
    throw Diverged("displacement", "the stable time step vanished: the material has become infinitely stiff",
                   "use a smaller window or a softer load");
  return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(steps));
}

void Solid::integrate(const Window& window, const Monitor& monitor) {
  state_ = accepted_;
  state_.time = window.time;
  const std::uint64_t steps = steps_for(window.duration);
  work_.steps += steps;
  work_.updates += static_cast<double>(steps) * static_cast<double>(body_.size());
  solver_->advance(state_, loading_, window.duration, steps, scene_.damping, monitor);
}

double Solid::find_equilibrium(const Window& window, const Monitor& monitor) {
  const double time = window.time + window.duration;
  std::vector<double> displacement = state_.displacement;
  const EquilibriumReport report = newton_
                                       ? newton_->solve(displacement, loading_, time, scene_.steady, monitor)
                                       : solver_->relax(displacement, loading_, time, scene_.steady, monitor);
  work_.steps += report.steps;
  work_.updates += static_cast<double>(report.steps) * static_cast<double>(body_.size());
  if (!report.converged) {
    throw NotConverged(fmt::format("no equilibrium after {} {}: residual {:.2e} of the load, estimated "
                                   "remaining change {:.2e} of the "
                                   "displacement, wanted {:.1e}",
                                   report.steps, newton_ ? "linear solves" : "steps", report.residual,
                                   report.remaining_change, scene_.steady.tolerance),
                       newton_ ? "the load may be beyond what the body can carry; try [solid.steady] method "
                                 "= \"relaxation\", more "
                                 "particles_across, or a larger maximum_steps"
                               : "raise [solid.steady] maximum_steps, or use method = \"newton\"");
  }
  state_.displacement = std::move(displacement);
  state_.time = time;
  return std::max(report.residual, report.remaining_change);
}

void Solid::fail(const Breakdown& breakdown, const Window& window) {
  const std::size_t i = breakdown.particle;
  try {
    write_particles(folder_ / "last-state.hdf");
  } catch (
      const std::exception&) {  // the picture is a courtesy; the diagnosis below must not be lost with it
  }
  const bool finite = std::isfinite(breakdown.j);
  throw Diverged(
      finite ? "deformation_gradient" : "displacement",
      fmt::format(
          "particle {} with reference position ({:.6g}, {:.6g}) m is {} (J = {:.3g}) at step {} of window "
          "{}, iteration {}; fields are in last-state.hdf",
          i, body_.position[2 * i], body_.position[2 * i + 1], finite ? "turned inside out" : "not finite",
          breakdown.j, breakdown.step, window.number, window.iteration),
      scene_.mode == Mode::transient
          ? "use a smaller courant, artificial viscosity or stabilisation, or the neo_hooke law, which "
            "resists collapse"
          : "apply a smaller load, or use the neo_hooke law, which resists collapse");
}

AdvanceResult Solid::advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) {
  if (!std::isfinite(window.time) || !std::isfinite(window.duration) ||
      (window.mode == Mode::transient && !(window.duration > 0)))
    throw BadInput("advance.duration", "a window needs a finite start and a positive, finite length");
  if (window.mode != scene_.mode)
    throw BadInput("advance.mode", "the scene this solid was configured for has the other coupling mode");
  auto begin = Clock::now();
  take_forces(inputs);
  transfer_seconds_ += seconds_since(begin);
  const Monitor monitor = [&](double fraction, const std::string& note) {
    progress.report(fraction, note);
    if (progress.stop_requested()) throw Interrupted();
  };
  AdvanceResult result;
  begin = Clock::now();
  try {
    if (window.mode == Mode::transient)
      integrate(window, monitor);
    else
      result.remaining_error = find_equilibrium(window, monitor);
  } catch (const Breakdown& breakdown) {
    fail(breakdown, window);
  }
  step_seconds_ += seconds_since(begin);
  begin = Clock::now();
  if (solver_->evaluate(state_.displacement) > 0) {
    try {
      solver_->report_breakdown(work_.steps);
    } catch (const Breakdown& breakdown) {
      fail(breakdown, window);
    }
  }
  if (!line_.position.empty()) {
    fill_displacements(*result.outputs.mutable_displacements());
    add_surface_resultants(result);
  }
  result.watches = watch_values(window.time + window.duration);
  transfer_seconds_ += seconds_since(begin);
  work_.phase_seconds = {{window.mode == Mode::transient ? "time steps" : "equilibrium", step_seconds_},
                         {"transfer", transfer_seconds_}};
  result.work = work_;
  return result;
}

void Solid::add_surface_resultants(AdvanceResult& result) const {
  const auto& displacement = result.outputs.displacements().displacement();
  double fx = 0, fy = 0, moment = 0;
  for (std::size_t k = 0; k < line_.size(); ++k) {
    const auto c = static_cast<int>(2 * k);
    const double x = line_.position[2 * k] + displacement[c],
                 y = line_.position[2 * k + 1] + displacement[c + 1];
    fx += forces_[2 * k];
    fy += forces_[2 * k + 1];
    moment += x * forces_[2 * k + 1] - y * forces_[2 * k];
  }
  result.surface_force = {fx, fy};
  result.surface_moment = moment;
}

std::array<double, 2> Solid::reaction(double time) {
  std::vector<double> external;
  solver_->external_force(loading_, time, external);
  std::array<double, 2> sum{};
  for (std::size_t i = 0; i < body_.size(); ++i)
    if (body_.fixed[i])
      for (std::size_t c = 0; c < 2; ++c) sum[c] -= solver_->fields().force[2 * i + c] + external[2 * i + c];
  return sum;
}

std::vector<WatchValues> Solid::watch_values(double time) {
  std::vector<WatchValues> values;
  for (const PointWatch& watch : watches_) {
    WatchValues entry{watch.name, {}};
    if (watch.transfer) {
      std::array<double, 2> u{}, v{};
      interpolate(*watch.transfer, state_.displacement, u);
      interpolate(*watch.transfer, state_.velocity, v);
      entry.quantities = {{"displacement_x", u[0]},
                          {"displacement_y", u[1]},
                          {"displacement", std::hypot(u[0], u[1])},
                          {"velocity_x", v[0]},
                          {"velocity_y", v[1]}};
    } else {
      double largest = 0;
      for (std::size_t i = 0; i < body_.size(); ++i)
        largest = std::max(largest, std::hypot(state_.displacement[2 * i], state_.displacement[2 * i + 1]));
      const auto force = reaction(time);
      entry.quantities = {{"kinetic_energy", solver_->kinetic_energy(state_)},
                          {"internal_energy", solver_->energy(state_.displacement)},
                          {"maximum_displacement", largest},
                          {"reaction_x", force[0]},
                          {"reaction_y", force[1]}};
      // An equilibrium is found without following the path on which the load did its work.
      if (scene_.mode == Mode::transient)
        entry.quantities.emplace_back("external_work", state_.external_work);
    }
    values.push_back(std::move(entry));
  }
  return values;
}

void Solid::accept() {
  accepted_ = state_;
  accepted_forces_ = forces_;
}

}  // namespace estuary::solid
