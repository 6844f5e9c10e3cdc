#include "grains_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "expression.hpp"

namespace estuary::grains {
namespace {

constexpr std::array<std::string_view, 3> kAxes{"x", "y", "z"};
constexpr std::array<std::string_view, 6> kSides{"left", "right", "bottom", "top", "back", "front"};

std::vector<double> vector_or(SceneTable& table, std::string_view key, std::size_t size, double fallback) {
  if (!table.has(key)) return std::vector<double>(size, fallback);
  auto values = table.numbers(key, size);
  values.resize(size, fallback);
  return values;
}

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

Grading read_grading(SceneTable& group) {
  Grading grading;
  if (group.has("radius")) {
    grading.minimum = grading.maximum = group.number("radius", Range::positive());
    return grading;
  }
  auto table = group.table_if("grading");
  if (!table) {
    group.problem("radius", "give `radius`, or a table `grading`");
    return grading;
  }
  constexpr std::array<std::string_view, 2> laws{"uniform", "beta"};
  grading.law = table->choice("law", laws) == "beta" ? Grading::Law::beta : Grading::Law::uniform;
  grading.minimum = table->number("minimum_radius", Range::positive());
  grading.maximum = table->number("maximum_radius", Range::positive());
  if (grading.maximum < grading.minimum) table->problem("maximum_radius", "is smaller than `minimum_radius`");
  if (grading.law == Grading::Law::beta) {
    grading.a = table->number_or("a", 2, {1e-3, 1e3});
    grading.b = table->number_or("b", 2, {1e-3, 1e3});
  }
  constexpr std::array<std::string_view, 2> measures{"number", "volume"};
  grading.by_volume = table->choice("by", measures) == "volume";
  return grading;
}

void read_groups(SceneTable& grains, GrainsScene& result) {
  const std::size_t d = result.axes();
  for (SceneTable& table : grains.tables("group")) {
    GroupScene group;
    if (table.has("positions")) {
      group.kind = GroupScene::Kind::positions;
      group.positions = table.points("positions", d);
      if (table.has("radii")) {
        group.radii = table.numbers("radii", group.positions.size() / d);
        for (const double r : group.radii)
          if (!(r > 0)) {
            table.problem("radii", "radii must be positive");
            break;
          }
      } else {
        group.grading = read_grading(table);
      }
    } else if (table.has("lattice")) {
      group.kind = GroupScene::Kind::lattice;
      constexpr std::array<std::string_view, 2> kinds{"square", "triangular"};
      group.triangular = table.choice("lattice", kinds) == "triangular";
      group.from = table.numbers("from", d);
      group.pitch = table.number("pitch", Range::positive());
      group.stretch = vector_or(table, "stretch", d, 1);
      for (const double factor : group.stretch)
        if (!(factor > 0)) table.problem("stretch", "factors must be positive");
      for (const double n : table.numbers("counts", d)) {
        if (!(n >= 1) || n != std::floor(n) || n > 1e8)
          table.problem("counts", "are whole numbers from 1 on");
        group.counts.push_back(static_cast<std::int64_t>(std::clamp(n, 1.0, 1e8)));
      }
      group.grading = read_grading(table);
    } else if (table.has("count")) {
      group.kind = GroupScene::Kind::spread;
      group.count = table.integer("count", 1, 100'000'000);
      group.from = table.numbers("from", d);
      group.to = table.numbers("to", d);
      for (std::size_t c = 0; c < std::min(group.from.size(), group.to.size()); ++c)
        if (!(group.to[c] > group.from[c])) table.problem("to", "must lie beyond `from`");
      group.grading = read_grading(table);
    } else if (table.has("file")) {
      group.kind = GroupScene::Kind::file;
      group.file = table.text("file");
    } else {
      table.problem("", "a group needs `positions`, `lattice`, `count` (spread over a box) or `file`");
    }
    group.density = table.number_or("density", result.density, Range::positive());
    group.velocity = vector_or(table, "velocity", d, 0);
    group.spin = vector_or(table, "spin", d == 2 ? 1 : 3, 0);
    group.random_velocity = table.number_or("random_velocity", 0, Range::not_negative());
    group.seed = table.integer_or("seed", 1, 0, 1'000'000'000);
    group.held = table.boolean_or("held", false);
    result.groups.push_back(std::move(group));
  }
  if (result.groups.empty()) grains.problem("", "there are no grains: add at least one [[grains.group]]");
}

void read_box(SceneTable& grains, GrainsScene& result) {
  const std::size_t d = result.axes();
  if (auto box = grains.table_if("box")) {
    result.from = box->numbers("from", d);
    result.to = box->numbers("to", d);
    if (result.from.size() != d || result.to.size() != d) {
      result.from.clear();
      result.to.clear();
    }
    for (std::size_t c = 0; c < result.from.size(); ++c)
      if (!(result.to[c] > result.from[c])) box->problem("to", "must lie beyond `from`");
  }
  for (const std::string& axis : grains.texts_or_empty("periodic")) {
    const auto found = std::find(kAxes.begin(), kAxes.begin() + static_cast<std::ptrdiff_t>(d), axis);
    if (found == kAxes.begin() + static_cast<std::ptrdiff_t>(d)) {
      grains.problem("periodic", fmt::format("'{}' is not an axis of this scene", axis));
    } else if (result.from.empty()) {
      grains.problem("periodic", "periodic sides need a `box`");
    } else {
      result.periodic[static_cast<std::size_t>(found - kAxes.begin())] = true;
    }
  }
  for (const std::string& side : grains.texts_or_empty("walls")) {
    const auto found = std::find(kSides.begin(), kSides.begin() + static_cast<std::ptrdiff_t>(2 * d), side);
    const auto index = static_cast<std::size_t>(found - kSides.begin());
    if (index >= 2 * d) {
      grains.problem("walls", fmt::format("'{}' is not a side of the box (left, right, bottom, top{})", side,
                                          d == 3 ? ", back, front" : ""));
      continue;
    }
    if (result.from.empty()) {
      grains.problem("walls", "sides that are walls need a `box`");
      continue;
    }
    if (result.periodic[index / 2]) {
      grains.problem("walls", fmt::format("'{}' is a side of a periodic direction", side));
      continue;
    }
    WallScene wall;
    wall.name = side;
    const bool high = index % 2 == 1;
    wall.point = high ? result.to : result.from;
    wall.normal.assign(d, 0.0);
    wall.normal[index / 2] = high ? -1 : 1;
    wall.constants = result.constants;
    result.walls.push_back(std::move(wall));
  }
}

void read_walls(SceneTable& grains, GrainsScene& result) {
  const std::size_t d = result.axes();
  for (SceneTable& table : grains.tables("wall")) {
    WallScene wall;
    wall.name = table.text("name");
    for (const WallScene& other : result.walls)
      if (other.name == wall.name) table.problem("name", fmt::format("a second wall named '{}'", wall.name));
    if (table.has("polyline")) {
      if (d == 3) table.problem("polyline", "polylines are walls of the plane; use planes in space");
      wall.polyline = table.points("polyline", 2);
      wall.closed = table.boolean_or("closed", false);
      if (wall.polyline.size() < 4) table.problem("polyline", "needs at least two nodes");
      for (std::size_t k = 2; k + 1 < wall.polyline.size(); k += 2)
        if (wall.polyline[k] == wall.polyline[k - 2] && wall.polyline[k + 1] == wall.polyline[k - 1])
          table.problem("polyline", fmt::format("node {} is given twice", k / 2));
    } else {
      wall.point = table.numbers("point", d);
      wall.normal = table.numbers("normal", d);
      double length = 0;
      for (const double n : wall.normal) length += n * n;
      length = std::sqrt(length);
      if (!(length > 0)) table.problem("normal", "must not be zero");
      for (double& n : wall.normal) n /= length;
    }
    if (table.has("velocity")) {
      wall.velocity = table.expressions("velocity", d);
      for (const std::string& text : wall.velocity) {
        try {
          if (!std::isfinite(Expression(text)(0, 0, 0, 0)))
            table.problem("velocity", "is not finite at t = 0");
        } catch (const std::invalid_argument& error) {
          table.problem("velocity", error.what());
        }
      }
    }
    wall.constants =
        with_material(result, table.number_or("friction", result.constants.friction, Range::not_negative()),
                      table.number_or("restitution", result.restitution, {1e-6, 1}));
    result.walls.push_back(std::move(wall));
  }
  bool any_friction = result.constants.friction > 0;
  for (const WallScene& wall : result.walls) any_friction = any_friction || wall.constants.friction > 0;
  if (!any_friction) result.law.friction = FrictionLaw::none;
}

void read_fluid(SceneTable& grains, GrainsScene& result) {
  auto fluid = grains.table_if("fluid");
  result.fluid.acceleration.assign(result.axes(), 0.0);
  if (!fluid) return;
  result.fluid.present = true;
  result.fluid.density = fluid->number("density", Range::positive());
  constexpr std::array<std::string_view, 2> buoyancies{"reduced_gravity", "pressure"};
  result.fluid.reduced_gravity = fluid->choice("buoyancy", buoyancies) == "reduced_gravity";
  result.fluid.acceleration = vector_or(*fluid, "acceleration", result.axes(), 0);
  // Explicit exchange needs it where the fluid that a grain pushes outweighs the grain.
  double lightest = std::numeric_limits<double>::infinity();
  for (const GroupScene& group : result.groups)
    if (!group.held) lightest = std::min(lightest, group.density);
  const bool light = result.coupled_to_fluid && lightest < 1.2 * result.fluid.density;
  // Partially saturated cells carry the mass of the fluid inside along: the lightest need more. No more than
  // is needed: with stiff springs (contacts, fluid closed in between grains) the delay of C m_f feeds
  // vibrations.
  const double enough = lightest < 0.5 * result.fluid.density ? 4.0 : 1.0;
  result.fluid.virtual_mass = fluid->number_or("virtual_mass", light ? enough : 0.0, {0, 100});
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

void read_deposit(SceneTable& grains, GrainsScene& result) {
  auto table = grains.table_if("deposit");
  if (!table) return;
  DepositScene& deposit = result.deposit;
  deposit.active = true;
  if (table->has("friction")) deposit.friction = table->number("friction", Range::not_negative());
  if (table->has("restitution")) deposit.restitution = table->number("restitution", {1e-6, 1});
  deposit.gravity = table->numbers("gravity", result.axes());
  deposit.end_time = table->number("end_time", Range::positive());
  deposit.hold = table->boolean_or("hold", false);
  deposit.tolerance = table->number_or("tolerance", 1e-3, {1e-9, 1});
  if (table->has("target_porosity")) {
    deposit.target_porosity = table->number("target_porosity", {0.05, 0.95});
    deposit.porosity_tolerance = table->number_or("porosity_tolerance", 0.005, {1e-5, 0.2});
    if (deposit.friction)
      table->problem("friction", "is what is sought for `target_porosity`; give one of the two");
  }
}

void read_cement(SceneTable& grains, bool all_held, GrainsScene& result) {
  auto table = grains.table_if("cement");
  if (!table) return;
  CementScene& cement = result.cement;
  constexpr std::array<std::string_view, 3> models{"bridges", "coating", "random"};
  const std::string model = table->choice("model", models);
  if (model == "bridges") {
    cement.model = CementScene::Model::bridges;
    cement.diameter_ratio = table->number("diameter_ratio", {1e-3, 0.999});
    cement.distance_ratio = table->number_or("distance_ratio", 0.05, {0, 1});
  } else if (model == "coating") {
    cement.model = CementScene::Model::coating;
    cement.thickness_ratio = table->number("thickness_ratio", {0, 1});
  } else {
    cement.model = CementScene::Model::random;
    cement.saturation = table->number("saturation", {0, 0.99});
    cement.seed = table->integer_or("seed", 1, 0, 1'000'000'000);
  }
  // Those of the models not chosen may stay, so that --set changes the model alone.
  table->leave_to_others({"diameter_ratio", "distance_ratio", "thickness_ratio", "saturation", "seed"});
  cement.voxel = table->number("voxel", Range::positive());
  cement.from = table->has("from") ? table->numbers("from", result.axes()) : result.from;
  cement.to = table->has("to") ? table->numbers("to", result.axes()) : result.to;
  if (cement.from.size() != result.axes() || cement.to.size() != result.axes()) {
    table->problem("", "give the box that is cemented: `from` and `to`, or [grains.box]");
    return;
  }
  double voxels = 1;
  for (std::size_t c = 0; c < result.axes(); ++c) {
    if (!(cement.to[c] > cement.from[c])) table->problem("to", "must lie beyond `from`");
    voxels *= std::max(1.0, (cement.to[c] - cement.from[c]) / cement.voxel);
  }
  if (voxels > 1e7) table->problem("voxel", fmt::format("makes {:.2g} voxels: at most 1e7", voxels));
  if (!all_held && cement.model != CementScene::Model::coating)
    table->problem("model",
                   "bridges and random cement stay where they are: hold every group (`held`), or "
                   "[grains.deposit] with `hold`; moving grains can be coated and bonded");
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
