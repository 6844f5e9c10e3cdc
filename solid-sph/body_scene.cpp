// Bodies of a solid scene: their kinds and materials, how finely they are filled.
#include <algorithm>
#include <cmath>

#include "solid_scene.hpp"

namespace estuary::solid {
namespace {

constexpr Range kPoissonRatios{.minimum = -1.0, .maximum = 0.5, .exclusive = true};

Plasticity read_plasticity(SceneTable& table, const Plasticity& fallback) {
  if (!table.has("yield_stress")) {
    table.leave_to_others({"yield_strain", "hardening_modulus", "reference_rate", "rate_exponent", "damage"});
    for (const char* key : {"yield_strain", "hardening_modulus", "reference_rate", "rate_exponent", "damage"})
      if (table.has(key)) table.problem(key, "needs `yield_stress` in the same table");
    return fallback;
  }
  Plasticity result;
  if (table.has("yield_strain")) {
    result.yield = table.numbers("yield_stress", 0);
    result.strain = table.numbers("yield_strain", 0);
    if (result.yield.size() != result.strain.size() || result.strain.empty() || result.strain.front() != 0)
      table.problem("yield_strain",
                    "wants as many plastic strains as `yield_stress` has stresses, from 0 on");
    for (std::size_t k = 0; k < result.yield.size(); ++k)
      if (!(result.yield[k] > 0)) table.problem("yield_stress", "must be positive");
    for (std::size_t k = 1; k < std::min(result.strain.size(), result.yield.size()); ++k) {
      if (!(result.strain[k] > result.strain[k - 1])) table.problem("yield_strain", "must ascend");
      if (k + 1 == result.strain.size() && result.yield[k] < result.yield[k - 1])
        table.problem("yield_stress",
                      "must not fall at its end, where its slope goes on for ever; end on a level stretch");
    }
    if (table.has("hardening_modulus"))
      table.problem("hardening_modulus", "is not used together with `yield_strain`");
  } else {
    const double yield = table.number("yield_stress", Range::positive());
    const double slope = table.number_or("hardening_modulus", 0, Range::not_negative());
    result.strain = {0, 1};
    result.yield = {yield, yield + slope};
  }
  result.reference_rate = table.number_or("reference_rate", 0, Range::not_negative());
  result.rate_exponent = table.number_or("rate_exponent", 1, {.minimum = 0.1, .maximum = 100});
  if (auto damage = table.table_if("damage")) {
    result.damage_from = damage->number("from_strain", Range::not_negative());
    result.damage_to = damage->number("to_strain", Range::positive());
    result.damage_limit = damage->number_or("limit", 0.99, {.minimum = 1e-6, .maximum = 0.999});
    if (!(result.damage_to > result.damage_from))
      damage->problem("to_strain", "must lie above `from_strain`");
  }
  return result;
}

// What [solid] says for bodies that do not say it themselves; 0 where it says nothing.
struct SharedMaterial : MaterialScene {
  bool has_ratio = false;
};

SharedMaterial read_shared_material(SceneTable& solid) {
  SharedMaterial shared;
  if (solid.has("density")) shared.density = solid.number("density", Range::positive());
  if (solid.has("young_modulus")) shared.young_modulus = solid.number("young_modulus", Range::positive());
  shared.has_ratio = solid.has("poisson_ratio");
  if (shared.has_ratio) shared.poisson_ratio = solid.number("poisson_ratio", kPoissonRatios);
  shared.plasticity = read_plasticity(solid, {});
  return shared;
}

// A table's own values, those of `shared` for what it does not say; all are wanted when there is none.
MaterialScene read_material(SceneTable& table, const SharedMaterial* shared) {
  MaterialScene result;
  const auto number = [&](const char* key, double MaterialScene::*value) {
    result.*value = shared != nullptr && shared->*value != 0
                        ? table.number_or(key, shared->*value, Range::positive())
                        : table.number(key, Range::positive());
  };
  number("density", &MaterialScene::density);
  number("young_modulus", &MaterialScene::young_modulus);
  result.poisson_ratio = shared != nullptr && shared->has_ratio
                             ? table.number_or("poisson_ratio", shared->poisson_ratio, kPoissonRatios)
                             : table.number("poisson_ratio", kPoissonRatios);
  result.plasticity = read_plasticity(table, shared != nullptr ? shared->plasticity : Plasticity{});
  return result;
}

void read_velocity(SceneTable& table, BodyScene& body) {
  if (!table.has("velocity")) return;
  const auto words = table.expressions("velocity", 2);
  for (std::size_t c = 0; c < words.size() && c < 2; ++c) {
    check_expression(table, "velocity", words[c]);
    body.velocity[c] = words[c];
  }
}

// Of [solid] itself, or of a [[solid.body]], which takes from `shared` what it does not say.
BodyScene read_body(SceneTable& table, const SolidScene& scene, const SharedMaterial* shared,
                    const std::string& name) {
  BodyScene body;
  body.name = name;
  read_shape(table, scene.spacing, body);
  const double density = shared != nullptr ? shared->density : 0;
  const Kind kind = read_kind(table);
  if (kind == Kind::rigid)
    read_rigid(table, scene, density, body);
  else if (kind == Kind::fluid)
    read_fluid(table, density, body);
  else
    body.material = read_material(table, shared);
  if (kind == Kind::shell || kind == Kind::deformable) read_rupture(table, body);
  if (kind == Kind::shell)
    read_shell(table, body);
  else if (body.shape == Shape::polyline)
    table.problem("polyline", "is of a body with kind = \"shell\"");
  read_velocity(table, body);
  for (const Side side : read_sides(table, "clamped"))
    body.box.clamped[static_cast<std::size_t>(side)] = true;
  if (body.shape != Shape::box && table.has("clamped"))
    table.problem("clamped", "names sides of a box; use [[solid.hold]] for other shapes");
  return body;
}

void read_filling(SceneTable& solid, SolidScene& result) {
  const bool by_spacing = solid.has("spacing"), by_number = solid.has("particles_across");
  if (by_spacing == by_number)
    solid.problem(by_spacing ? "spacing" : "", "give either `spacing` [m] or `particles_across`");
  if (by_spacing) result.spacing = solid.number("spacing", Range::positive());
  const BodyScene& first = result.bodies.front();
  double thin = 0, area = 0;
  for (const BodyScene& body : result.bodies) {
    if (body.shape == Shape::points) continue;
    double low[2] = {1e300, 1e300}, high[2] = {-1e300, -1e300};
    for (const Polygon& loop : body.outline(1e300))
      for (const auto& point : loop)
        for (std::size_t c = 0; c < 2; ++c) {
          low[c] = std::min(low[c], point[c]);
          high[c] = std::max(high[c], point[c]);
        }
    if (!(high[0] > low[0])) continue;
    const double extent = std::min(high[0] - low[0], high[1] - low[1]);
    if (thin == 0) thin = extent;
    area += (high[0] - low[0]) * (high[1] - low[1]);
    if (by_spacing && result.spacing > 0.5 * extent * (1 + 1e-9))
      solid.problem("spacing", "leaves fewer than two particles across the thinner side" +
                                   (result.bodies.size() > 1 ? " of \"" + body.name + "\"" : std::string()) +
                                   ", too few for a gradient; use at most " + std::to_string(0.5 * extent) +
                                   " m");
  }
  if (by_number) {
    auto count = static_cast<double>(std::max<std::int64_t>(1, solid.integer("particles_across", 2, 10000)));
    if (result.placement == Placement::on_contour && result.nearly_incompressible(first) &&
        std::fmod(count, 2.0) == 1)
      result.raised = ++count;
    if (first.shape == Shape::points) solid.problem("particles_across", "a point list needs `spacing`");
    result.spacing = (thin > 0 ? thin : 1.0) / count;
  }
  const bool too_fine = area / (result.spacing * result.spacing) > 5e6;
  if (result.spacing > 0 && too_fine)
    solid.problem(by_spacing ? "spacing" : "particles_across",
                  "makes more than five million particles; use a coarser spacing");
  // The scene is refused by then. What is read after this draws outlines, and needs a spacing that can be
  // drawn.
  if (!(result.spacing > 0) || too_fine) result.spacing = thin > 0 ? 0.5 * thin : 1.0;
}

}  // namespace

void read_bodies(SceneTable& solid, SolidScene& result) {
  constexpr std::array<std::string_view, 2> clamps{"line", "extra_rows"};
  result.clamp = solid.choice("clamp", clamps) == "line" ? Clamp::line : Clamp::extra_rows;
  constexpr std::array<std::string_view, 2> placements{"on_contour", "cell_centres"};
  result.placement = solid.choice("placement", placements) == "cell_centres" ? Placement::cell_centres
                                                                             : Placement::on_contour;
  for (const std::string& word : solid.texts_or_empty("periodic")) {
    if (word != "x")
      solid.problem("periodic", "only [\"x\"] is possible, not \"" + word + "\"");
    else
      result.periodic = true;
  }
  constexpr std::array<std::string_view, 5> laws{"saint_venant_kirchhoff", "hooke_almansi", "neo_hooke",
                                                 "neo_hooke_isochoric", "j2_plasticity"};
  const std::string law = solid.choice("law", laws);
  result.law = static_cast<LawName>(std::find(laws.begin(), laws.end(), law) - laws.begin());
  constexpr std::array<std::string_view, 2> planes{"strain", "stress"};
  result.plane = solid.choice("plane", planes) == "stress" ? Plane::stress : Plane::strain;

  // A point list wants the spacing for its volumes.
  if (solid.has("spacing")) result.spacing = solid.number("spacing", Range::positive());
  auto tables = solid.tables("body");
  if (tables.empty()) {
    add_bodies(solid, result, read_body(solid, result, nullptr, "body"));
  } else {
    for (const std::string_view shape : kShapeKeys)
      if (solid.has(shape)) solid.problem(shape, "belongs into the [[solid.body]] tables");
    const SharedMaterial shared = read_shared_material(solid);
    if (tables.size() > 200) solid.problem("body", "more than 200 bodies");
    for (SceneTable& table : tables) {
      const std::string name = table.text_or("name", "body " + std::to_string(result.bodies.size() + 1));
      add_bodies(table, result, read_body(table, result, &shared, name));
    }
    if (result.clamp != Clamp::line || result.placement != Placement::on_contour)
      solid.problem(result.clamp != Clamp::line ? "clamp" : "placement",
                    "is available for a single box only");
  }
  if (result.periodic && !result.single_box())
    solid.problem("periodic", "is available for a single box only");
  read_filling(solid, result);
  for (BodyScene& body : result.bodies) {
    body.box.spacing = result.spacing;
    body.box.clamp = result.clamp;
    body.box.placement = result.placement;
    body.box.even = result.nearly_incompressible(body);
    body.box.periodic = result.periodic;
    if (result.law == LawName::j2_plasticity) continue;
    if (!body.material.plasticity.yield.empty())
      solid.problem("law", "`yield_stress` needs law = \"j2_plasticity\"");
  }
  const Box& box = result.bodies.front().box;
  if (result.periodic && (box.clamped[0] || box.clamped[2]))
    solid.problem("clamped", "a side across the periodic direction cannot be clamped");
}

}  // namespace estuary::solid
