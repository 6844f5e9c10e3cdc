#include "fluid.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "file_digest.hpp"
#include "watches.hpp"

namespace estuary::fluid {

Identity Fluid::identity() const {
  return {.name = "fluid-lbm",
          .version = ESTUARY_VERSION,
          .roles = {"fluid"},
          .capabilities = {"steady", "transient", "wet-surface", "viscous-traction", "grains", "rewind",
                           "checkpoint"},
          .dimensions = {2, 3}};
}

Plan Fluid::configure(Scene& scene, const std::string& role) {
  Plan plan;
  scene_ = read_fluid_scene(scene, role, plan);
  return plan;
}

// Every rank has to have its memory, or none goes on.
std::unique_ptr<Flow> Fluid::make_flow() const {
  FlowSettings settings = scene_.flow;
  evaluate_sides(scene_, 0.0, settings.sides);
  const int ranks = ranks_ == nullptr ? 1 : ranks_->count();
  if (ranks != scene_.ranks) {
    throw BadInput(
        "fluid.ranks",
        fmt::format("the scene shares its lattice among {} ranks, but this fluid runs as {}: start it "
                    "with mpirun -n {} fluid-lbm-mpi, or change fluid.ranks",
                    scene_.ranks, ranks, scene_.ranks));
  }
  if (ranks_ == nullptr) return std::make_unique<Flow>(settings);
  settings.ranks = ranks_;
  settings.grid.ranks = ranks;
  settings.grid.rank = ranks_->rank();
  std::unique_ptr<Flow> flow;
  try {
    flow = std::make_unique<Flow>(settings);
  } catch (const std::bad_alloc&) {
    flow.reset();
  }
  if (ranks_->any(flow == nullptr)) throw LackOfMemory();
  return flow;
}

// Every rank has read them, perhaps on another machine.
void Fluid::expect_same_pictures() const {
  const auto bytes = std::as_bytes(std::span(scene_.solid_nodes));
  const std::uint32_t own = crc32_of(bytes.data(), bytes.size());
  if (own != as_first_rank(ranks_, own))
    throw std::runtime_error("the pictures of obstacles here are not those that the first rank has read");
}

v1::Exchange Fluid::start(const v1::Exchange& initial, const std::filesystem::path& folder) {
  sides_constant_ = std::all_of(scene_.profiles.begin(), scene_.profiles.end(),
                                [](const SideProfile& profile) { return profile.constant_in_time(); }) &&
                    std::all_of(scene_.body_force.begin(), scene_.body_force.end(),
                                [](const Expression& force) { return force.constant_in_time(); });
  flow_ = make_flow();
  if (ranks_ != nullptr) {
    expect_same_pictures();
    looked_at_ = nodes_of_watches(scene_, flow_->grid());
  }
  output_ = std::make_unique<Output>(folder);
  if (!scene_.obstacle_connectivity.empty()) {
    flow_->set_obstacles(scene_.obstacle_positions.size() / 2, scene_.obstacle_connectivity,
                         scene_.obstacle_positions, scene_.outline_rule, scene_.obstacle_of_point);
  }
  if (!scene_.solid_nodes.empty()) {
    const bool other_walls =
        initial.has_wet_surface() || initial.has_grain_states() || !scene_.round_obstacles.empty();
    flow_->set_solid_nodes(scene_.solid_nodes, other_walls);
  }
  if (initial.has_wet_surface()) take_surface(initial);
  grains_.start(initial, flow_->grid(), scene_.units);
  bodies_ = std::make_unique<BodyMotion>(scene_);
  place_bodies(0.0, 1.0, false);
  // Steady loads are read once; over a window their mean is what counts, and moving walls make it smoother.
  flow_->measure_bodies(scene_.mode == Mode::transient ||
                        (grains_.active() && scene_.grain_method == GrainMethod::interpolated));
  if (flow_->cells().fluid_count() == 0) {
    throw BadInput("initial.wet_surface",
                   "no fluid is left: obstacles or the surface cover the whole domain, or its segments run "
                   "the wrong way round (the fluid lies to their left)");
  }
  set_initial_fields();
  if (scene_.repeats_windows) {
    window_start_.emplace();
    flow_->copy_to(*window_start_);
  }
  check_state();
  const WallCounts walls = flow_->wall_counts();
  if (walls.links > 0) spdlog::info("{} links cross walls between the nodes", walls.links);
  log_walls();
  return {};
}

// Once, and again when they have become half as many more: bodies that move may open and close gaps in every
// step.
void Fluid::log_walls() {
  const WallCounts walls = flow_->wall_counts();
  const std::size_t now = walls.fallbacks + walls.unresolved;
  if (2 * now <= 3 * fallbacks_logged_) return;
  fallbacks_logged_ = now;
  spdlog::warn(
      "step {}: of {} links to walls {} have no fluid node behind the first, as in gaps under two spacings, "
      "and follow a rule with fewer nodes (at last half-way), {} have no cut with the surface and count as "
      "half-way; refine, or take wall_rule = \"one-point\"",
      steps_, walls.links, walls.fallbacks, walls.unresolved);
}

void Fluid::set_initial_fields() {
  if (scene_.initial_velocity.empty() && !scene_.initial_pressure) return;
  const Grid& grid = flow_->grid();
  const double scale = scene_.units.velocity_to_lattice();
  // Velocities hold half of a body force, populations do not.
  const auto shift = flow_->settings().velocity_shift();
  Fields fields;
  for (auto* field : {&fields.excess, &fields.velocity_x, &fields.velocity_y}) field->resize(grid.size());
  if (grid.nz > 0) fields.velocity_z.resize(grid.size());
  for (int z = 0; z < grid.layers(); ++z) {
    for (int y = 0; y < grid.ny; ++y) {
      if (!grid.owns(y, z)) continue;
      for (int x = 0; x < grid.nx; ++x) {
        const double at_z = grid.nz > 0 ? grid.z(z) : 0.0;
        const auto velocity = [&](std::size_t axis) {
          if (axis >= scene_.initial_velocity.size()) return 0.0;
          return scale * scene_.initial_velocity[axis](grid.x(x), grid.y(y), at_z, 0) - shift[axis];
        };
        const double pressure =
            scene_.initial_pressure ? (*scene_.initial_pressure)(grid.x(x), grid.y(y), at_z, 0) : 0.0;
        const std::size_t k = grid.index(x, y, z);
        fields.excess[k] = scene_.units.excess(pressure);
        fields.velocity_x[k] = velocity(0);
        fields.velocity_y[k] = velocity(1);
        if (grid.nz > 0) fields.velocity_z[k] = velocity(2);
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
    bodies_->place(time, links ? grains_.in_step(fraction) : Grains{}, *flow_, fill);
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
  log_walls();
  AdvanceResult advanced = result();
  check_result(advanced);
  advanced.remaining_error = remaining;
  return advanced;
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
  if (watches_need_fields(scene_)) evaluate_fields();
  advanced.watches = evaluate_watches(scene_, fields_, *flow_, end_time_, total, ranks_, looked_at_);
  advanced.work = {.steps = steps_,
                   .updates = updates_,
                   .bytes_per_update = flow_->bytes_per_update(),
                   .phase_seconds = {{"collide and stream", seconds_.collide_and_stream},
                                     {"wet surface", seconds_.wet_surface},
                                     {"fields and loads", seconds_.fields_and_loads}},
                   .energy_error = {}};
  return advanced;
}

// What is given away is finite; a number that is not says that a node is bad, and it is named.
void Fluid::check_result(const AdvanceResult& advanced) {
  const auto finite = [](const auto& values) {
    return std::all_of(values.begin(), values.end(), [](double value) { return std::isfinite(value); });
  };
  const v1::Exchange& outputs = advanced.outputs;
  const bool watched =
      std::all_of(advanced.watches.begin(), advanced.watches.end(), [](const WatchValues& watch) {
        return std::all_of(watch.quantities.begin(), watch.quantities.end(),
                           [](const auto& quantity) { return std::isfinite(quantity.second); });
      });
  if (watched && finite(outputs.pressures().pressure()) && finite(outputs.pressures().viscous_traction()) &&
      finite(outputs.grain_forces().force()) && finite(outputs.grain_forces().torque()))
    return;
  check_state();
}

void Fluid::accept() {
  accepted_ = latest_;
  grains_.accept();
  time_ = end_time_;
}

std::vector<std::string> Fluid::frame(std::uint64_t number, double time) {
  evaluate_fields();
  gather_fields(ranks_, flow_->grid(), fields_);
  if (!first_rank()) return {};
  return output_->write(number, time, *flow_, fields_, scene_.units, pressure_, traction_);
}

}  // namespace estuary::fluid
