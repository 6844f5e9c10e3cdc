#include "fluid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "checkpoint.hpp"
#include "watches.hpp"
#include "wet_surface.hpp"

namespace estuary::fluid {
namespace {

using Clock = std::chrono::steady_clock;

// Adds the time of a scope to a phase.
class Stopwatch {
public:
  explicit Stopwatch(double& seconds) : seconds_(seconds), begin_(Clock::now()) {}
  ~Stopwatch() { seconds_ += std::chrono::duration<double>(Clock::now() - begin_).count(); }
  Stopwatch(const Stopwatch&) = delete;
  Stopwatch& operator=(const Stopwatch&) = delete;

private:
  double& seconds_;
  Clock::time_point begin_;
};

// A step of the surface beyond this speed [lattice units] leaves the method's range.
constexpr double fastest_surface = 0.5;

double relative(double change, double norm) {
  return change == 0 ? 0 : std::sqrt(change / norm);
}

}  // namespace

Identity Fluid::identity() const {
  return {.name = "fluid-lbm",
          .version = ESTUARY_VERSION,
          .roles = {"fluid"},
          .capabilities = {"steady", "transient", "wet-surface", "viscous-traction", "grains", "checkpoint"},
          .dimensions = {2, 3}};
}

Plan Fluid::configure(Scene& scene, const std::string& role) {
  Plan plan;
  scene_ = read_fluid_scene(scene, role, plan);
  return plan;
}

v1::Exchange Fluid::start(const v1::Exchange& initial, const std::filesystem::path& folder) {
  sides_constant_ = std::all_of(scene_.profiles.begin(), scene_.profiles.end(),
                                [](const SideProfile& profile) { return profile.constant_in_time(); }) &&
                    std::all_of(scene_.body_force.begin(), scene_.body_force.end(),
                                [](const Expression& force) { return force.constant_in_time(); });
  FlowSettings settings = scene_.flow;
  evaluate_sides(scene_, 0.0, settings.sides);
  flow_ = std::make_unique<Flow>(settings);
  output_ = std::make_unique<Output>(folder);
  if (!scene_.obstacle_connectivity.empty()) {
    flow_->set_obstacles(scene_.obstacle_positions.size() / 2, scene_.obstacle_connectivity,
                         scene_.obstacle_positions, scene_.outline_rule);
  }
  if (!scene_.solid_nodes.empty()) flow_->set_solid_nodes(scene_.solid_nodes);
  if (initial.has_wet_surface()) take_surface(initial);
  grains_.start(initial, flow_->grid(), scene_.units);
  bodies_ = std::make_unique<BodyMotion>(scene_);
  place_bodies(0.0, 1.0, false);
  // Steady loads are read once; over a window their mean is what counts, and moving walls make it smoother.
  flow_->measure_bodies(scene_.mode == Mode::transient ||
                        (grains_.active() && scene_.grain_method == GrainMethod::interpolated));
  if (flow_->cells().fluid_count() == 0) {
    throw BadInput("initial.wet_surface",
                   "no fluid is left: the surface encloses the whole domain, or its segments run "
                   "the wrong way round (the fluid lies to their left)");
  }
  set_initial_fields();
  if (scene_.has_partner && scene_.mode == Mode::transient) {
    window_start_.emplace();
    flow_->copy_to(*window_start_);
  }
  evaluate_fields();
  check_state();
  return {};
}

void Fluid::set_initial_fields() {
  if (scene_.initial_velocity.empty() && !scene_.initial_pressure) return;
  const Grid& grid = flow_->grid();
  const double scale = scene_.units.velocity_to_lattice();
  // Velocities hold half of a body force, populations do not.
  const auto shift = flow_->settings().velocity_shift();
  Fields fields;
  for (int z = 0; z < grid.layers(); ++z) {
    for (int y = 0; y < grid.ny; ++y) {
      for (int x = 0; x < grid.nx; ++x) {
        const double at_z = grid.nz > 0 ? grid.z(z) : 0.0;
        const auto velocity = [&](std::size_t axis) {
          if (axis >= scene_.initial_velocity.size()) return 0.0;
          return scale * scene_.initial_velocity[axis](grid.x(x), grid.y(y), at_z, 0) - shift[axis];
        };
        const double pressure =
            scene_.initial_pressure ? (*scene_.initial_pressure)(grid.x(x), grid.y(y), at_z, 0) : 0.0;
        fields.excess.push_back(scene_.units.excess(pressure));
        fields.velocity_x.push_back(velocity(0));
        fields.velocity_y.push_back(velocity(1));
        if (grid.nz > 0) fields.velocity_z.push_back(velocity(2));
      }
    }
  }
  set_equilibrium(flow_->populations(), fields, flow_->settings().equilibrium);
}

void Fluid::place_bodies(double time, double fraction, bool fill) {
  const bool saturated = grains_.active() && scene_.grain_method == GrainMethod::partially_saturated;
  if (saturated) flow_->place_grains(grains_.after_step(fraction));
  const bool links = grains_.active() && !saturated;
  if (links || bodies_->obstacle_count() > 0) {
    bodies_->place(time, links ? grains_.at(fraction) : Grains{}, *flow_, fill);
  }
}

void Fluid::restart_body_loads() {
  flow_->grains().restart_loads();
  flow_->bodies().restart_loads();
}

GrainLoads Fluid::grain_loads() const {
  if (scene_.grain_method == GrainMethod::partially_saturated) return flow_->grains().mean_loads();
  GrainLoads loads = flow_->bodies().mean_loads();
  const auto obstacles = static_cast<std::ptrdiff_t>(bodies_->obstacle_count());
  const int dimension = scene_.dimension();
  loads.force.erase(loads.force.begin(), loads.force.begin() + obstacles * dimension);
  loads.torque.erase(loads.torque.begin(), loads.torque.begin() + obstacles * (dimension == 3 ? 3 : 1));
  return loads;
}

void Fluid::set_time(double time) {
  if (sides_constant_) return;
  evaluate_sides(scene_, time, flow_->sides());
  if (!scene_.body_force.empty()) flow_->set_acceleration(evaluate_body_force(scene_, time));
}

void Fluid::take_surface(const v1::Exchange& initial) {
  check_wet_surface(initial.wet_surface());
  surface_ = initial.wet_surface();
  if (surface_.dimension() != 2)
    throw BadInput("initial.wet_surface.dimension", "this fluid works in two dimensions");
  flow_->set_wet_surface(
      node_count(surface_), {surface_.connectivity().begin(), surface_.connectivity().end()},
      scene_.mode == Mode::steady ? EdgeLinks::Extent::everywhere : EdgeLinks::Extent::edges);
  accepted_.displacement.assign(static_cast<std::size_t>(surface_.reference_positions_size()), 0.0);
  accepted_.velocity = accepted_.displacement;
  if (initial.has_displacements()) accepted_ = motion_of(initial);
  latest_ = accepted_;
  move_surface(accepted_);
}

Fluid::Motion Fluid::motion_of(const v1::Exchange& inputs) const {
  if (!flow_->wet_surface()) return {};
  if (!inputs.has_displacements()) {
    throw BadInput("inputs.displacements", "the motion of the wet surface is missing");
  }
  const auto& field = inputs.displacements();
  check_displacements(field, surface_);
  Motion motion{{field.displacement().begin(), field.displacement().end()},
                {field.velocity().begin(), field.velocity().end()}};
  if (scene_.mode == Mode::steady) motion.velocity.assign(motion.velocity.size(), 0.0);
  const double scale = scene_.units.velocity_to_lattice();
  for (std::size_t k = 0; k < motion.velocity.size(); ++k) {
    if (std::abs(motion.velocity[k]) * scale < fastest_surface) continue;
    throw Diverged(
        "inputs.displacements.velocity",
        fmt::format("node {} of the wet surface moves with {:g} m/s, {:.2g} spacings per time step", k / 2,
                    motion.velocity[k], motion.velocity[k] * scale),
        "relax the coupling more, shorten the window, or raise fluid.reference_velocity");
  }
  return motion;
}

void Fluid::move_surface(const Motion& motion) {
  const Stopwatch stopwatch(seconds_.wet_surface);
  const auto& reference = surface_.reference_positions();
  std::vector<double> positions(motion.displacement.size());
  for (std::size_t k = 0; k < positions.size(); ++k) {
    positions[k] = reference[static_cast<int>(k)] + motion.displacement[k];
  }
  flow_->move_wet_surface(positions, motion.velocity, scene_.units.velocity_to_lattice());
  wet_load_stale_ = true;
}

// Position by cubic Hermite interpolation between the window's ends, so that it moves off and arrives with
// their velocities; the wall's velocity linearly between them. The cubic's own derivative overshoots when
// displacement and velocity of an iterate do not belong together, and feeds that back into the solid.
void Fluid::move_inside_window(const Motion& end, double s, double duration) {
  if (s >= 1) {
    move_surface(end);
    return;
  }
  const double h00 = (1 + 2 * s) * (1 - s) * (1 - s);
  const double h10 = s * (1 - s) * (1 - s) * duration;
  const double h01 = s * s * (3 - 2 * s);
  const double h11 = s * s * (s - 1) * duration;
  Motion now{std::vector<double>(end.displacement.size()), std::vector<double>(end.displacement.size())};
  for (std::size_t k = 0; k < end.displacement.size(); ++k) {
    const double d0 = accepted_.displacement[k];
    const double d1 = end.displacement[k];
    const double v0 = accepted_.velocity[k];
    const double v1 = end.velocity[k];
    now.displacement[k] = h00 * d0 + h10 * v0 + h01 * d1 + h11 * v1;
    now.velocity[k] = (1 - s) * v0 + s * v1;
  }
  move_surface(now);
}

void Fluid::give_back(const Flow::State& state) {
  std::vector<double> positions(accepted_.displacement.size());
  for (std::size_t k = 0; k < positions.size(); ++k) {
    positions[k] = surface_.reference_positions(static_cast<int>(k)) + accepted_.displacement[k];
  }
  flow_->give_back(state, positions, accepted_.velocity, scene_.units.velocity_to_lattice());
  wet_load_stale_ = true;
}

AdvanceResult Fluid::advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) {
  if (window.mode != scene_.mode) throw BadInput("mode", "differs from the scene's coupling mode");
  const Motion end = motion_of(inputs);
  grains_.take(inputs, window.duration, scene_.mode == Mode::steady);
  double remaining = 0;
  if (scene_.mode == Mode::steady) {
    remaining = advance_steady(window, end, progress);
  } else {
    advance_transient(window, end, progress);
  }
  latest_ = end;
  AdvanceResult advanced = result();
  advanced.remaining_error = remaining;
  return advanced;
}

void Fluid::advance_transient(const Window& window, const Motion& end, ProgressBoard& progress) {
  const double exact = window.duration / scene_.units.time_step;
  const double rounded = std::round(exact);
  if (rounded < 1 || std::abs(exact - rounded) > 1e-6 * rounded) {
    throw BadInput("duration", fmt::format("a window of {:g} s is not a whole number of time steps of {:g} s",
                                           window.duration, scene_.units.time_step));
  }
  if (window.iteration > 1) {
    if (!window_start_)
      throw BadInput("header.iteration", "no partner in the scene, so windows are not repeated");
    place_bodies(window.time, 0.0, false);
    give_back(*window_start_);
  } else if (window_start_) {
    flow_->copy_to(*window_start_);
  }
  time_ = window.time;
  end_time_ = window.time + window.duration;
  place_bodies(window.time, 0.0, true);
  restart_body_loads();
  set_time(window.time);
  const auto steps = static_cast<std::size_t>(rounded);
  const bool resting = end.displacement == accepted_.displacement && end.velocity == accepted_.velocity &&
                       std::all_of(end.velocity.begin(), end.velocity.end(), [](double v) { return v == 0; });
  const bool all_fixed = resting && sides_constant_ && grains_.resting() && bodies_->fixed();
  auto reported = Clock::now();
  for (std::size_t done = 0; done < steps;) {
    const std::size_t count = all_fixed ? std::min(steps - done, steps_at_once()) : 1;
    run(count);
    done += count;
    const double fraction = static_cast<double>(done) / rounded;
    if (!resting) move_inside_window(end, done == steps ? 1.0 : fraction, window.duration);
    const double time = done == steps ? end_time_ : window.time + window.duration * fraction;
    if (!all_fixed) place_bodies(time, done == steps ? 1.0 : fraction, true);
    set_time(time);
    if (Clock::now() - reported > std::chrono::milliseconds(100)) {
      check_progress(progress, fraction, fmt::format("step {} of {}", done, steps));
      evaluate_fields();
      check_state();
      reported = Clock::now();
    }
  }
  evaluate_fields();
  check_state();
  evaluate_loads();
}

double Fluid::advance_steady(const Window& window, const Motion& end, ProgressBoard& progress) {
  if (!end.displacement.empty()) move_surface(end);
  place_bodies(0.0, 1.0, true);
  const auto between = static_cast<std::uint64_t>(steps_between_checks(flow_->grid().nx, flow_->grid().ny));
  evaluate_fields();
  update_velocities(fields_, flow_->cells(), previous_x_, previous_y_, previous_z_);
  previous_load_.clear();
  evaluate_loads();
  load_change();
  RemainingChange of_flow;
  RemainingChange of_load;
  int satisfied = 0;
  double first = 0;
  const std::uint64_t begin = steps_;
  while (true) {
    restart_body_loads();
    for (std::uint64_t done = 0; done < between;) {
      const std::size_t count = std::min<std::uint64_t>(between - done, steps_at_once());
      run(count);
      done += count;
      check_progress(progress, -1, {});
    }
    evaluate_fields();
    check_state();
    evaluate_loads();
    const VelocityChange change =
        update_velocities(fields_, flow_->cells(), previous_x_, previous_y_, previous_z_);
    of_flow.add(relative(change.change, change.norm));
    of_load.add(load_change());
    const double remaining = std::max(of_flow.estimate(), of_load.estimate());
    satisfied = remaining < scene_.steady_tolerance ? satisfied + 1 : 0;
    if (satisfied == 2) return remaining;
    if (first == 0 && std::isfinite(remaining)) first = remaining;
    const double fraction =
        first > scene_.steady_tolerance && std::isfinite(remaining)
            ? std::clamp(std::log(first / remaining) / std::log(first / scene_.steady_tolerance), 0.0, 1.0)
            : -1;
    const std::uint64_t steps = steps_ - begin;
    check_progress(progress, fraction,
                   std::isfinite(remaining) ? fmt::format("step {}, change left {:.2g}", steps, remaining)
                                            : fmt::format("step {}", steps));
    if (steps >= scene_.steady_maximum_steps) {
      throw NotConverged(
          fmt::format(
              "the flow is not steady after {} steps (iteration {}): estimated relative change left {:.3g}, "
              "tolerance {:.3g}",
              steps, window.iteration, remaining, scene_.steady_tolerance),
          "raise fluid.steady.maximum_steps or fluid.steady.tolerance; when the change does not shrink the "
          "flow may have no "
          "steady state at this Reynolds number: use coupling.mode = \"transient\"");
    }
  }
}

void Fluid::run(std::size_t steps) {
  const Stopwatch stopwatch(seconds_.collide_and_stream);
  flow_->run(steps);
  steps_ += steps;
  updates_ += static_cast<double>(steps) * static_cast<double>(flow_->cells().fluid_count());
}

// About a tenth of a second's worth, so that a stop or a report is never late.
std::size_t Fluid::steps_at_once() const {
  const auto nodes = static_cast<double>(flow_->cells().fluid_count());
  const double per_second = updates_ > 20 * nodes ? updates_ / seconds_.collide_and_stream : 2e7;
  return static_cast<std::size_t>(std::clamp(0.1 * per_second / nodes, 1.0, 1e6));
}

void Fluid::check_progress(ProgressBoard& progress, double fraction, const std::string& note) {
  progress.report(fraction, note);
  if (progress.stop_requested()) throw Interrupted();
}

void Fluid::evaluate_fields() {
  const Stopwatch stopwatch(seconds_.fields_and_loads);
  flow_->compute_fields(fields_);
}

void Fluid::evaluate_loads() {
  if (!flow_->wet_surface()) return;
  const Stopwatch stopwatch(seconds_.fields_and_loads);
  if (wet_load_stale_) {
    wet_load_.build(*flow_->wet_surface(), flow_->cells());
    wet_load_stale_ = false;
  }
  wet_load_.evaluate(flow_->populations(), scene_.flow.equilibrium, scene_.flow.rates, pressure_,
                     scene_.viscous_traction ? &traction_ : nullptr);
  if (scene_.match_force) {
    const Grid& grid = flow_->grid();
    match_total(*flow_->wet_surface(), flow_->wet_force(), !grid.periodic_x && !grid.periodic_y, pressure_,
                traction_);
  }
}

// Relative L2 change of the load since the last call.
double Fluid::load_change() {
  if (!flow_->wet_surface()) return 0;
  std::vector<double> load = pressure_;
  load.insert(load.end(), traction_.begin(), traction_.end());
  double change = 0;
  double norm = 0;
  for (std::size_t k = 0; k < load.size() && k < previous_load_.size(); ++k) {
    change += (load[k] - previous_load_[k]) * (load[k] - previous_load_[k]);
    norm += load[k] * load[k];
  }
  previous_load_ = std::move(load);
  return relative(change, norm);
}

void Fluid::check_state() {
  const auto bad = find_bad_node(fields_, flow_->cells());
  if (!bad) return;
  const Grid& grid = flow_->grid();
  std::string saved;
  try {
    saved = output_->write_diverged(*flow_, fields_, scene_.units);
  } catch (const std::exception& error) {
    saved = fmt::format("nowhere: {}", error.what());
  }
  throw Diverged(
      "velocity",
      fmt::format("{} at cell ({}, {}, {}), x = {:g} m, y = {:g} m, z = {:g} m, step {}; last fields in {}",
                  bad->finite ? fmt::format("speed {:.3g} m/s (Mach {:.2g})",
                                            bad->speed / scene_.units.velocity_to_lattice(),
                                            bad->speed * std::sqrt(3.0))
                              : std::string("a value that is not finite"),
                  bad->node.x, bad->node.y, bad->node.z, grid.x(bad->node.x), grid.y(bad->node.y),
                  grid.nz > 0 ? grid.z(bad->node.z) : 0.0, steps_, saved),
      fmt::format("the relaxation time is {:.4g}: use a finer spacing, a smaller fluid.lattice_velocity, or "
                  "check that the "
                  "velocities at the sides and of the wet surface stay near fluid.reference_velocity",
                  scene_.units.relaxation_time()));
}

AdvanceResult Fluid::result() {
  AdvanceResult advanced;
  BodyLoad total;
  if (flow_->wet_surface()) {
    auto& field = *advanced.outputs.mutable_pressures();
    field.set_surface(surface_.identity());
    const double stress = scene_.units.stress();
    for (const double p : pressure_) field.add_pressure(p * stress);
    if (scene_.viscous_traction) {
      for (const double t : traction_) field.add_viscous_traction(t * stress);
    }
    const Force force = flow_->wet_force();
    total.force = {force.x, force.y, 0.0};
    const Grid& grid = flow_->grid();
    const double fx = force.x * scene_.units.force();
    const double fy = force.y * scene_.units.force();
    advanced.surface_force = {fx, fy};
    advanced.surface_moment =
        force.moment * scene_.units.force() * grid.spacing + grid.x0 * fy - grid.y0 * fx;
  }
  if (flow_->obstacles()) {
    const Force fixed = flow_->obstacle_force();
    total.force[0] += fixed.x;
    total.force[1] += fixed.y;
  }
  const auto add = [&](const BodyLoad& load) {
    for (std::size_t axis = 0; axis < 3; ++axis) total.force[axis] += load.force[axis];
  };
  for (std::size_t body = 0; body < bodies_->obstacle_count(); ++body) add(flow_->body_load(body));
  if (!scene_.solid_nodes.empty()) add(flow_->solid_nodes_load());
  if (grains_.active())
    grains_.write(grain_loads(), scene_.grain_method == GrainMethod::partially_saturated, advanced.outputs);
  advanced.watches = evaluate_watches(scene_, fields_, *flow_, end_time_, total);
  advanced.work = {.steps = steps_,
                   .updates = updates_,
                   .bytes_per_update = flow_->bytes_per_update(),
                   .phase_seconds = {{"collide and stream", seconds_.collide_and_stream},
                                     {"wet surface", seconds_.wet_surface},
                                     {"fields and loads", seconds_.fields_and_loads}}};
  return advanced;
}

void Fluid::accept() {
  accepted_ = latest_;
  grains_.accept();
  time_ = end_time_;
}

void Fluid::save(const std::filesystem::path& file) {
  CheckpointWriter writer(file);
  Flow::State state;
  flow_->copy_to(state);
  writer.add("populations", state.populations);
  if (!state.body_memory.empty()) writer.add("memory of bodies' walls", state.body_memory);
  if (!state.outline_memory.empty()) writer.add("memory of outlines' walls", state.outline_memory);
  if (!state.grain_loads.empty()) writer.add("loads of grains", state.grain_loads);
  writer.add("parity", std::uint64_t{state.parity == Parity::odd});
  writer.add("rules applied", std::uint64_t{state.rules_applied});
  writer.add("steps", steps_);
  writer.add("updates", std::vector<double>{updates_});
  grains_.save(writer);
  writer.add("time", std::vector<double>{time_});
  if (flow_->wet_surface()) {
    writer.add("displacement", accepted_.displacement);
    writer.add("velocity", accepted_.velocity);
  }
  for (const SideName name : {left, right, bottom, top, back, front}) {
    const Side& side = flow_->sides()[name];
    std::vector<double> values = side.velocity_x;
    values.insert(values.end(), side.velocity_y.begin(), side.velocity_y.end());
    values.insert(values.end(), side.velocity_z.begin(), side.velocity_z.end());
    values.insert(values.end(), side.excess.begin(), side.excess.end());
    if (!values.empty()) writer.add(std::string("side ") + side_names[name], values);
  }
  writer.commit();
}

void Fluid::load(const std::filesystem::path& file) {
  const CheckpointReader reader(file);
  Flow::State state;
  flow_->copy_to(state);
  reader.read("populations", state.populations);
  if (!state.body_memory.empty()) state.body_memory = reader.read_all("memory of bodies' walls");
  if (!state.outline_memory.empty()) state.outline_memory = reader.read_all("memory of outlines' walls");
  if (!state.grain_loads.empty()) state.grain_loads = reader.read_all("loads of grains");
  state.parity = reader.read_count("parity") == 1 ? Parity::odd : Parity::even;
  state.rules_applied = state.sides_complete = reader.read_count("rules applied") == 1;
  steps_ = reader.read_count("steps");
  updates_ = reader.read_all("updates").at(0);
  for (const SideName name : {left, right, bottom, top, back, front}) {
    Side& side = flow_->sides()[name];
    std::vector<double> values(side.velocity_x.size() + side.velocity_y.size() + side.velocity_z.size() +
                               side.excess.size());
    if (values.empty()) continue;
    reader.read(std::string("side ") + side_names[name], values);
    auto from = values.begin();
    for (auto* to : {&side.velocity_x, &side.velocity_y, &side.velocity_z, &side.excess}) {
      const auto past = from + static_cast<std::ptrdiff_t>(to->size());
      std::copy(from, past, to->begin());
      from = past;
    }
  }
  if (flow_->wet_surface()) {
    reader.read("displacement", accepted_.displacement);
    reader.read("velocity", accepted_.velocity);
    latest_ = accepted_;
  }
  grains_.load(reader);
  time_ = end_time_ = reader.read_all("time").at(0);
  place_bodies(time_, 1.0, false);
  restart_body_loads();
  set_time(time_);
  give_back(state);
  evaluate_fields();
  evaluate_loads();
}

std::vector<std::string> Fluid::frame(std::uint64_t number, double time) {
  return output_->write(number, time, *flow_, fields_, scene_.units, pressure_, traction_);
}

}  // namespace estuary::fluid
