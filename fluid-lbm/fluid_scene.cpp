#include "fluid_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string_view>

namespace estuary::fluid {
namespace {

using namespace std::string_view_literals;

constexpr double fit_tolerance = 1e-9;
constexpr double most_nodes = 2e9;

std::optional<Expression> parse(SceneTable& table, std::string_view key, const std::string& text) {
  if (text.empty()) return std::nullopt;  // missing, and already noted
  try {
    return Expression(text);
  } catch (const std::invalid_argument& error) {
    table.problem(key, error.what());
    return std::nullopt;
  }
}

std::vector<Expression> parse_velocity(SceneTable& table) {
  std::vector<Expression> velocity;
  for (const auto& text : table.expressions("velocity", 2)) {
    if (auto expression = parse(table, "velocity", text)) velocity.push_back(std::move(*expression));
  }
  if (velocity.size() != 2) velocity.clear();
  return velocity;
}

void read_sides(SceneTable& fluid, FluidScene& result) {
  static constexpr std::array kinds{"wall"sv, "velocity"sv, "pressure"sv, "periodic"sv};
  auto sides = fluid.table_if("sides");
  std::array<std::optional<SceneTable>, 4> tables;
  for (std::size_t s = 0; s < 4; ++s) {
    if (sides) tables[s] = sides->table_if(side_names[s]);
    if (!tables[s]) continue;  // a wall at rest
    auto& table = *tables[s];
    const std::string type = table.choice("type", kinds);
    Side& side = result.flow.sides[s];
    SideProfile& profile = result.profiles[s];
    if (type == "velocity") {
      side.kind = SideKind::velocity;
      profile.velocity = parse_velocity(table);
    } else if (type == "pressure") {
      side.kind = SideKind::pressure;
      profile.pressure = parse(table, "pressure", table.expression("pressure"));
    } else if (type == "periodic") {
      side.kind = SideKind::periodic;
    } else {
      side.kind = SideKind::wall;
      if (table.has("velocity")) profile.velocity = parse_velocity(table);
    }
  }
  for (const auto& [first, second] : {std::pair{left, right}, std::pair{bottom, top}}) {
    const bool one = result.flow.sides[first].kind == SideKind::periodic;
    const bool other = result.flow.sides[second].kind == SideKind::periodic;
    if (one != other) {
      const SideName lonely = one ? second : first;
      (tables[lonely] ? *tables[lonely] : fluid)
          .problem("type", fmt::format("the side opposite to '{}' is periodic, so this one has to be too",
                                       side_names[lonely]));
    }
  }
  for (const SideName vertical : {left, right}) {
    for (const SideName horizontal : {bottom, top}) {
      if (is_open(result.flow.sides[vertical].kind) && is_open(result.flow.sides[horizontal].kind)) {
        tables[horizontal]->problem(
            "type",
            fmt::format("'{}' and '{}' meet in a corner and neither is a wall or periodic: the corner node "
                        "would lie on two open sides, which the method cannot complete; make one a wall "
                        "(it may move) or periodic",
                        side_names[vertical], side_names[horizontal]));
      }
    }
  }
}

// Between the outermost nodes of a direction lie n - 1 spacings; what the sides add beyond them.
double beyond_nodes(SideKind low, SideKind high) {
  return (is_open(low) ? 0.0 : 0.5) + (is_open(high) ? 0.0 : 0.5);
}

// The number of nodes, or nothing when the spacing does not fit.
std::optional<double> nodes_along(double length, double spacing, double beyond) {
  const double count = length / spacing + 1 - beyond;
  const double rounded = std::round(count);
  if (rounded < 1 || std::abs(count - rounded) > fit_tolerance * std::max(1.0, count)) return std::nullopt;
  return rounded;
}

std::optional<double> nearest_fitting_spacing(const std::vector<double>& size, double spacing,
                                              double beyond_x, double beyond_y) {
  const double wanted = std::round(size[0] / spacing + 1 - beyond_x);
  std::optional<double> best;
  for (double shift = -0.5 * wanted; shift <= wanted; ++shift) {
    const double cells = std::floor(wanted + shift) - 1 + beyond_x;
    if (cells < 1) continue;
    const double candidate = size[0] / cells;
    if (!nodes_along(size[1], candidate, beyond_y)) continue;
    if (!best || std::abs(candidate - spacing) < std::abs(*best - spacing)) best = candidate;
  }
  return best;
}

void read_grid(SceneTable& fluid, FluidScene& result) {
  const auto size = fluid.numbers("size", 2);
  const double spacing = fluid.number("spacing", Range::positive());
  std::vector<double> origin{0, 0};
  if (fluid.has("origin")) origin = fluid.numbers("origin", 2);
  result.units.spacing = spacing;
  if (size.size() != 2 || origin.size() != 2) return;
  if (!(size[0] > 0 && size[1] > 0)) {
    fluid.problem("size", "both lengths have to be positive");
    return;
  }
  if (!(spacing > 0)) return;
  const auto& sides = result.flow.sides;
  const double beyond_x = beyond_nodes(sides[left].kind, sides[right].kind);
  const double beyond_y = beyond_nodes(sides[bottom].kind, sides[top].kind);
  if (size[0] / spacing * (size[1] / spacing) > most_nodes) {
    fluid.problem("spacing", fmt::format("{:g} nodes are too many", size[0] / spacing * (size[1] / spacing)));
    return;
  }
  const auto nx = nodes_along(size[0], spacing, beyond_x);
  const auto ny = nodes_along(size[1], spacing, beyond_y);
  if (!nx || !ny) {
    const auto fitting = nearest_fitting_spacing(size, spacing, beyond_x, beyond_y);
    fluid.problem(
        "spacing",
        fmt::format("{:.10g} m does not divide the {} of {:.10g} m (nodes lie on velocity and pressure sides "
                    "and half a spacing inside walls and periodic sides); {}",
                    spacing, nx ? "height" : "length", nx ? size[1] : size[0],
                    fitting ? fmt::format("the nearest that fits both directions is {:.15g}", *fitting)
                            : std::string("no spacing near it fits both directions: change `size`")));
    return;
  }
  if (*nx < 3 || *ny < 3) {
    fluid.problem("spacing", fmt::format("a grid of {} x {} nodes is too small: at least 3 x 3", *nx, *ny));
    return;
  }
  result.flow.grid = {static_cast<int>(*nx),
                      static_cast<int>(*ny),
                      spacing,
                      origin[0] + (is_open(sides[left].kind) ? 0.0 : 0.5 * spacing),
                      origin[1] + (is_open(sides[bottom].kind) ? 0.0 : 0.5 * spacing),
                      sides[left].kind == SideKind::periodic,
                      sides[bottom].kind == SideKind::periodic};
}

void read_time_step(SceneTable& fluid, FluidScene& result, Plan& plan) {
  Units& units = result.units;
  units.density = fluid.number("density", Range::positive());
  units.viscosity = fluid.number("viscosity", Range::positive());
  result.reference_velocity = fluid.number("reference_velocity", Range::positive());
  int ways = 0;
  for (const auto* key : {"lattice_velocity", "relaxation_time", "time_step"}) {
    if (fluid.has(key) && ++ways == 2) {
      fluid.problem(
          key, "only one of `lattice_velocity`, `relaxation_time` and `time_step` can set the time step");
    }
  }
  double step = 0;
  if (fluid.has("relaxation_time")) {
    const double tau = fluid.number("relaxation_time", {0.5, 100.0, true});
    step = (tau - 0.5) / 3 * units.spacing * units.spacing * units.density / units.viscosity;
  } else if (fluid.has("time_step")) {
    step = fluid.number("time_step", Range::positive());
  } else {
    const double velocity = fluid.number_or("lattice_velocity", 0.05, {0.0, 0.3, true});
    step = velocity * units.spacing / result.reference_velocity;
  }
  if (!(step > 0) || !std::isfinite(step)) step = 1;  // a problem was noted
  units.time_step = step;
  if (result.mode == Mode::transient && result.window > 0) {
    const double count = result.window / step;
    if (count > 1e12) {
      fluid.problem("time_step",
                    fmt::format("a window of {:g} s would take {:g} steps", result.window, count));
      return;
    }
    const double rounded = std::max(1.0, std::round(count));
    const bool fits = std::abs(count - rounded) <= fit_tolerance * rounded;
    const double steps = fits ? rounded : std::max(1.0, std::ceil(count));
    result.steps_per_window = static_cast<std::uint64_t>(steps);
    units.time_step = result.window / steps;
    plan.derived.emplace_back(
        "steps per window",
        fits ? fmt::format("{}", result.steps_per_window)
             : fmt::format("{} (time step shortened from {:.6g} s so that they fill the window)",
                           result.steps_per_window, step));
  }
}

void read_model(SceneTable& fluid, FluidScene& result) {
  static constexpr std::array collisions{"trt"sv, "bgk"sv};
  static constexpr std::array equilibria{"incompressible"sv, "compressible"sv};
  result.flow.collision =
      fluid.choice("collision", collisions) == "bgk" ? CollisionModel::bgk : CollisionModel::trt;
  result.flow.equilibrium = fluid.choice("equilibrium", equilibria) == "compressible"
                                ? EquilibriumModel::compressible
                                : EquilibriumModel::incompressible;
  result.magic_parameter = fluid.number_or("magic_parameter", 3.0 / 16.0, {1e-6, 10.0, false});
  if (result.flow.collision == CollisionModel::bgk && fluid.has("magic_parameter")) {
    fluid.problem("magic_parameter", "BGK has no magic parameter; use collision = \"trt\"");
  }
  result.viscous_traction = fluid.boolean_or("viscous_traction", true);
  // Between two steps of a moving surface the force by momentum exchange is too noisy to steer the load.
  const bool possible = result.viscous_traction && result.mode == Mode::steady;
  result.match_force = fluid.boolean_or("match_force", possible);
  if (result.match_force && !possible) {
    fluid.problem("match_force",
                  "the load can be matched to the total force only in steady mode and with viscous_traction");
  }
}

double signed_area(const std::vector<double>& points) {
  double twice = 0;
  const std::size_t count = points.size() / 2;
  for (std::size_t n = 0; n < count; ++n) {
    const std::size_t m = (n + 1) % count;
    twice += points[2 * n] * points[2 * m + 1] - points[2 * m] * points[2 * n + 1];
  }
  return 0.5 * twice;
}

void read_obstacles(SceneTable& fluid, FluidScene& result, Plan& plan) {
  int number = 0;
  for (auto& table : fluid.tables("obstacle")) {
    ++number;
    const auto points = table.points("polygon", 2);
    const std::size_t count = points.size() / 2;
    if (count < 3) {
      if (!points.empty()) table.problem("polygon", "an outline needs at least three points");
      continue;
    }
    const double area = signed_area(points);
    if (!(area < 0)) {
      table.problem("polygon",
                    area > 0
                        ? "the points run counter-clockwise, which would put the fluid inside: list them "
                          "clockwise"
                        : "the outline encloses no area");
      continue;
    }
    const auto first = static_cast<std::uint32_t>(result.obstacle_positions.size() / 2);
    result.obstacle_positions.insert(result.obstacle_positions.end(), points.begin(), points.end());
    double low[2] = {points[0], points[1]};
    double high[2] = {points[0], points[1]};
    for (std::uint32_t n = 0; n < count; ++n) {
      result.obstacle_connectivity.insert(result.obstacle_connectivity.end(),
                                          {first + n, first + (n + 1) % static_cast<std::uint32_t>(count)});
      for (const std::size_t axis : {std::size_t{0}, std::size_t{1}}) {
        low[axis] = std::min(low[axis], points[2 * n + axis]);
        high[axis] = std::max(high[axis], points[2 * n + axis]);
      }
    }
    const double extent = std::min(high[0] - low[0], high[1] - low[1]) / result.units.spacing;
    if (extent < 4) {
      plan.warnings.push_back(fmt::format(
          "obstacle {} is {:.3g} spacings across; below 4 its shape is hardly seen", number, extent));
    }
    const Grid& grid = result.flow.grid;
    const double gaps[4] = {grid.to_lattice_x(low[0]) + 0.5, grid.nx - 0.5 - grid.to_lattice_x(high[0]),
                            grid.to_lattice_y(low[1]) + 0.5, grid.ny - 0.5 - grid.to_lattice_y(high[1])};
    for (std::size_t s = 0; s < 4; ++s) {
      if (result.flow.sides[s].kind == SideKind::wall && gaps[s] > 0.01 && gaps[s] < 4) {
        plan.warnings.push_back(
            fmt::format("the gap between obstacle {} and the {} wall is {:.3g} spacings; below 4 the "
                        "flow through it is inaccurate",
                        number, side_names[s], gaps[s]));
      }
    }
  }
}

void read_steady(SceneTable& fluid, FluidScene& result) {
  constexpr std::int64_t default_maximum = 1'000'000;
  result.steady_maximum_steps = default_maximum;
  if (auto steady = fluid.table_if("steady")) {
    result.steady_tolerance = steady->number_or("tolerance", 1e-6, {1e-12, 0.1, false});
    result.steady_maximum_steps = static_cast<std::uint64_t>(
        steady->integer_or("maximum_steps", default_maximum, 1, 1'000'000'000'000));
  }
}

void read_initial(SceneTable& fluid, FluidScene& result) {
  if (auto initial = fluid.table_if("initial")) {
    if (initial->has("velocity")) result.initial_velocity = parse_velocity(*initial);
  }
}

void read_watches(SceneTable& root, const std::string& role, FluidScene& result) {
  for (auto& table : root.tables("watch")) {
    if (table.text_or("participant", "") != role) continue;
    WatchRequest watch;
    watch.name = table.text("name");
    if (table.has("point") && table.has("line")) {
      table.problem("line", "a watch has either a `point` or a `line`");
      continue;
    }
    if (table.has("point")) {
      watch.kind = WatchRequest::Kind::point;
      watch.points = table.numbers("point", 2);
      if (watch.points.size() != 2) continue;
    } else if (table.has("line")) {
      watch.kind = WatchRequest::Kind::line;
      watch.points = table.points("line", 2);
      watch.samples = static_cast<int>(table.integer_or("samples", 1001, 2, 1'000'000));
      if (watch.points.size() != 4) {
        if (!watch.points.empty()) table.problem("line", "a line has two points");
        continue;
      }
    }
    const Grid& grid = result.flow.grid;
    for (std::size_t n = 0; n + 1 < watch.points.size(); n += 2) {
      const double x = grid.to_lattice_x(watch.points[n]);
      const double y = grid.to_lattice_y(watch.points[n + 1]);
      if (grid.nx > 0 &&
          !(x >= -0.5 - 1e-9 && x <= grid.nx - 0.5 + 1e-9 && y >= -0.5 - 1e-9 && y <= grid.ny - 0.5 + 1e-9)) {
        table.problem(watch.kind == WatchRequest::Kind::point ? "point" : "line",
                      fmt::format("({:g}, {:g}) lies outside of the fluid's domain", watch.points[n],
                                  watch.points[n + 1]));
        break;
      }
    }
    result.watches.push_back(std::move(watch));
  }
}

// Speeds that the sides impose at the start, against the speed of sound.
void check_side_values(SceneTable& fluid, const FluidScene& result, Plan& plan) {
  Sides sides = result.flow.sides;
  evaluate_sides(result, 0.0, sides);
  for (std::size_t s = 0; s < 4; ++s) {
    double largest = 0;
    bool finite = true;
    for (std::size_t k = 0; k < sides[s].velocity_x.size(); ++k) {
      const double speed = std::hypot(sides[s].velocity_x[k], sides[s].velocity_y[k]);
      finite = finite && std::isfinite(speed);
      largest = std::max(largest, speed);
    }
    for (const double excess : sides[s].excess) finite = finite && std::isfinite(excess);
    if (result.profiles[s].velocity.empty() && !result.profiles[s].pressure) continue;
    auto table = fluid.table("sides").table(side_names[s]);
    const auto* key = result.profiles[s].pressure ? "pressure" : "velocity";
    if (!finite) {
      table.problem(key, "the expression has no finite value somewhere along the side at t = 0");
    } else if (largest * std::numbers::sqrt3 >= 0.5) {
      table.problem(key,
                    fmt::format("{:g} m/s is Mach {:.2g} on this lattice, where the method fails; raise "
                                "`reference_velocity` to the largest velocity in the flow",
                                largest / result.units.velocity_to_lattice(), largest * std::numbers::sqrt3));
    } else if (largest > 1.5 * result.reference_velocity * result.units.velocity_to_lattice()) {
      plan.warnings.push_back(fmt::format(
          "the {} side imposes {:g} m/s, more than the reference velocity of {:g} m/s", side_names[s],
          largest / result.units.velocity_to_lattice(), result.reference_velocity));
    }
    if (result.mode == Mode::steady && !result.profiles[s].constant_in_time()) {
      plan.warnings.push_back(
          fmt::format("the {} side depends on t, which stays 0 in a steady scene", side_names[s]));
    }
  }
}

void fill_plan(const FluidScene& result, Plan& plan) {
  const Units& units = result.units;
  const Grid& grid = result.flow.grid;
  const double tau = units.relaxation_time();
  const double mach = units.mach(result.reference_velocity);
  const double grid_reynolds = units.grid_reynolds(result.reference_velocity);
  const double nodes = static_cast<double>(grid.nx) * grid.ny;
  const double height = std::min(grid.nx, grid.ny) * grid.spacing;
  plan.derived.emplace_back("grid", fmt::format("{} x {} nodes", grid.nx, grid.ny));
  plan.derived.emplace_back("time step", fmt::format("{:.6g} s", units.time_step));
  plan.derived.emplace_back("relaxation time", fmt::format("{:.6g}", tau));
  plan.derived.emplace_back("Mach number of the reference velocity", fmt::format("{:.3g}", mach));
  plan.derived.emplace_back(
      "Reynolds number on the shorter side",
      fmt::format("{:.4g}", result.reference_velocity * height * units.density / units.viscosity));
  plan.derived.emplace_back("Reynolds number of a cell", fmt::format("{:.3g}", grid_reynolds));
  if (tau < 0.51) {
    plan.warnings.push_back(
        fmt::format("relaxation time {:.4g}: below 0.51 the flow is close to instability; use a finer "
                    "spacing or a larger lattice_velocity",
                    tau));
  }
  if (tau > 2) {
    plan.warnings.push_back(fmt::format(
        "relaxation time {:.4g}: above 2 errors at walls and in time grow; use a smaller lattice_velocity",
        tau));
  }
  if (mach > 0.1) {
    plan.warnings.push_back(fmt::format("Mach number {:.3g}: above 0.1 compressibility shows", mach));
  }
  if (grid_reynolds > 10) {
    plan.warnings.push_back(
        fmt::format("cell Reynolds number {:.3g}: above 10 boundary layers are not resolved", grid_reynolds));
  }
  plan.memory_bytes =
      Populations::memory_bytes(grid) *
          (result.has_partner && result.mode == Mode::transient ? 2 : 1) +
      nodes * (1 + 3 * 8 + (result.mode == Mode::steady ? 16 : 0) + (result.has_partner ? 8 : 0));
  if (result.mode == Mode::transient)
    plan.expected_updates = nodes * std::ceil(result.end_time / units.time_step);
  if (!result.has_partner) plan.left_out.emplace_back("moving wet surface: no solid in the scene");
  if (result.obstacle_connectivity.empty()) plan.left_out.emplace_back("obstacles: none in the scene");
  if (!result.viscous_traction) plan.left_out.emplace_back("viscous traction: the scene does not ask for it");
  if (!result.has_partner || result.mode == Mode::steady) {
    plan.left_out.emplace_back(result.mode == Mode::steady
                                   ? "copy of the window's start: a steady iteration goes on from where it is"
                                   : "copy of the window's start: no partner repeats windows");
  }
  plan.variant = variant_name(result.flow.step());
}

}  // namespace

bool SideProfile::constant_in_time() const {
  return std::all_of(velocity.begin(), velocity.end(),
                     [](const Expression& e) { return e.constant_in_time(); }) &&
         (!pressure || pressure->constant_in_time());
}

FluidScene read_fluid_scene(Scene& scene, const std::string& role, Plan& plan) {
  FluidScene result;
  auto root = scene.root();
  if (root.integer_or("dimension", 2, 2, 3) != 2) {
    root.problem("dimension", "this fluid works in two dimensions");
  }
  result.has_partner = root.has("solid") || root.has("grains");
  if (auto coupling = root.table_if("coupling")) {
    static constexpr std::array modes{"steady"sv, "transient"sv};
    result.mode = coupling->choice("mode", modes) == "steady" ? Mode::steady : Mode::transient;
    if (result.mode == Mode::transient && coupling->has("window")) {
      result.window = coupling->number("window", Range::positive());
      result.end_time = coupling->number_or("end_time", 0.0);
    }
  }
  auto fluid = root.table(role);
  fluid.leave_to_others({"solver", "connect", "threads"});
  read_sides(fluid, result);
  read_grid(fluid, result);
  read_time_step(fluid, result, plan);
  read_model(fluid, result);
  read_obstacles(fluid, result, plan);
  read_steady(fluid, result);
  read_initial(fluid, result);
  read_watches(root, role, result);
  fluid.refuse_unknown_keys();
  if (!scene.problems().empty()) return result;
  result.flow.rates = relaxation_rates(result.units.lattice_viscosity(), result.magic_parameter);
  check_side_values(fluid, result, plan);
  fill_plan(result, plan);
  return result;
}

void evaluate_sides(const FluidScene& scene, double time, Sides& sides) {
  const Grid& grid = scene.flow.grid;
  const double scale = scene.units.velocity_to_lattice();
  for (std::size_t s = 0; s < 4; ++s) {
    const SideProfile& profile = scene.profiles[s];
    Side& side = sides[s];
    if (profile.velocity.empty() && !profile.pressure) continue;
    const bool vertical = s == left || s == right;
    const int nodes = vertical ? grid.ny : grid.nx;
    const bool wall = side.kind == SideKind::wall;
    const int count = wall ? 2 * nodes + 1 : nodes;
    // A wall lies half a spacing outside the outermost nodes.
    const double beyond = wall ? 0.5 : 0.0;
    const double across = s == left || s == bottom ? -beyond : (vertical ? grid.nx : grid.ny) - 1 + beyond;
    if (profile.pressure) {
      side.excess.resize(static_cast<std::size_t>(count));
    } else {
      side.velocity_x.resize(static_cast<std::size_t>(count));
      side.velocity_y.resize(static_cast<std::size_t>(count));
    }
    for (int k = 0; k < count; ++k) {
      const double along = wall ? 0.5 * k - 0.5 : k;
      const double x = grid.x(vertical ? across : along);
      const double y = grid.y(vertical ? along : across);
      const auto entry = static_cast<std::size_t>(k);
      if (profile.pressure) {
        side.excess[entry] = scene.units.excess((*profile.pressure)(x, y, 0, time));
      } else {
        side.velocity_x[entry] = scale * profile.velocity[0](x, y, 0, time);
        side.velocity_y[entry] = scale * profile.velocity[1](x, y, 0, time);
      }
    }
  }
}

}  // namespace estuary::fluid
