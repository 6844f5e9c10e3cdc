#include "solid.hpp"

#include <fmt/format.h>

#include <chrono>
#include <cmath>

#include "body_conditions.hpp"
#include "body_filling.hpp"
#include "updated_lagrangian.hpp"

namespace estuary::solid {
namespace {

using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point begin) {
  return std::chrono::duration<double>(Clock::now() - begin).count();
}

}  // namespace

Identity Solid::identity() const {
  return {.name = "solid-sph",
          .version = ESTUARY_VERSION,
          .roles = {"solid", "fluid"},
          .capabilities = {"steady", "transient", "wet-surface", "rewind", "checkpoint", "torn-surface"},
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

void Solid::build(const v1::Exchange& initial) {
  body_ = placed_ ? std::move(*placed_) : build_body(scene_);
  placed_.reset();
  driven_.reset();
  if (scene_.meets_surface) driven_.emplace(initial.wet_surface(), body_);
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
        *solver_, scene_.plane == Plane::strain &&
                      (scene_.law == LawName::neo_hooke || scene_.law == LawName::neo_hooke_isochoric));
  state_ = at_rest(body_);
  state_.history = solver_->history();
  if (scene_.mode == Mode::transient) set_velocities(scene_, body_, state_);
  if (driven_) driven_->place(initial.displacements(), state_);
  accepted_ = state_;
  work_ = {};
  step_seconds_ = transfer_seconds_ = 0;
  // Traffic of the two sweeps: per pair two indices and two weights, per particle its tensors and vectors.
  const double pairs = static_cast<double>(solver_->pairs().pairs()) / static_cast<double>(body_.size());
  const bool stabilised = scene_.stabilisation > 0;
  work_.bytes_per_update = pairs * (40 + (stabilised ? 48 : 0)) + 320;
}

v1::Exchange Solid::start(const v1::Exchange& initial, const std::filesystem::path& folder) {
  folder_ = folder;
  std::filesystem::create_directories(folder_);
  try {
    build(initial);
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
                     .region = watch.region,
                     .hold = watch.hold,
                     .held = {}};
    if (watch.hold) entry.held = held_particles(scene_, body_, *watch.hold);
    if (watch.point) {
      entry.point = *watch.point;
      // A hair outside a rigid body counts: nodes of a contour lie on its corners. Not where a shell is,
      // whose clamped end may lie on that contour.
      const bool shell = scene_.shell_at(*watch.point);
      entry.rigid = rigid_at(*watch.point, shell ? 0.0 : 0.1 * scene_.spacing);
      if (shell)
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

void Solid::keep_last_state() {
  try {
    write_particles(folder_ / "last-state.hdf");
  } catch (const std::exception&) {  // the picture is a courtesy; the diagnosis must not be lost with it
  }
}

void Solid::fail(const Breakdown& breakdown, const Window& window) {
  const std::size_t i = breakdown.particle;
  keep_last_state();
  if (!breakdown.advice.empty())
    throw Diverged(breakdown.field,
                   fmt::format("particle {} with reference position ({:.6g}, {:.6g}) m {} at step {} of "
                               "window {}, iteration {}; fields are in last-state.hdf",
                               i, body_.position[2 * i], body_.position[2 * i + 1], breakdown.what(),
                               breakdown.step, window.number, window.iteration),
                   breakdown.advice);
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
  } catch (const ThrownOut& out) {
    keep_last_state();
    throw Diverged(
        "displacement",
        fmt::format("particle {} with reference position ({:.6g}, {:.6g}) m has been thrown out: it is "
                    "{:.3g} m from there at step {} of window {}, iteration {}; fields are in "
                    "last-state.hdf",
                    out.particle, body_.position[2 * out.particle], body_.position[2 * out.particle + 1],
                    out.displacement, out.step, window.number, window.iteration),
        "use formulation = \"total_lagrangian\", which has no tensile instability, or a smaller "
        "artificial_stress or courant");
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
  if (driven_) {
    DrivenSurface::Load load = driven_->load(solver_->surface_impulse(), window.duration, state_);
    result.surface_force = {load.sum[0], load.sum[1]};
    result.surface_moment = load.moment;
    *result.outputs.mutable_forces() = std::move(load.forces);
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

void Solid::accept() {
  accepted_ = state_;
  if (scene_.window_load == WindowLoad::quadratic) earlier_forces_ = std::move(accepted_forces_);
  earlier_duration_ = duration_;
  accepted_forces_ = forces_;
}

}  // namespace estuary::solid
