#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "scene_parts.hpp"

namespace estuary::fluid {
namespace {

constexpr double fit_tolerance = 1e-9;
constexpr double most_nodes = 2e9;

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

// The number of nodes in each direction, or nothing when one does not fit.
std::optional<std::array<double, 3>> nodes_of(const std::vector<double>& size, double spacing,
                                              const std::array<double, 3>& beyond) {
  std::array<double, 3> result{1, 1, 0};
  for (std::size_t axis = 0; axis < size.size(); ++axis) {
    const auto count = nodes_along(size[axis], spacing, beyond[axis]);
    if (!count) return std::nullopt;
    result[axis] = *count;
  }
  return result;
}

std::optional<double> nearest_fitting_spacing(const std::vector<double>& size, double spacing,
                                              const std::array<double, 3>& beyond) {
  const double wanted = std::round(size[0] / spacing + 1 - beyond[0]);
  std::optional<double> best;
  for (std::int64_t step = 0; static_cast<double>(step) <= 1.5 * wanted; ++step) {
    const double cells = std::floor(0.5 * wanted + static_cast<double>(step)) - 1 + beyond[0];
    if (cells < 1) continue;
    const double candidate = size[0] / cells;
    if (!nodes_of(size, candidate, beyond)) continue;
    if (!best || std::abs(candidate - spacing) < std::abs(*best - spacing)) best = candidate;
  }
  return best;
}

}  // namespace

void read_grid(SceneTable& fluid, int dimension, FluidScene& result) {
  const auto components = static_cast<std::size_t>(dimension);
  const auto size = fluid.numbers("size", components);
  const double spacing = fluid.number("spacing", Range::positive());
  std::vector<double> origin(components, 0.0);
  if (fluid.has("origin")) origin = fluid.numbers("origin", components);
  result.units.spacing = spacing;
  if (size.size() != components || origin.size() != components) return;
  if (!std::all_of(size.begin(), size.end(), [](double length) { return length > 0; })) {
    fluid.problem("size", "every length has to be positive");
    return;
  }
  if (!(spacing > 0)) return;
  const auto& sides = result.flow.sides;
  std::array<double, 3> beyond{};
  double total = 1;
  for (std::size_t axis = 0; axis < components; ++axis) {
    beyond[axis] = beyond_nodes(sides[2 * axis].kind, sides[2 * axis + 1].kind);
    total *= size[axis] / spacing;
  }
  if (total > most_nodes) {
    fluid.problem("spacing", fmt::format("{:g} nodes are too many", total));
    return;
  }
  const auto counts = nodes_of(size, spacing, beyond);
  if (!counts) {
    std::size_t wrong = 0;
    while (wrong + 1 < components && nodes_along(size[wrong], spacing, beyond[wrong])) ++wrong;
    const auto fitting = nearest_fitting_spacing(size, spacing, beyond);
    fluid.problem(
        "spacing",
        fmt::format("{:.10g} m does not divide the {} of {:.10g} m (nodes lie on velocity and pressure sides "
                    "and half a spacing inside walls and periodic sides); {}",
                    spacing, axis_names[wrong], size[wrong],
                    fitting ? fmt::format("the nearest that fits all directions is {:.15g}", *fitting)
                            : std::string("no spacing near it fits all directions: change `size`")));
    return;
  }
  for (std::size_t axis = 0; axis < components; ++axis) {
    if ((*counts)[axis] >= 3) continue;
    fluid.problem("spacing", fmt::format("{} nodes along the {} are too few: at least 3", (*counts)[axis],
                                         axis_names[axis]));
    return;
  }
  const auto first = [&](std::size_t axis) {
    return origin[axis] + (is_open(sides[2 * axis].kind) ? 0.0 : 0.5 * spacing);
  };
  result.flow.grid = {static_cast<int>((*counts)[0]),
                      static_cast<int>((*counts)[1]),
                      spacing,
                      first(0),
                      first(1),
                      sides[left].kind == SideKind::periodic,
                      sides[bottom].kind == SideKind::periodic,
                      static_cast<int>((*counts)[2]),
                      dimension == 3 ? first(2) : 0.0,
                      dimension == 3 && sides[back].kind == SideKind::periodic};
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

}  // namespace estuary::fluid
