#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string_view>

#include "scene_parts.hpp"
#include "side_frame.hpp"

namespace estuary::fluid {

using namespace std::string_view_literals;

namespace {

void read_side(SceneTable& table, int dimension, Side& side, SideProfile& profile) {
  static constexpr std::array kinds{"wall"sv, "velocity"sv, "pressure"sv, "periodic"sv, "outflow"sv};
  static constexpr std::array completions{"zou-he"sv, "regularised"sv};
  const std::string type = table.choice("type", kinds);
  if (type == "velocity") {
    side.kind = table.choice("completion", completions) == "regularised" ? SideKind::regularised_velocity
                                                                         : SideKind::velocity;
    profile.velocity = parse_expressions(table, "velocity", dimension);
  } else if (type == "pressure") {
    side.kind = SideKind::pressure;
    profile.pressure = parse_expression(table, "pressure", table.expression("pressure"));
  } else if (type == "outflow") {
    side.kind = SideKind::outflow;
    profile.pressure = parse_expression(
        table, "pressure", table.has("pressure") ? table.expression("pressure") : std::string("0"));
    side.relaxation = table.number_or("relaxation", 0.25, {0.0, 10.0, false});
  } else if (type == "periodic") {
    side.kind = SideKind::periodic;
  } else {
    side.kind = SideKind::wall;
    if (table.has("velocity")) profile.velocity = parse_expressions(table, "velocity", dimension);
  }
}

}  // namespace

void read_sides(SceneTable& fluid, int dimension, FluidScene& result) {
  auto sides = fluid.table_if("sides");
  std::array<std::optional<SceneTable>, 6> tables;
  const auto count = static_cast<std::size_t>(side_count(dimension));
  for (std::size_t s = 0; s < count; ++s) {
    if (sides) tables[s] = sides->table_if(side_names[s]);
    if (tables[s]) read_side(*tables[s], dimension, result.flow.sides[s], result.profiles[s]);
  }
  for (std::size_t first = 0; first < count; first += 2) {
    const std::size_t second = first + 1;
    const bool one = result.flow.sides[first].kind == SideKind::periodic;
    const bool other = result.flow.sides[second].kind == SideKind::periodic;
    if (one != other) {
      const std::size_t lonely = one ? second : first;
      (tables[lonely] ? *tables[lonely] : fluid)
          .problem("type", fmt::format("the side opposite to '{}' is periodic, so this one has to be too",
                                       side_names[lonely]));
    }
  }
}

namespace {

// In a domain whose open sides all give a velocity nothing sets the pressure, and what they let in beyond
// what they let out stays inside.
void warn_of_unbalanced_flow(const FluidScene& result, const Sides& sides, Plan& plan) {
  const Grid& grid = result.flow.grid;
  const int dimension = result.dimension();
  double net = 0;
  double all = 0;
  for (int name = 0; name < side_count(dimension); ++name) {
    const Side& side = sides[static_cast<std::size_t>(name)];
    if (side.kind == SideKind::pressure || side.kind == SideKind::outflow) return;
    if (!is_open(side.kind) || side.velocity_x.empty()) continue;
    const SideFrame frame(name, {grid.nx, grid.ny, grid.layers()});
    const auto& normal =
        frame.axis == 0 ? side.velocity_x : (frame.axis == 1 ? side.velocity_y : side.velocity_z);
    for (const double velocity : normal) {
      net -= frame.outward * velocity;
      all += std::abs(velocity);
    }
  }
  constexpr double noticeable = 0.01;  // of what passes the sides; beside it their ends count half
  if (std::abs(net) <= noticeable * all) return;
  plan.warnings.push_back(fmt::format(
      "the velocity sides let {:.3g} % of what passes them {} and no side has a pressure: the density inside "
      "{} "
      "without end; make one side an outflow or a pressure side",
      100 * std::abs(net) / all, net > 0 ? "in beyond what they let out," : "out beyond what they let in,",
      net > 0 ? "grows" : "falls"));
}

}  // namespace

void check_side_values(SceneTable& fluid, const FluidScene& result, Plan& plan) {
  Sides sides = result.flow.sides;
  evaluate_sides(result, 0.0, sides);
  for (std::size_t s = 0; s < static_cast<std::size_t>(side_count(result.dimension())); ++s) {
    double largest = 0;
    bool finite = true;
    for (std::size_t k = 0; k < sides[s].velocity_x.size(); ++k) {
      const double speed = std::hypot(sides[s].velocity_x[k], sides[s].velocity_y[k],
                                      sides[s].velocity_z.empty() ? 0.0 : sides[s].velocity_z[k]);
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
  warn_of_unbalanced_flow(result, sides, plan);
}

bool SideProfile::constant_in_time() const {
  return std::all_of(velocity.begin(), velocity.end(),
                     [](const Expression& e) { return e.constant_in_time(); }) &&
         (!pressure || pressure->constant_in_time());
}

void evaluate_sides(const FluidScene& scene, double time, Sides& sides) {
  const Grid& grid = scene.flow.grid;
  const double scale = scene.units.velocity_to_lattice();
  const int dimension = grid.dimension();
  for (int s = 0; s < side_count(dimension); ++s) {
    const SideProfile& profile = scene.profiles[static_cast<std::size_t>(s)];
    Side& side = sides[static_cast<std::size_t>(s)];
    if (profile.velocity.empty() && !profile.pressure) continue;
    const SideFrame frame(s, {grid.nx, grid.ny, grid.layers()});
    const bool wall = side.kind == SideKind::wall;
    const int along_u = wall ? frame.points_u() : frame.along_u();
    const int along_v = wall ? frame.points_v(dimension) : frame.along_v();
    const std::size_t count = static_cast<std::size_t>(along_u) * static_cast<std::size_t>(along_v);
    if (profile.pressure) {
      side.excess.resize(count);
    } else {
      for (auto* component : {&side.velocity_x, &side.velocity_y, &side.velocity_z}) component->resize(count);
      if (dimension == 2) side.velocity_z.clear();
    }
    // A wall lies half a spacing outside the outermost nodes.
    const double beyond = wall ? 0.5 : 0.0;
    std::array<double, 3> at{};
    at[static_cast<std::size_t>(frame.axis)] =
        frame.outward < 0 ? -beyond : frame.counts[static_cast<std::size_t>(frame.axis)] - 1 + beyond;
    for (std::size_t k = 0; k < count; ++k) {
      const auto a = static_cast<int>(k) % along_u;
      const auto b = static_cast<int>(k) / along_u;
      at[static_cast<std::size_t>(frame.u)] = wall ? 0.5 * a - 0.5 : a;
      if (dimension == 3) at[static_cast<std::size_t>(frame.v)] = wall ? 0.5 * b - 0.5 : b;
      const double x = grid.x(at[0]);
      const double y = grid.y(at[1]);
      const double z = dimension == 3 ? grid.z(at[2]) : 0.0;
      if (profile.pressure) {
        side.excess[k] = scene.units.excess((*profile.pressure)(x, y, z, time));
      } else {
        side.velocity_x[k] = scale * profile.velocity[0](x, y, z, time);
        side.velocity_y[k] = scale * profile.velocity[1](x, y, z, time);
        if (dimension == 3) side.velocity_z[k] = scale * profile.velocity[2](x, y, z, time);
      }
    }
  }
}

}  // namespace estuary::fluid
