#include "solid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>

#include "rigid_motion.hpp"
#include "scene_body.hpp"
#include "updated_lagrangian.hpp"
#include "wet_surface.hpp"

namespace estuary::solid {
namespace {

using Clock = std::chrono::steady_clock;

// At least so many steps in a stretch of time with rigid bodies.
constexpr double kRigidSteps = 16;

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
          .capabilities = {"steady", "transient", "wet-surface", "rewind", "checkpoint"},
          .dimensions = {2}};
}

Plan Solid::configure(Scene& scene, const std::string& role) {
  scene_ = read_solid_scene(scene, role);
  placed_.reset();
  if (!scene.problems().empty()) return {};
  // Whether every outline can be filled and every hold and load meets something shows only with the
  // particles.
  // Many in an outline take longer to place than a check should; those are placed at the start.
  constexpr double kQuicklyPlaced = 2e4;
  double in_outlines = 0;
  for (const BodyScene& body : scene_.bodies)
    if ((body.shape == Shape::disc || body.shape == Shape::polygon) && !body.rigid)
      for (const Polygon& loop : body.outline(scene_.spacing))
        in_outlines += std::abs(signed_area(loop)) / (scene_.spacing * scene_.spacing);
  if (in_outlines > kQuicklyPlaced) return plan_of(scene_);
  SceneTable solid = scene.root().table(role);
  try {
    placed_ = build_body(scene_);
    std::vector<std::unique_ptr<Expression>> unused;
    build_loading(scene_, *placed_, unused);
  } catch (const UnmetConditions& unmet) {
    for (const auto& [table, number, message] : unmet.conditions)
      solid.tables(table)[number].problem("", message);
  } catch (const std::invalid_argument& error) {
    solid.problem("", error.what());
  }
  return scene.problems().empty() ? plan_of(scene_) : Plan{};
}

void Solid::build() {
  body_ = placed_ ? std::move(*placed_) : build_body(scene_);
  placed_.reset();
  SolverOptions options = scene_.solver_options();
  for (Material& material : options.materials) material.viscosity.smoothing_length = body_.smoothing_length;
  if (scene_.impact()) {
    solver_ = make_impact_solver(scene_, body_, options);
  } else if (scene_.shells()) {
    std::vector<ShellSection> sections;
    for (const BodyScene& body : scene_.bodies) sections.push_back(shell_section(scene_, body));
    solver_ = std::make_unique<ShellSolver>(body_, std::move(sections));
  } else if (scene_.updated_lagrangian)
    solver_ = std::make_unique<UpdatedLagrangianSolver>(body_, options);
  else
    solver_ = make_solver(scene_.law, body_, options);
  newton_.reset();
  if (scene_.mode == Mode::steady && !scene_.all_rigid() && scene_.method == SteadyMethod::newton)
    newton_ = std::make_unique<NewtonSolver>(
        *solver_, scene_.law == LawName::neo_hooke || scene_.law == LawName::neo_hooke_isochoric);
  state_ = at_rest(body_);
  state_.history = solver_->history();
  if (scene_.mode == Mode::transient) set_velocities(scene_, body_, state_);
  accepted_ = state_;
  work_ = {};
  step_seconds_ = transfer_seconds_ = 0;
  // Traffic of the two sweeps: per pair two indices and two weights, per particle its tensors and vectors.
  const double pairs = static_cast<double>(solver_->pairs().pairs()) / static_cast<double>(body_.size());
  const bool stabilised = scene_.stabilisation > 0;
  work_.bytes_per_update = pairs * (40 + (stabilised ? 48 : 0)) + 320;
}

void Solid::build_surface() {
  expressions_.clear();
  loading_ = build_loading(scene_, body_, expressions_);
  contact_.reset();
  if (scene_.contact && !scene_.impact()) contact_.emplace(body_, loading_.contact);
  wet_nodes_.clear();
  surface_.Clear();
  std::vector<ContourLine> lines;
  if (scene_.wet_contour)
    lines = free_contours(body_);
  else if (!scene_.wet.empty())
    lines.push_back(contour_line(body_, scene_.wet));
  if (lines.empty()) return;
  transfer_ = contour_transfer(body_, lines);
  ParticleLoad wet;
  wet.particle = transfer_.touched;
  wet.start.assign(2 * wet.particle.size(), 0.0);
  wet.end = wet.start;
  loading_.loads.push_back(std::move(wet));
  surface_.set_dimension(2);
  surface_.set_closed(true);
  for (const ContourLine& line : lines) {
    const std::size_t first = wet_nodes_.size() / 2;
    wet_nodes_.insert(wet_nodes_.end(), line.position.begin(), line.position.end());
    for (std::size_t s = 0; s < line.segments(); ++s) {
      surface_.add_connectivity(static_cast<std::uint32_t>(first + s));
      surface_.add_connectivity(static_cast<std::uint32_t>(first + (s + 1) % line.size()));
    }
    surface_.set_closed(surface_.closed() && line.closed);
  }
  surface_.mutable_reference_positions()->Add(wet_nodes_.begin(), wet_nodes_.end());
  surface_.set_identity(identity_of(surface_));
  forces_.assign(wet_nodes_.size(), 0.0);
  accepted_forces_ = forces_;
  earlier_forces_.clear();
}

v1::Exchange Solid::start(const v1::Exchange&, const std::filesystem::path& folder) {
  folder_ = folder;
  std::filesystem::create_directories(folder_);
  try {
    build();
    build_surface();
  } catch (const std::invalid_argument& error) {
    throw BadInput("solid", error.what());
  } catch (const std::domain_error& error) {
    throw BadInput("solid", error.what());
  }
  watches_.clear();
  for (const WatchScene& watch : scene_.watches) {
    PointWatch entry{.name = watch.name,
                     .point = {},
                     .body = watch.body,
                     .rigid = {},
                     .transfer = {},
                     .region = watch.region};
    if (watch.point) {
      entry.point = *watch.point;
      entry.rigid = rigid_at(*watch.point);
      if (scene_.shell_at(*watch.point))
        entry.transfer = row_transfer(body_, *watch.point);
      else if (!entry.rigid)
        entry.transfer = point_transfer(body_, *watch.point);
    }
    watches_.push_back(std::move(entry));
  }
  particle_series_ = std::make_unique<FieldSeries>(folder_, "frame");
  surface_series_ = std::make_unique<FieldSeries>(folder_, "surface");
  v1::Exchange brought;
  if (wet_nodes_.empty()) return brought;
  *brought.mutable_wet_surface() = surface_;
  fill_displacements(*brought.mutable_displacements());
  return brought;
}

void Solid::fill_displacements(v1::Displacements& field) const {
  field.set_surface(surface_.identity());
  const auto count = static_cast<int>(wet_nodes_.size());
  field.mutable_displacement()->Resize(count, 0.0);
  field.mutable_velocity()->Resize(count, 0.0);
  const auto n = static_cast<std::size_t>(count);
  interpolate(transfer_, state_.displacement, {field.mutable_displacement()->mutable_data(), n});
  interpolate(transfer_, state_.velocity, {field.mutable_velocity()->mutable_data(), n});
}

void Solid::take_forces(const Window& window, const v1::Exchange& inputs) {
  if (wet_nodes_.empty()) {
    if (inputs.has_forces())
      throw BadInput("inputs.forces", "forces were sent, but this solid has no wet side");
    return;
  }
  // A solid running alone is given none.
  if (scene_.coupled && !inputs.has_forces())
    throw BadInput("inputs.forces", "the forces on the wet surface are missing");
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
  duration_ = window.duration;
  std::vector<double> start = forces_, end = forces_, bend;
  if (scene_.mode == Mode::transient && scene_.window_load != WindowLoad::received) {
    const bool mean = scene_.window_load == WindowLoad::mean;
    for (std::size_t k = 0; k < end.size(); ++k) {
      start[k] = mean ? 0.5 * (accepted_forces_[k] + forces_[k]) : accepted_forces_[k];
      if (mean) end[k] = start[k];
    }
  }
  if (scene_.window_load == WindowLoad::quadratic && !earlier_forces_.empty()) {
    const double r = earlier_duration_ / duration_;
    for (std::size_t k = 0; k < end.size(); ++k)
      bend.push_back((earlier_forces_[k] - start[k] + r * (end[k] - start[k])) / (r * (r + 1)));
  }
  ParticleLoad& wet = loading_.loads.back();
  spread(transfer_, start, wet.start);
  spread(transfer_, end, wet.end);
  wet.bend.clear();
  if (!bend.empty()) spread(transfer_, bend, wet.bend);
}

std::uint64_t Solid::steps_for(double duration) {
  if (scene_.impact()) {
    solver_->evaluate(state_.displacement);
    const double step = std::min(solver_->longest_step(state_, scene_.courant), rigid_step(body_, state_));
    const double steps = std::ceil(duration / step);
    if (!(steps < 1e15))
      throw Diverged("displacement", "the stable time step vanished",
                     "look at the last frames: something has become infinitely fast or stiff");
    return std::max<std::uint64_t>(1, static_cast<std::uint64_t>(steps));
  }
  const double stable = solver_->reference_stable_step();
  solver_->evaluate(state_.displacement);
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
    for (std::size_t l = 0; l < loading_.loads.size(); ++l) {
      for (std::size_t c = 0; c < loading_.loads[l].start.size(); ++c) {
        loading_.loads[l].start[c] = whole.loads[l].at(c, done / window.duration);
        loading_.loads[l].end[c] = whole.loads[l].at(c, (done + duration) / window.duration);
      }
      for (std::size_t c = 0; c < loading_.loads[l].bend.size(); ++c)
        loading_.loads[l].bend[c] = part * part * whole.loads[l].bend[c];
    }
    work_.steps += steps;
    work_.updates += static_cast<double>(steps) * static_cast<double>(body_.particles());
    solver_->advance(state_, loading_, duration, steps, scene_.damping,
                     [&](double fraction, const std::string& note) {
                       monitor((done + fraction * duration) / window.duration, note);
                     });
    done = stretches > 1 ? done + duration : window.duration;
    state_.time = window.time + done;
  }
  for (std::size_t l = 0; l < loading_.loads.size(); ++l) {
    loading_.loads[l].start = whole.loads[l].start;
    loading_.loads[l].end = whole.loads[l].end;
    loading_.loads[l].bend = whole.loads[l].bend;
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
  take_forces(window, inputs);
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
  } catch (const ContactLost& lost) {
    throw Diverged(
        "displacement",
        fmt::format("the contour at reference position ({:.6g}, {:.6g}) m is {:.2g} spacings deep in "
                    "another body in window {}, iteration {}",
                    body_.position[2 * lost.particle], body_.position[2 * lost.particle + 1], lost.depth,
                    window.number, window.iteration),
        "raise [solid.contact] stiffness (which shortens the time step)");
  }
  step_seconds_ += seconds_since(begin);
  // No particle of a rigid body has a strain that could tell.
  for (const double value : state_.rigid)
    if (!std::isfinite(value))
      throw Diverged("displacement",
                     fmt::format("the position of a rigid body is not finite in window {}, iteration {}",
                                 window.number, window.iteration),
                     "check the forces on it, its mass and its springs");
  begin = Clock::now();
  if (solver_->evaluate(state_.displacement) > 0) {
    try {
      solver_->report_breakdown(work_.steps);
    } catch (const Breakdown& breakdown) {
      fail(breakdown, window);
    }
  }
  if (!wet_nodes_.empty()) {
    fill_displacements(*result.outputs.mutable_displacements());
    add_surface_resultants(result);
  }
  result.watches = watch_values(window.time + window.duration);
  transfer_seconds_ += seconds_since(begin);
  work_.phase_seconds = {{window.mode == Mode::transient ? "time steps" : "equilibrium", step_seconds_},
                         {"transfer", transfer_seconds_}};
  for (const auto& [phase, seconds] : solver_->phase_seconds()) {
    work_.phase_seconds.insert(work_.phase_seconds.end() - 1, {phase, seconds});
    work_.phase_seconds.front().second -= seconds;
  }
  result.work = work_;
  return result;
}

void Solid::add_surface_resultants(AdvanceResult& result) const {
  const auto& displacement = result.outputs.displacements().displacement();
  double fx = 0, fy = 0, moment = 0;
  for (std::size_t k = 0; k < wet_nodes_.size() / 2; ++k) {
    const auto c = static_cast<int>(2 * k);
    const double x = wet_nodes_[2 * k] + displacement[c], y = wet_nodes_[2 * k + 1] + displacement[c + 1];
    fx += forces_[2 * k];
    fy += forces_[2 * k + 1];
    moment += x * forces_[2 * k + 1] - y * forces_[2 * k];
  }
  result.surface_force = {fx, fy};
  result.surface_moment = moment;
}

void Solid::accept() {
  accepted_ = state_;
  if (scene_.window_load == WindowLoad::quadratic) earlier_forces_ = std::move(accepted_forces_);
  earlier_duration_ = duration_;
  accepted_forces_ = forces_;
}

}  // namespace estuary::solid
