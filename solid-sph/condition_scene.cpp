// Conditions of a solid scene: what is held or moved, what is loaded, what is wet.
#include <algorithm>
#include <cmath>

#include "expression.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {
namespace {

constexpr std::array<std::string_view, 4> kSides{"left", "top", "right", "bottom"};

std::string list_of_sides() {
  return "\"left\", \"top\", \"right\" or \"bottom\"";
}

// `body`, and one of `side`, `line` and `region`; none of them means the whole contour (body, for a hold). A
// region of a hold may be that of every body.
Place read_place(SceneTable& table, const SolidScene& scene, bool of_every_body = false) {
  Place place;
  if (table.has("body")) {
    const std::string name = table.text("body");
    const auto found = std::find_if(scene.bodies.begin(), scene.bodies.end(),
                                    [&](const BodyScene& body) { return body.name == name; });
    if (found == scene.bodies.end())
      table.problem("body", "no [[solid.body]] has the name \"" + name + "\"");
    else
      place.body = static_cast<std::size_t>(found - scene.bodies.begin());
  } else if (scene.bodies.size() > 1 && of_every_body && table.has("region")) {
    place.every_body = true;
  } else if (scene.bodies.size() > 1) {
    table.problem("", "which `body`? There are several");
  }
  const BodyScene& body = scene.bodies[place.body];
  int given = 0;
  if (table.has("side")) {
    ++given;
    const std::string word = table.text("side");
    place.side = side_named(word);
    if (!place.side && !word.empty())
      table.problem("side", "\"" + word + "\" is not a side of a box; use " + list_of_sides());
    if (body.shape != Shape::box) table.problem("side", "is of a box; use `line` or `region`");
  }
  if (table.has("line")) {
    ++given;
    const auto points = table.points("line", 2);
    if (points.size() == 4)
      place.stretch = {points[0], points[1], points[2], points[3]};
    else
      table.problem("line", "wants two points [[x, y], [x, y]]");
  }
  if (table.has("region")) {
    ++given;
    const auto points = table.points("region", 2);
    if (points.size() == 4 && points[2] >= points[0] && points[3] >= points[1])
      place.region = {points[0], points[1], points[2], points[3]};
    else
      table.problem("region", "wants the lower left and the upper right corner [[x, y], [x, y]]");
  }
  if (given > 1) table.problem("", "give only one of `side`, `line` and `region`");
  return place;
}

bool outlined(const SolidScene& scene, const Place& place) {
  return scene.placement == Placement::on_contour && scene.clamp == Clamp::line && !scene.periodic &&
         scene.bodies[place.body].shape != Shape::points;
}

void read_holds(SceneTable& solid, SolidScene& result) {
  for (SceneTable& table : solid.tables("hold")) {
    HoldScene hold;
    hold.name = table.text_or("name", "");
    for (const HoldScene& other : result.holds)
      if (!hold.name.empty() && other.name == hold.name)
        table.problem("name", "is that of an earlier [[solid.hold]]");
    hold.place = read_place(table, result, true);
    if (result.bodies[hold.place.body].rigid)
      table.problem("", "is of deformable bodies; a rigid one has `held` and `motion`");
    if (!hold.place.region && !outlined(result, hold.place))
      table.problem("", "here only a `region` can be held: there are no particles on the contour");
    if (table.has("components")) {
      hold.component = {false, false};
      hold.rotation = false;
      for (const std::string& word : table.texts_or_empty("components")) {
        if (word == "x" || word == "y")
          hold.component[word == "x" ? 0 : 1] = true;
        else if (word == "rotation" && result.bodies[hold.place.body].shell)
          hold.rotation = true;
        else
          table.problem("components", "only \"x\" and \"y\" can be held, not \"" + word + "\"");
      }
    }
    if (table.has("displacement")) {
      const auto words = table.expressions("displacement", 2);
      for (std::size_t c = 0; c < words.size() && c < 2; ++c) {
        check_expression(table, "displacement", words[c]);
        hold.displacement[c] = words[c];
      }
    }
    result.holds.push_back(std::move(hold));
  }
}

void read_load(SceneTable& table, SolidScene& result) {
  LoadScene load;
  load.place = read_place(table, result);
  const bool shell = result.bodies[load.place.body].shell.has_value();
  const int given = (table.has("force") ? 1 : 0) + (table.has("traction") ? 1 : 0) +
                    (table.has("pressure") ? 1 : 0) + (shell && table.has("moment") ? 1 : 0);
  if (given != 1)
    table.problem("", shell ? "give one of `force`, `moment`, `traction` and `pressure`"
                            : "give one of `force`, `traction` and `pressure`");
  if (shell && table.has("moment")) load.moment = table.number("moment");
  const Place& place = load.place;
  if (place.side) {
    const Box& box = result.bodies[place.body].box;
    const auto side = static_cast<std::size_t>(*place.side);
    if (box.clamped[side])
      table.problem("side",
                    "\"" + std::string(kSides[side]) + "\" is clamped: a load on it would have no effect");
    if (result.periodic && (side == 0 || side == 2))
      table.problem("side", "a body periodic in x has no \"" + std::string(kSides[side]) + "\" side");
  }
  const bool only_sides = !outlined(result, place);
  if (only_sides && (!(place.side || place.region) || !table.has("force")))
    table.problem("",
                  "here only a `force` on a `side` of a box or on the particles of a `region` is possible: "
                  "there are no "
                  "particles on the contour");
  if (table.has("force")) {
    const auto force = table.numbers("force", 2);
    if (force.size() == 2) load.force = {force[0], force[1]};
  }
  if (table.has("force") || load.moment != 0) {
    if (table.has("ramp")) {
      load.ramp = table.expression("ramp");
      check_expression(table, "ramp", load.ramp);
    }
  } else if (table.has("ramp")) {
    table.leave_to_others({"ramp"});
    table.problem("ramp", "goes with `force`; write the factor into the expression");
  }
  if (table.has("traction")) {
    const auto words = table.expressions("traction", 2);
    for (std::size_t c = 0; c < words.size() && c < 2; ++c) {
      check_expression(table, "traction", words[c]);
      load.traction[c] = words[c];
    }
  }
  if (table.has("pressure")) {
    load.pressure = table.expression("pressure");
    check_expression(table, "pressure", load.pressure);
  }
  result.loads.push_back(std::move(load));
}

void read_wet(SceneTable& solid, SolidScene& result) {
  const auto words = solid.texts_or_empty("wet");
  if (words.size() == 1 && words.front() == "contour") {
    result.wet_contour = true;
    if (!outlined(result, {})) solid.problem("wet", "\"contour\" needs particles on the contour");
    return;
  }
  result.wet = read_sides(solid, "wet");
  if (result.wet.empty()) return;
  if (!result.single_box()) {
    solid.problem("wet",
                  "names sides of a single box; use [\"contour\"] for other shapes and several bodies");
    return;
  }
  const Box& box = result.bodies.front().box;
  std::array<bool, 4> wet{};
  for (const Side side : result.wet) wet[static_cast<std::size_t>(side)] = true;
  int starts = 0;
  for (std::size_t s = 0; s < 4; ++s) {
    if (wet[s] && !wet[(s + 3) % 4]) ++starts;
    if (wet[s] && box.clamped[s])
      solid.problem("wet", std::string("the side \"") + kSideNames[s] + "\" is clamped and cannot be wet");
  }
  if (starts > 1)
    solid.problem("wet", "the wet sides must follow one another round the box (left, top, right, bottom)");
  if (result.periodic && (wet[0] || wet[2]))
    solid.problem("wet", "a body periodic in x has no left and no right side");
}

}  // namespace

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

void check_expression(SceneTable& table, std::string_view key, const std::string& text) {
  try {
    const Expression expression(text);
    if (!std::isfinite(expression(0.1, 0.1, 0, 0))) table.problem(key, "is not finite at t = 0");
  } catch (const std::invalid_argument& error) {
    table.problem(key, error.what());
  }
}

void read_conditions(SceneTable& solid, SolidScene& result) {
  const bool own_held = result.bodies.size() == 1 && result.bodies.front().rigid.has_value();
  for (const std::string& word : own_held ? std::vector<std::string>{} : solid.texts_or_empty("held")) {
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
  constexpr std::array<std::string_view, 4> window_loads{"mean", "linear", "quadratic", "received"};
  const std::string window_load = solid.choice("window_load", window_loads);
  result.window_load = window_load == "linear"      ? WindowLoad::linear
                       : window_load == "quadratic" ? WindowLoad::quadratic
                       : window_load == "received"  ? WindowLoad::received
                                                    : WindowLoad::mean;
  if (solid.has("gravity")) {
    const auto gravity = solid.numbers("gravity", 2);
    if (gravity.size() == 2) result.gravity = {gravity[0], gravity[1]};
  }
  read_holds(solid, result);
  for (SceneTable& table : solid.tables("load")) read_load(table, result);
  read_wet(solid, result);
}

}  // namespace estuary::solid
