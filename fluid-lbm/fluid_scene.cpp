#include "fluid_scene.hpp"

#include <stdexcept>
#include <string_view>

#include "scene_parts.hpp"

namespace estuary::fluid {

using namespace std::string_view_literals;

std::optional<Expression> parse_expression(SceneTable& table, std::string_view key, const std::string& text) {
  if (text.empty()) return std::nullopt;  // missing, and already noted
  try {
    return Expression(text);
  } catch (const std::invalid_argument& error) {
    table.problem(key, error.what());
    return std::nullopt;
  }
}

std::vector<Expression> parse_expressions(SceneTable& table, std::string_view key, int count) {
  std::vector<Expression> result;
  for (const auto& text : table.expressions(key, static_cast<std::size_t>(count))) {
    if (auto expression = parse_expression(table, key, text)) result.push_back(std::move(*expression));
  }
  if (result.size() != static_cast<std::size_t>(count)) result.clear();
  return result;
}

WallRule read_wall_rule(SceneTable& table, WallRule fallback) {
  if (!table.has("wall_rule")) return fallback;
  static constexpr std::array rules{"linear"sv,         "half-way"sv,  "quadratic"sv,
                                    "central-linear"sv, "yin-zhang"sv, "one-point"sv};
  static constexpr std::array values{WallRule::linear,         WallRule::halfway,   WallRule::quadratic,
                                     WallRule::central_linear, WallRule::yin_zhang, WallRule::one_point};
  const std::string name = table.choice("wall_rule", rules);
  for (std::size_t n = 0; n < rules.size(); ++n) {
    if (name == rules[n]) return values[n];
  }
  return fallback;
}

namespace {

void read_steady(SceneTable& fluid, FluidScene& result) {
  constexpr std::int64_t default_maximum = 1'000'000;
  result.steady_maximum_steps = default_maximum;
  if (auto steady = fluid.table_if("steady")) {
    result.steady_tolerance = steady->number_or("tolerance", 1e-6, {1e-12, 0.1, false});
    result.steady_maximum_steps = static_cast<std::uint64_t>(
        steady->integer_or("maximum_steps", default_maximum, 1, 1'000'000'000'000));
  }
}

void read_initial(SceneTable& fluid, int dimension, FluidScene& result) {
  if (auto initial = fluid.table_if("initial")) {
    if (initial->has("velocity"))
      result.initial_velocity = parse_expressions(*initial, "velocity", dimension);
    if (initial->has("pressure")) {
      result.initial_pressure = parse_expression(*initial, "pressure", initial->expression("pressure"));
    }
  }
}

bool never_saves(SceneTable recovery) {
  return recovery.has("every") && recovery.integer_or("every", 1, 0, 1'000'000'000) == 0;
}

}  // namespace

FluidScene read_fluid_scene(Scene& scene, const std::string& role, Plan& plan) {
  FluidScene result;
  auto root = scene.root();
  const auto dimension = static_cast<int>(root.integer_or("dimension", 2, 2, 3));
  result.has_solid = root.has("solid");
  result.has_grains = root.has("grains");
  result.has_partner = result.has_solid || result.has_grains;
  if (auto coupling = root.table_if("coupling")) {
    static constexpr std::array modes{"steady"sv, "transient"sv};
    result.mode = coupling->choice("mode", modes) == "steady" ? Mode::steady : Mode::transient;
    if (result.mode == Mode::transient && coupling->has("window")) {
      result.window = coupling->number("window", Range::positive());
      result.end_time = coupling->number_or("end_time", 0.0);
      result.repeats_windows =
          result.has_solid && coupling->text_or("scheme", "serial-implicit").ends_with("implicit");
    }
  }
  if (auto output = root.table_if("output")) result.writes_frames = output->boolean_or("frames", true);
  const auto recovery = root.table_if("recovery");
  result.writes_checkpoints = result.mode == Mode::transient && !(recovery && never_saves(*recovery));
  auto fluid = root.table(role);
  fluid.leave_to_others({"solver", "connect", "threads"});
  read_sides(fluid, dimension, result);
  read_grid(fluid, dimension, result);
  read_time_step(fluid, result, plan);
  read_model(fluid, dimension, result, plan);
  read_obstacles(fluid, result, plan);
  read_ranks(fluid, result, plan);
  read_steady(fluid, result);
  read_initial(fluid, dimension, result);
  read_watches(root, role, dimension, result);
  fluid.refuse_unknown_keys();
  if (!scene.problems().empty()) return result;
  FlowSettings& flow = result.flow;
  flow.rates = relaxation_rates(result.units.lattice_viscosity(), flow.magic_parameter);
  flow.law.base_viscosity = result.units.lattice_viscosity();
  flow.law.rate_scale = 1 / result.units.time_step;
  flow.law.viscosity_scale =
      result.units.time_step / (result.units.density * result.units.spacing * result.units.spacing);
  flow.acceleration = evaluate_body_force(result, 0.0);
  // Per step, from the dimensionless constant: sigma c_s / length.
  for (std::size_t s = 0; s < 6; ++s) {
    if (flow.sides[s].kind != SideKind::outflow) continue;
    const std::array<int, 3> counts{flow.grid.nx, flow.grid.ny, flow.grid.layers()};
    flow.sides[s].relaxation *= 0.57735026918962576 / counts[s / 2];
  }
  check_side_values(fluid, result, plan);
  fill_plan(result, plan);
  return result;
}

}  // namespace estuary::fluid
