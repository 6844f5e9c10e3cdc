#include "grains_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "scene_sections.hpp"

namespace estuary::grains {
namespace {

void read_material(SceneTable& grains, GrainsScene& result) {
  result.density = grains.number("density", Range::positive());
  constexpr std::array<std::string_view, 2> normals{"linear", "hertz"};
  result.law.normal = grains.choice("normal_law", normals) == "hertz" ? NormalLaw::hertz : NormalLaw::linear;
  result.restitution = grains.number("restitution", {.minimum = 1e-6, .maximum = 1});
  ContactConstants& c = result.constants;
  if (result.law.normal == NormalLaw::hertz) {
    if (result.dimension == 2)
      grains.problem("normal_law", "\"hertz\" is the law of spheres: use \"linear\" in two dimensions");
    result.young_modulus = grains.number("young_modulus", Range::positive());
    result.poisson_ratio = grains.number("poisson_ratio", {.minimum = -0.99, .maximum = 0.5});
    // A Hertz contact lasts the longer the slower it is: the step needs a speed.
    result.impact_speed = grains.number("impact_speed", Range::positive());
    if (grains.has("normal_stiffness"))
      grains.problem("normal_stiffness", "is for the linear law; Hertz takes `young_modulus`");
  } else {
    c.normal_stiffness = grains.number("normal_stiffness", Range::positive());
    for (const char* key : {"young_modulus", "poisson_ratio", "impact_speed"})
      if (grains.has(key)) grains.problem(key, "is for normal_law = \"hertz\"");
  }
  c.friction = grains.number_or("friction", 0, Range::not_negative());
  constexpr std::array<std::string_view, 2> frictions{"spring", "coulomb"};
  const bool coulomb = grains.choice("friction_law", frictions) == "coulomb";
  result.law.friction = coulomb ? FrictionLaw::coulomb : FrictionLaw::spring;
  c.tangential_stiffness = grains.number_or("tangential_stiffness_ratio", 2.0 / 7, {1e-6, 10});
  c.tangential_damping = grains.number_or("tangential_damping_ratio", 0.5, {0, 10});
  constexpr std::array<std::string_view, 3> rollings{"none", "viscous", "spring"};
  const std::string rolling = grains.choice("rolling_law", rollings);
  result.law.rolling = rolling == "viscous"  ? RollingLaw::viscous
                       : rolling == "spring" ? RollingLaw::spring
                                             : RollingLaw::none;
  if (result.law.rolling != RollingLaw::none) {
    c.rolling_friction = grains.number("rolling_friction", Range::not_negative());
    c.pivoting_friction = grains.number_or("pivoting_friction", c.rolling_friction, Range::not_negative());
    c.rolling_damping = result.law.rolling == RollingLaw::viscous
                            ? grains.number("rolling_damping", Range::positive())
                            : grains.number_or("rolling_damping", 0.3, {0, 10});
    c.rolling_stiffness = grains.number_or("rolling_stiffness_ratio", 0.5, {1e-6, 10});
  } else {
    for (const char* key :
         {"rolling_friction", "pivoting_friction", "rolling_damping", "rolling_stiffness_ratio"})
      if (grains.has(key)) grains.problem(key, "has no meaning without `rolling_law`");
    grains.leave_to_others(
        {"rolling_friction", "pivoting_friction", "rolling_damping", "rolling_stiffness_ratio"});
  }
  c.cohesion = grains.number_or("cohesion", 0, Range::not_negative());
  result.law.cohesive = c.cohesion > 0;
  const double normal_stiffness =
      result.law.normal == NormalLaw::hertz
          ? 4.0 / 3 * result.young_modulus / (2 * (1 - result.poisson_ratio * result.poisson_ratio))
          : c.normal_stiffness;
  if (result.law.normal == NormalLaw::hertz) {
    c.normal_stiffness = normal_stiffness;
    // 8 G*, G* = G / (2 (2 - nu)), G = E / (2 (1 + nu)).
    c.tangential_stiffness =
        2 * result.young_modulus / ((1 + result.poisson_ratio) * (2 - result.poisson_ratio));
  } else {
    c.tangential_stiffness *= c.normal_stiffness;
  }
  c.rolling_stiffness *= normal_stiffness;
  c = with_material(result, c.friction, result.restitution);
}

// How the delay of an explicit exchange is met; `density` of the lightest grain that moves, in fluid
// densities. The limits were found from the force on a disc after a step of its velocity (README, "Fluid").
void read_answer(SceneTable& table, double density, GrainsScene& result) {
  FluidScene& fluid = result.fluid;
  const bool explicitly = result.coupled_to_fluid && !result.steady && !result.repeats_windows;
  const bool every_step =
      explicitly && fluid.time_step && std::abs(*fluid.time_step - result.window) < 1e-6 * result.window;
  fluid.may_resound = explicitly && fluid.time_step && density < (every_step ? 0.9 : 1.5) &&
                      !(every_step && fluid.interpolated);
  double mass = 0, over_radius = 0, lead = 0;
  if (every_step && density < 2 && fluid.interpolated && fluid.spacing) {
    // What the links of a wall answer at once falls with the spacings across.
    mass = 1;
    over_radius = 1.2 * *fluid.spacing;
    lead = 1;
  } else if (every_step && density < 2 && density >= 0.9 && !fluid.interpolated) {
    mass = 0.3;
    lead = 0.5;
  } else if (result.coupled_to_fluid && density < 1.2) {
    // Partially saturated cells carry the mass of the fluid inside along: the lightest need more. No more
    // than is needed: with stiff springs (contacts, fluid closed in between grains) the delay of C m_f feeds
    // vibrations.
    mass = density < 0.5 ? 4 : density < 0.9 ? 1 : 0.5;
  }
  fluid.virtual_mass_over_radius = table.has("virtual_mass") ? 0 : over_radius;
  fluid.virtual_mass = table.number_or("virtual_mass", mass, {0, 100});
  fluid.lead = table.number_or("lead", lead, {0, 2});
  if (fluid.lead > 0 && result.repeats_windows)
    table.problem("lead", "windows are repeated until forces and motion fit: leave it out");
}

void read_fluid(SceneTable& grains, GrainsScene& result) {
  auto fluid = grains.table_if("fluid");
  if (!fluid) return;
  result.fluid.present = true;
  result.fluid.density = fluid->number("density", Range::positive());
  constexpr std::array<std::string_view, 2> buoyancies{"reduced_gravity", "pressure"};
  result.fluid.reduced_gravity = fluid->choice("buoyancy", buoyancies) == "reduced_gravity";
  result.fluid.acceleration = motion_of(*fluid, "acceleration", result.axes());
  const auto zero = [](const std::string& text) {
    char* end = nullptr;
    return std::strtod(text.c_str(), &end) == 0 && *end == '\0';
  };
  if (std::all_of(result.fluid.acceleration.begin(), result.fluid.acceleration.end(), zero))
    result.fluid.acceleration.clear();
  // Explicit exchange needs it where the fluid that a grain pushes outweighs the grain.
  double lightest = std::numeric_limits<double>::infinity();
  for (const GroupScene& group : result.groups)
    if (!group.held) lightest = std::min(lightest, group.density);
  read_answer(*fluid, lightest / result.fluid.density, result);
}

// Of the fluid's own table, which its participant judges.
void read_beside(SceneTable& fluid, GrainsScene& result) {
  result.fluid.has_body_force = fluid.has("body_force");
  if (fluid.has("density")) result.fluid.lattice_density = fluid.number("density");
  if (fluid.has("spacing")) result.fluid.spacing = fluid.number("spacing");
  if (fluid.has("time_step")) result.fluid.time_step = fluid.number("time_step");
  result.fluid.interpolated = fluid.has("grains") && fluid.text("grains") == "interpolated";
  auto sides = fluid.table_if("sides");
  if (!sides) return;
  constexpr std::array<const char*, 3> low{"left", "bottom", "back"};
  for (std::size_t c = 0; c < result.axes(); ++c)
    if (auto side = sides->table_if(low[c]); side && side->has("type"))
      result.fluid.periodic[c] = side->text("type") == "periodic";
}

void read_lubrication(SceneTable& grains, GrainsScene& result) {
  result.lubrication.margin = result.contact_margin;
  auto table = grains.table_if("lubrication");
  if (!table) return;
  result.lubrication.viscosity = table->number("viscosity", Range::positive());
  result.lubrication.cutoff = table->number("cutoff", Range::positive());
  result.lubrication.minimum_gap = table->number("minimum_gap", Range::positive());
  if (result.lubrication.minimum_gap >= result.lubrication.cutoff)
    table->problem("minimum_gap", "must be smaller than `cutoff`");
}

void read_bond(SceneTable& grains, GrainsScene& result) {
  auto table = grains.table_if("bond");
  if (!table) return;
  result.bond.active = true;
  result.bond.distance = table->number_or("distance", 0, Range::not_negative());
  result.bond.normal_stiffness = table->number("normal_stiffness", Range::positive());
  result.bond.shear_stiffness = table->number("shear_stiffness", Range::positive());
  result.bond.radius_ratio = table->number_or("radius_ratio", 1, {1e-3, 10});
  result.bond.tensile_strength = table->number_or("tensile_strength", 1e300, Range::positive());
  result.bond.shear_strength = table->number_or("shear_strength", 1e300, Range::positive());
  result.bond.damping = table->number_or("damping", 0.1, {0, 1});
}

void read_watches(SceneTable& root, const std::string& role, GrainsScene& result) {
  const std::size_t d = result.axes();
  for (SceneTable& table : root.tables("watch")) {
    if (table.text_or("participant", "") != role) continue;
    WatchScene watch;
    watch.name = table.text("name");
    for (const char* key : {"point", "line", "samples"})
      if (table.has(key))
        table.problem(key, "grains are watched by `grain`, `wall` or a region `from`, `to`");
    if (table.has("grain")) {
      watch.kind = WatchKind::grain;
      watch.grain = static_cast<std::size_t>(table.integer("grain", 0, 1'000'000'000));
    } else if (table.has("wall")) {
      watch.kind = WatchKind::wall;
      watch.wall = table.text("wall");
      const bool known = std::any_of(result.walls.begin(), result.walls.end(),
                                     [&](const WallScene& wall) { return wall.name == watch.wall; });
      if (!known) table.problem("wall", fmt::format("there is no wall named '{}'", watch.wall));
    } else if (table.has("from") || table.has("to")) {
      watch.kind = WatchKind::region;
      watch.from = table.numbers("from", d);
      watch.to = table.numbers("to", d);
      for (std::size_t c = 0; c < std::min(watch.from.size(), watch.to.size()); ++c)
        if (!(watch.to[c] > watch.from[c])) table.problem("to", "must lie beyond `from`");
    }
    result.watches.push_back(std::move(watch));
  }
}

}  // namespace

ContactConstants with_material(const GrainsScene& scene, double friction, double restitution) {
  ContactConstants c = scene.constants;
  c.friction = friction;
  // A spring of friction coefficient 0 would never stretch.
  c.inverse_tangential_stiffness = c.tangential_stiffness > 0 ? 1 / c.tangential_stiffness : 0;
  const double ratio = linear_damping_ratio(restitution);
  // Hertz: nu_n = 2 sqrt(5/6) zeta sqrt(m* S_n), zeta the share of the critical damping of a linear contact.
  c.damping = scene.law.normal == NormalLaw::hertz ? std::sqrt(5.0 / 6) * ratio
                                                   : ratio * std::sqrt(c.normal_stiffness);
  return c;
}

GrainsScene read_grains_scene(Scene& scene, const std::string& role) {
  GrainsScene result;
  SceneTable root = scene.root();
  result.dimension = static_cast<int>(root.integer_or("dimension", 2, 2, 3));
  result.coupled_to_fluid = root.has("fluid");
  if (auto fluid = root.table_if("fluid")) read_beside(*fluid, result);
  result.coupled_to_solid = root.has("solid");
  if (auto coupling = root.table_if("coupling")) {
    result.steady = coupling->text_or("mode", "steady") == "steady";
    if (!result.steady) {
      result.window = coupling->number("window", Range::positive());
      result.end_time = coupling->number("end_time", Range::positive());
    } else if (!result.coupled_to_fluid || result.coupled_to_solid) {
      coupling->problem("mode", "grains move in time: use mode = \"transient\" with `window` and `end_time`");
    }
    result.repeats_windows = result.coupled_to_solid && !result.steady &&
                             coupling->text_or("scheme", "serial-implicit") != "serial-explicit";
  } else {
    root.problem("",
                 "grains move in time: add [coupling] with mode = \"transient\", `window` and `end_time`");
  }
  SceneTable grains = root.table(role);
  grains.leave_to_others({"solver", "connect", "threads"});
  read_material(grains, result);
  result.gravity = vector_or(grains, "gravity", result.axes(), 0);
  read_box(grains, result);
  read_walls(grains, result);
  result.solid_constants = result.constants;
  result.contact_margin = grains.number_or("contact_margin", 0, Range::not_negative());
  if (grains.has("skin")) result.skin = grains.number("skin", Range::positive());
  constexpr std::array<std::string_view, 2> integrators{"verlet", "gear"};
  result.integrator =
      grains.choice("integrator", integrators) == "gear" ? Integrator::gear : Integrator::verlet;
  result.gear_terms = static_cast<int>(grains.integer_or("gear_terms", 5, 3, 6));
  result.gear_corrections = static_cast<int>(grains.integer_or("gear_corrections", 1, 1, 100));
  result.steps_per_contact = grains.number_or("steps_per_contact", 20, {1, 1e6});
  if (grains.has("time_step")) result.time_step = grains.number("time_step", Range::positive());
  read_groups(grains, result);
  read_fluid(grains, result);
  read_lubrication(grains, result);
  read_bond(grains, result);
  read_deposit(grains, result);
  read_watches(root, role, result);
  const bool all_held =
      result.deposit.hold || std::all_of(result.groups.begin(), result.groups.end(),
                                         [](const GroupScene& group) { return group.held; });
  read_cement(grains, all_held, result);
  if (result.steady && result.coupled_to_fluid && !all_held)
    grains.problem("",
                   "in a steady flow grains stay where they are: hold every group (`held`), or "
                   "[grains.deposit] with `hold`");
  if (result.integrator == Integrator::gear && result.repeats_windows)
    grains.problem("integrator", "\"gear\" cannot repeat windows: use \"verlet\" with implicit coupling");
  grains.refuse_unknown_keys();
  return result;
}

}  // namespace estuary::grains
