// What a person should know about a scene of grains before running it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "deposit.hpp"
#include "grains.hpp"
#include "placement.hpp"
#include "sample.hpp"

namespace estuary::grains {
namespace {

const char* friction_name(const GrainsScene& scene) {
  switch (scene.law.friction) {
    case FrictionLaw::none:
      return "frictionless";
    case FrictionLaw::coulomb:
      return "coulomb";
    case FrictionLaw::spring:
      return "friction-spring";
  }
  return "";
}

std::string variant_of(const GrainsScene& scene) {
  std::string text = scene.dimension == 2 ? "discs" : "spheres";
  text += scene.law.normal == NormalLaw::hertz ? "-hertz-" : "-linear-";
  text += friction_name(scene);
  if (scene.law.rolling == RollingLaw::viscous) text += "-rolling-viscous";
  if (scene.law.rolling == RollingLaw::spring) text += "-rolling-spring";
  if (scene.law.cohesive) text += "-cohesive";
  return text;
}

std::string walls_of(const GrainsScene& scene) {
  std::size_t planes = 0, polylines = 0, meshes = 0, segments = 0, triangles = 0, moving = 0;
  for (const WallScene& wall : scene.walls) {
    if (!wall.velocity.empty() || !wall.spin.empty()) ++moving;
    if (!wall.polyline.empty()) {
      ++polylines;
      segments += wall.polyline.size() / 2 - (wall.closed ? 0 : 1);
    } else if (!wall.mesh.triangle.empty()) {
      ++meshes;
      triangles += wall.mesh.triangle.size() / 3;
    } else {
      ++planes;
    }
  }
  std::vector<std::string> parts;
  const auto add = [&](std::size_t count, const char* one, const char* many, const std::string& of) {
    if (count > 0) parts.push_back(fmt::format("{} {}{}", count, count == 1 ? one : many, of));
  };
  add(planes, "plane", "planes", "");
  add(polylines, "polyline", "polylines", fmt::format(" of {} segments", segments));
  add(meshes, "mesh", "meshes", fmt::format(" of {} triangles", triangles));
  add(moving, "of them moves", "of them move", "");
  return fmt::format("{}", fmt::join(parts, ", "));
}

// The first wall at which lubrication does not act.
std::string walls_without_film(const GrainsScene& scene) {
  for (const WallScene& wall : scene.walls)
    if (!wall.is_plane()) return fmt::format("the wall '{}'", wall.name);
  return scene.coupled_to_solid ? "the solid" : "";
}

// Places the grains, which says when they do not fit.
template <int D>
void check_beginning(const GrainsScene& scene, Plan& plan) {
  const InitialGrains<D> grains = initial_grains<D>(scene);
  const DynamicsSettings<D> settings = dynamics_settings<D>(scene, grains);
  const std::vector<Wall<D>> walls = scene_walls<D>(scene);
  check_placement(settings, walls, grains);
  constexpr double kNoticeable = 0.02;
  const DeepestOverlap deepest = deepest_overlap(settings, grains);
  if (deepest.depth > kNoticeable && !scene.deposit.active)
    plan.warnings.push_back(fmt::format(
        "grains {} and {} begin with an overlap of {:.2g} radii of the smaller one: they are pushed apart",
        deepest.first, deepest.second, deepest.depth));
  if (scene.deposit.active) return;
  const DeepestInWall in_wall = deepest_in_wall(walls, grains);
  if (in_wall.depth > kNoticeable)
    plan.warnings.push_back(
        fmt::format("grain {} begins {:.2g} of its radius deep in the wall '{}': it is pushed out",
                    in_wall.grain, in_wall.depth, in_wall.wall));
}

// What the grains say of the fluid and of their box against the fluid's own table.
void check_against_fluid(const GrainsScene& scene, double smallest, bool any_moves, Plan& plan) {
  const FluidScene& fluid = scene.fluid;
  if (fluid.present && fluid.lattice_density && std::abs(fluid.density / *fluid.lattice_density - 1) > 1e-6)
    plan.warnings.push_back(
        fmt::format("[grains.fluid] density is {:g}, that of [fluid] {:g}: the weight is reduced by that of "
                    "another fluid",
                    fluid.density, *fluid.lattice_density));
  if (fluid.spacing && *fluid.spacing > 0 && 2 * smallest < 4 * *fluid.spacing)
    plan.warnings.push_back(
        fmt::format("the smallest grain is {:.2g} of the fluid's spacings across: below 4 it falls too fast "
                    "(README, resolution)",
                    2 * smallest / *fluid.spacing));
  if (!any_moves) return;
  if (fluid.may_resound) {
    const double steps = scene.window / *fluid.time_step;
    plan.warnings.push_back(
        steps > 1.5
            ? fmt::format(
                  "grains about as heavy as the fluid or lighter, and {:.3g} steps of the fluid between "
                  "exchanges: sound may grow with what the exchange delays; coupling.window = {:g} "
                  "exchanges at every step",
                  steps, *fluid.time_step)
            : "grains lighter than 0.9 of the fluid in partially saturated cells: sound may grow with what "
              "the exchange delays; fluid.grains = \"interpolated\" bears grains from 0.3 of its density on");
  }
  constexpr std::array<char, 3> axes{'x', 'y', 'z'};
  for (std::size_t c = 0; c < scene.axes(); ++c) {
    if (!fluid.periodic[c] || *fluid.periodic[c] == scene.periodic[c]) continue;
    plan.warnings.push_back(scene.periodic[c]
                                ? fmt::format("grains are periodic along {0}, the fluid is not: one that "
                                              "leaves at a side comes back at the "
                                              "other one through no fluid",
                                              axes[c])
                                : fmt::format("the fluid is periodic along {0}, the grains are not: they do "
                                              "not touch across these sides; "
                                              "give `periodic = [\"{0}\"]` and a box as long as the fluid",
                                              axes[c]));
  }
}

}  // namespace

Plan plan_of(const GrainsScene& scene) {
  Plan plan;
  const auto add = [&](const char* name, std::string value) {
    plan.derived.emplace_back(name, std::move(value));
  };
  double smallest = std::numeric_limits<double>::infinity(), largest = 0;
  double lightest = smallest, mass = 0, volume = 0;
  std::size_t count = 0, held = 0;
  for (const GroupScene& group : scene.groups) {
    std::vector<double> position, radii;
    if (group.kind == GroupScene::Kind::file)
      read_sample(group.file, scene.dimension, position, radii);
    else if (!group.radii.empty())
      radii = group.radii;
    else
      radii = draw_radii(group.grading, count_grains(group, scene.dimension), group.seed, scene.dimension);
    count += radii.size();
    if (group.held) held += radii.size();
    for (const double r : radii) {
      const double v = grain_volume(scene.dimension, r);
      smallest = std::min(smallest, r);
      largest = std::max(largest, r);
      lightest = std::min(lightest, v * group.density);
      if (group.held) continue;
      mass += v * group.density;
      volume += v;
    }
  }
  if (scene.dimension == 2)
    check_beginning<2>(scene, plan);
  else
    check_beginning<3>(scene, plan);
  for (const WatchScene& watch : scene.watches)
    if (watch.kind == WatchKind::grain && watch.grain >= count) throw UnknownGrain(watch, count);
  const StepLimit limit = step_limit_of(scene, lightest, smallest);
  const double steps = std::floor(scene.window / limit.step) + 1;
  const auto n = static_cast<double>(count);
  add("grains", held > 0 ? fmt::format("{} ({} of them held)", count, held) : fmt::format("{}", count));
  add("radii", fmt::format("{:.4g} to {:.4g} m", smallest, largest));
  add("mass of the moving grains", fmt::format("{:.6g} kg{}", mass, scene.dimension == 2 ? "/m" : ""));
  add("shortest contact", fmt::format("{:.3g} s", limit.contact_time));
  add("time step", fmt::format("at most {:.3g} s, by {}", limit.step, limit.by));
  if (!scene.steady) add("steps per window", fmt::format("{:.0f} of {:.3g} s", steps, scene.window / steps));
  if (scene.law.normal == NormalLaw::linear && scene.restitution < 1)
    add("restitution", fmt::format("{:g} uncut, {:.4f} with the force cut at zero", scene.restitution,
                                   cut_restitution(scene.restitution)));
  double gravity = 0;
  for (const double g : scene.gravity) gravity += g * g;
  gravity = std::sqrt(gravity);
  if (scene.fluid.present) {
    if (scene.fluid.reduced_gravity) {
      add("buoyancy", "weight reduced by that of the fluid displaced; the fluid must not be given gravity");
      add("submerged weight", fmt::format("{:.6g} N{}", (mass - scene.fluid.density * volume) * gravity,
                                          scene.dimension == 2 ? "/m" : ""));
    } else {
      add("buoyancy",
          "by the fluid's own pressure: the fluid must be given gravity; the grains keep theirs whole");
    }
  }
  if (!scene.from.empty() && volume > 0) {
    double box = 1;
    for (std::size_t c = 0; c < scene.axes(); ++c) box *= scene.to[c] - scene.from[c];
    add("solid share of the box", fmt::format("{:.4g}", volume / box));
  }
  plan.expected_updates = n * steps * std::max(1.0, std::round(scene.end_time / scene.window));
  plan.memory_bytes = n * (scene.dimension == 2 ? 500 : 900);

  if (limit.contact_time / limit.step < 10)
    plan.warnings.push_back(
        fmt::format("{:.3g} steps per contact: below 10 the restitution is wrong and energy may grow",
                    limit.contact_time / limit.step));
  if (scene.law.friction == FrictionLaw::coulomb)
    plan.warnings.emplace_back(
        "friction_law = \"coulomb\" has no memory: resting grains chatter; use \"spring\" for heaps and slow "
        "flows");
  if (scene.law.normal == NormalLaw::linear && gravity > 0 && scene.dimension >= 2) {
    // Overlap of a grain under the weight of a column of the sample's height.
    const double width = 2 * largest;
    const double overlap = mass / std::max(1.0, std::pow(n, 1.0 - 1.0 / scene.dimension)) * gravity /
                           scene.constants.normal_stiffness / width;
    if (overlap > 0.01)
      plan.warnings.push_back(fmt::format(
          "a column of grains presses the lowest by about {:.2g} diameters: raise normal_stiffness",
          overlap));
  }
  if (scene.coupled_to_fluid) check_against_fluid(scene, smallest, held < count && !scene.deposit.hold, plan);
  if (scene.coupled_to_fluid && !scene.fluid.present)
    plan.warnings.emplace_back(
        "a fluid takes part, but [grains.fluid] does not say how it carries the grains: "
        "gravity acts in full and no buoyancy is added");
  if (scene.coupled_to_fluid && scene.fluid.present) {
    const bool driven = !scene.fluid.acceleration.empty();
    if (scene.fluid.reduced_gravity && scene.fluid.has_body_force && !driven)
      plan.warnings.emplace_back(
          "[fluid] body_force does not reach the grains: where it drives the flow give [grains.fluid] "
          "acceleration the same, where it is gravity buoyancy = \"pressure\" (the weight is reduced "
          "already)");
    if (scene.fluid.reduced_gravity && !scene.fluid.has_body_force && driven)
      plan.warnings.emplace_back(
          "[grains.fluid] acceleration drives the grains as a body force on the fluid would, and [fluid] has "
          "no "
          "body_force");
    if (!scene.fluid.reduced_gravity && !scene.fluid.has_body_force && gravity > 0)
      plan.warnings.emplace_back(
          "buoyancy = \"pressure\", and [fluid] has no body_force: nothing carries the grains; give it "
          "gravity, "
          "or leave buoyancy at \"reduced_gravity\"");
    if (!scene.fluid.reduced_gravity && driven)
      plan.warnings.emplace_back(
          "buoyancy = \"pressure\" and [grains.fluid] acceleration: the pressure of a fluid at rest under "
          "its "
          "body_force carries the grains already; give acceleration only where it drives a flow");
  }
  if (scene.contact_margin > 0)
    add("contact margin",
        fmt::format("grains touch {:.3g} m before their surfaces meet", 2 * scene.contact_margin));

  if (scene.law.friction == FrictionLaw::none) plan.left_out.emplace_back("friction (coefficient 0)");
  if (scene.law.rolling == RollingLaw::none) plan.left_out.emplace_back("rolling resistance");
  if (!scene.law.cohesive) plan.left_out.emplace_back("cohesion");
  if (!scene.bond.active) plan.left_out.emplace_back("bonds");
  if (scene.lubrication.active())
    add("lubrication", fmt::format("below {:.3g} m between grains and at planes", scene.lubrication.cutoff));
  else
    plan.left_out.emplace_back("lubrication");
  if (const std::string bare = walls_without_film(scene); scene.lubrication.active() && !bare.empty())
    plan.warnings.push_back(
        fmt::format("lubrication acts between grains and at planes, not at polylines, meshes and wet "
                    "surfaces: {} has none",
                    bare));
  if (scene.cement.model == CementScene::Model::none)
    plan.left_out.emplace_back("cement");
  else if (!scene.coupled_to_fluid)
    plan.warnings.emplace_back(
        "cement acts on the fluid, and no fluid takes part; grains are glued by [grains.bond]");
  if (scene.walls.empty())
    plan.left_out.emplace_back("walls");
  else
    add("walls", walls_of(scene));
  if (gravity == 0) plan.left_out.emplace_back("gravity");
  if (scene.fluid.virtual_mass > 0 && scene.coupled_to_fluid)
    add("virtual mass", scene.fluid.virtual_mass_over_radius > 0
                            ? fmt::format("{:.3g} m over the radius of the fluid displaced, at most {:g}",
                                          scene.fluid.virtual_mass_over_radius, scene.fluid.virtual_mass)
                            : fmt::format("{:g} of the fluid displaced", scene.fluid.virtual_mass));
  else if (scene.coupled_to_fluid)
    plan.left_out.emplace_back("virtual mass: the grains outweigh the fluid");
  if (scene.fluid.lead > 0 && scene.coupled_to_fluid)
    add("forces carried on", fmt::format("by {:g} windows", scene.fluid.lead));
  if (!scene.repeats_windows)
    plan.left_out.emplace_back("copies of the window's start: no window is repeated");
  plan.variant = variant_of(scene);
  return plan;
}

}  // namespace estuary::grains
