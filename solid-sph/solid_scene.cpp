#include "solid_scene.hpp"

#include <algorithm>
#include <cmath>

#include "expression.hpp"

namespace estuary::solid {
namespace {

constexpr std::array<std::string_view, 4> kSides{"left", "top", "right", "bottom"};

std::string list_of_sides() {
  return "\"left\", \"top\", \"right\" or \"bottom\"";
}

std::optional<Side> side_named(const std::string& word) {
  for (std::size_t s = 0; s < kSides.size(); ++s)
    if (word == kSides[s]) return static_cast<Side>(s);
  return std::nullopt;
}

std::vector<Side> read_sides(SceneTable& solid, std::string_view key) {
  std::vector<Side> sides;
  for (const std::string& word : solid.texts_or_empty(key)) {
    const auto side = side_named(word);
    if (!side) {
      solid.problem(key, "\"" + word + "\" is not a side of a box; use " + list_of_sides());
    } else if (std::find(sides.begin(), sides.end(), *side) != sides.end()) {
      solid.problem(key, "\"" + word + "\" is named twice");
    } else {
      sides.push_back(*side);
    }
  }
  return sides;
}

void read_box(SceneTable& solid, SolidScene& result) {
  SceneTable table = solid.table("box");
  const auto from = table.numbers("from", 2), to = table.numbers("to", 2);
  bool usable = from.size() == 2 && to.size() == 2;
  for (std::size_t c = 0; usable && c < 2; ++c) {
    result.box.from[c] = from[c];
    result.box.to[c] = to[c];
    if (!(to[c] > from[c]) || !std::isfinite(to[c] - from[c])) {
      table.problem("to", "must lie right of and above `from`");
      usable = false;
    }
  }
  const bool by_spacing = solid.has("spacing"), by_number = solid.has("particles_across");
  if (by_spacing == by_number)
    solid.problem(by_spacing ? "spacing" : "", "give either `spacing` [m] or `particles_across`");
  const double thin = usable ? std::min(result.box.length(0), result.box.length(1)) : 1.0;
  if (by_spacing) result.box.spacing = solid.number("spacing", Range::positive());
  if (by_number)
    result.box.spacing =
        thin / static_cast<double>(std::max<std::int64_t>(1, solid.integer("particles_across", 2, 10000)));
  for (const Side side : read_sides(solid, "clamped"))
    result.box.clamped[static_cast<std::size_t>(side)] = true;
  constexpr std::array<std::string_view, 2> clamps{"line", "extra_rows"};
  result.box.clamp = solid.choice("clamp", clamps) == "line" ? Clamp::line : Clamp::extra_rows;
  constexpr std::array<std::string_view, 2> placements{"on_contour", "cell_centres"};
  result.box.placement = solid.choice("placement", placements) == "cell_centres" ? Placement::cell_centres
                                                                                 : Placement::on_contour;
  for (const std::string& word : solid.texts_or_empty("periodic")) {
    if (word != "x")
      solid.problem("periodic", "only [\"x\"] is possible, not \"" + word + "\"");
    else
      result.box.periodic = true;
  }
  if (!usable || !(result.box.spacing > 0)) return;
  if (result.box.spacing > 0.5 * thin * (1 + 1e-9)) {
    solid.problem("spacing",
                  "leaves fewer than two particles across the thinner side, too few for a gradient; "
                  "use at most " +
                      std::to_string(0.5 * thin) + " m");
    return;
  }
  const double particles =
      result.box.length(0) / result.box.spacing * result.box.length(1) / result.box.spacing;
  if (particles > 5e6) {
    solid.problem(by_spacing ? "spacing" : "particles_across",
                  "makes more than five million particles; use a coarser spacing");
    return;
  }
  if (result.box.periodic && (result.box.clamped[0] || result.box.clamped[2]))
    solid.problem("clamped", "a side across the periodic direction cannot be clamped");
}

void read_material(SceneTable& solid, SolidScene& result) {
  result.density = solid.number("density", Range::positive());
  result.young_modulus = solid.number("young_modulus", Range::positive());
  result.poisson_ratio = solid.number("poisson_ratio", {.minimum = -1.0, .maximum = 0.5, .exclusive = true});
  constexpr std::array<std::string_view, 3> laws{"saint_venant_kirchhoff", "hooke_almansi", "neo_hooke"};
  const std::string law = solid.choice("law", laws);
  result.law = law == "hooke_almansi" ? LawName::hooke_almansi
               : law == "neo_hooke"   ? LawName::neo_hooke
                                      : LawName::saint_venant_kirchhoff;
  constexpr std::array<std::string_view, 2> planes{"strain", "stress"};
  result.plane = solid.choice("plane", planes) == "stress" ? Plane::stress : Plane::strain;
  if (result.law == LawName::neo_hooke && result.plane == Plane::stress)
    solid.problem("plane",
                  "neo_hooke is available in plane strain only; use \"strain\", or the law "
                  "saint_venant_kirchhoff or hooke_almansi");
}

void read_method(SceneTable& solid, SolidScene& result) {
  // With particles on the contour the linear correction is already exact where a quadratic one would be
  // needed.
  constexpr std::array<std::string_view, 2> corrections{"linear", "quadratic"};
  const bool on_contour = result.box.placement == Placement::on_contour;
  result.order =
      solid.has("correction")
          ? solid.choice("correction", corrections) == "quadratic" ? Order::quadratic : Order::linear
      : on_contour ? Order::linear
                   : Order::quadratic;
  result.smoothing_ratio = solid.number_or("smoothing_ratio", 0.95, {.minimum = 0.75, .maximum = 2.0});
  const double stabilisation = on_contour ? 0.02 : result.order == Order::quadratic ? 0.05 : 0.0;
  result.stabilisation = solid.number_or("stabilisation", stabilisation, {.minimum = 0.0, .maximum = 1.0});
  result.viscosity_linear = solid.number_or("viscosity_linear", 0.2, {.minimum = 0.0, .maximum = 10.0});
  result.viscosity_quadratic = solid.number_or("viscosity_quadratic", 0.4, {.minimum = 0.0, .maximum = 10.0});
  result.courant = solid.number_or("courant", 0.8, {.minimum = 1e-3, .maximum = 1.0});
  result.damping = solid.number_or("damping", 0.0, Range::not_negative());
  constexpr std::array<std::string_view, 2> methods{"newton", "relaxation"};
  result.steady.tolerance = 1e-6;
  bool relaxation = false;
  std::int64_t steps = 0;
  if (auto steady = solid.table_if("steady")) {
    result.steady.tolerance = steady->number_or("tolerance", 1e-6, {.minimum = 1e-12, .maximum = 0.1});
    relaxation = steady->choice("method", methods) == "relaxation";
    steps = steady->integer_or("maximum_steps", 0, 0, 1'000'000'000);
  }
  result.method = relaxation ? SteadyMethod::relaxation : SteadyMethod::newton;
  result.steady.maximum_steps = steps > 0 ? static_cast<std::uint64_t>(steps) : relaxation ? 2'000'000 : 1000;
}

void read_loads(SceneTable& solid, SolidScene& result) {
  for (const std::string& word : solid.texts_or_empty("held")) {
    if (word != "x" && word != "y") {
      solid.problem("held", "only \"x\" and \"y\" can be held, not \"" + word + "\"");
    } else if (result.mode == Mode::steady) {
      solid.problem("held", "is available in transient mode only");
    } else {
      result.held[word == "x" ? 0 : 1] = true;
    }
  }
  if (solid.has("window_load") && result.mode == Mode::steady)
    solid.problem("window_load", "has a meaning in transient mode only");
  constexpr std::array<std::string_view, 3> window_loads{"mean", "linear", "received"};
  const std::string window_load = solid.choice("window_load", window_loads);
  result.window_load = window_load == "linear"     ? WindowLoad::linear
                       : window_load == "received" ? WindowLoad::received
                                                   : WindowLoad::mean;
  if (solid.has("gravity")) {
    const auto gravity = solid.numbers("gravity", 2);
    if (gravity.size() == 2) result.gravity = {gravity[0], gravity[1]};
  }
  for (SceneTable& table : solid.tables("load")) {
    SideLoadScene load;
    const std::string word = table.text("side");
    const auto side = side_named(word);
    if (!side) {
      if (!word.empty())
        table.problem("side", "\"" + word + "\" is not a side of a box; use " + list_of_sides());
    } else {
      load.side = *side;
      if (result.box.clamped[static_cast<std::size_t>(*side)])
        table.problem("side", "\"" + word + "\" is clamped: a load on it would have no effect");
      if (result.box.periodic && (*side == Side::left || *side == Side::right))
        table.problem("side", "a body periodic in x has no \"" + word + "\" side");
    }
    const auto force = table.numbers("force", 2);
    if (force.size() == 2) load.force = {force[0], force[1]};
    if (table.has("ramp")) {
      load.ramp = table.expression("ramp");
      try {
        const Expression ramp(load.ramp);
        if (!std::isfinite(ramp(0, 0, 0, 0))) table.problem("ramp", "is not finite at t = 0");
      } catch (const std::invalid_argument& error) {
        table.problem("ramp", error.what());
      }
    }
    result.loads.push_back(std::move(load));
  }
}

void read_wet(SceneTable& solid, SolidScene& result) {
  result.wet = read_sides(solid, "wet");
  if (result.wet.empty()) return;
  std::array<bool, 4> wet{};
  for (const Side side : result.wet) wet[static_cast<std::size_t>(side)] = true;
  int starts = 0;
  for (std::size_t s = 0; s < 4; ++s) {
    if (wet[s] && !wet[(s + 3) % 4]) ++starts;
    if (wet[s] && result.box.clamped[s])
      solid.problem("wet", std::string("the side \"") + kSideNames[s] + "\" is clamped and cannot be wet");
  }
  if (starts > 1)
    solid.problem("wet", "the wet sides must follow one another round the box (left, top, right, bottom)");
  if (result.box.periodic && (wet[0] || wet[2]))
    solid.problem("wet", "a body periodic in x has no left and no right side");
}

void read_watches(SceneTable& root, const std::string& role, SolidScene& result) {
  for (SceneTable& table : root.tables("watch")) {
    if (table.text_or("participant", "") != role) continue;
    WatchScene watch;
    watch.name = table.text("name");
    if (table.has("point")) {
      const auto point = table.numbers("point", 2);
      if (point.size() == 2) {
        watch.point = {point[0], point[1]};
        const double slip = 1e-9 * result.box.spacing;
        for (std::size_t c = 0; c < 2; ++c)
          if (point[c] < result.box.from[c] - slip || point[c] > result.box.to[c] + slip) {
            table.problem("point", "lies outside the body's reference box");
            break;
          }
      }
    }
    for (const char* key : {"line", "samples"})
      if (table.has(key)) table.problem(key, "the solid watches points and totals, not lines");
    result.watches.push_back(std::move(watch));
  }
}

}  // namespace

double SolidScene::wave_speed() const {
  return std::sqrt(constants().wave_modulus() / density);
}

double SolidScene::courant_step(const std::array<double, 2>& spacing) const {
  return courant * std::min(spacing[0], spacing[1]) / wave_speed();
}

SolverOptions SolidScene::solver_options() const {
  SolverOptions options;
  options.constants = constants();
  options.order = order;
  options.stabilisation_modulus = stabilisation * options.constants.wave_modulus();
  // An equilibrium has no velocity, so a steady run is compiled without viscosity.
  if (mode == Mode::transient)
    options.viscosity = {.linear = viscosity_linear,
                         .quadratic = viscosity_quadratic,
                         .sound_speed = wave_speed(),
                         .smoothing_length = 0,
                         .density = density};
  return options;
}

SolidScene read_solid_scene(Scene& scene, const std::string& role) {
  SolidScene result;
  SceneTable root = scene.root();
  if (root.integer_or("dimension", 2, 2, 3) != 2)
    root.problem("dimension", "this solid computes in two dimensions only; use dimension = 2");
  if (auto coupling = root.table_if("coupling")) {
    constexpr std::array<std::string_view, 2> modes{"steady", "transient"};
    result.mode = coupling->choice("mode", modes) == "transient" ? Mode::transient : Mode::steady;
    if (result.mode == Mode::transient) {
      result.window = coupling->number("window", Range::positive());
      result.end_time = coupling->number("end_time", Range::positive());
    }
  }
  SceneTable solid = root.table(role);
  solid.leave_to_others({"solver", "connect", "threads"});
  read_box(solid, result);
  read_material(solid, result);
  read_method(solid, result);
  read_loads(solid, result);
  read_wet(solid, result);
  read_watches(root, role, result);
  const bool held =
      std::find(result.box.clamped.begin(), result.box.clamped.end(), true) != result.box.clamped.end();
  if (result.mode == Mode::steady && !held)
    solid.problem("clamped", "a steady run needs a clamped side: a free body has no unique equilibrium");
  solid.refuse_unknown_keys();
  return result;
}

}  // namespace estuary::solid
