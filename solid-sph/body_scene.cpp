// Bodies of a solid scene: their shapes, their materials, how finely they are filled.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "image_outline.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {
namespace {

constexpr std::array<std::string_view, 6> kShapes{"box", "disc", "polygon", "image", "points", "polyline"};

// One body for each region of the picture, as copies of `body`.
std::vector<BodyScene> regions_of(SceneTable table, const SolidScene& scene, const BodyScene& body) {
  constexpr std::array<std::string_view, 2> solids{"dark", "bright"};
  ImageMap map;
  const std::string file = table.file("file");
  const auto corner = table.numbers("corner", 2);
  map.pixel = table.number("pixel", Range::positive());
  map.threshold = table.number_or("threshold", 128, {.minimum = 0, .maximum = 256});
  map.dark = table.choice("solid", solids) == "dark";
  map.flip_x = table.boolean_or("flip_x", false);
  map.flip_y = table.boolean_or("flip_y", false);
  const double d = scene.spacing;
  const double smallest = table.number_or("smallest_area", 9 * d * d, Range::not_negative());
  if (!(d > 0)) table.problem("", "an image needs `spacing` [m] rather than `particles_across`");
  if (file.empty() || corner.size() != 2 || !(map.pixel > 0) || !(d > 0)) return {};
  map.corner = {corner[0], corner[1]};
  std::vector<BodyScene> result;
  try {
    for (auto& loops : outlines_in_image(read_grey_image(file), map, d, smallest)) {
      BodyScene& region = result.emplace_back(body);
      region.shape = Shape::polygon;
      region.loops = std::move(loops);
    }
  } catch (const std::runtime_error& error) {
    table.problem("file", error.what());
    return {};
  }
  if (result.empty())
    table.problem("file",
                  "shows no solid region of at least smallest_area = " + std::to_string(smallest) + " m2");
  for (std::size_t k = 0; result.size() > 1 && k < result.size(); ++k)
    result[k].name += " " + std::to_string(k + 1);
  return result;
}

// Adds a read body, or the bodies of its picture.
void add_body(SceneTable& table, SolidScene& scene, const BodyScene& body) {
  if (!table.has("image")) {
    scene.bodies.push_back(body);
    return;
  }
  const auto regions = regions_of(table.table("image"), scene, body);
  scene.bodies.insert(scene.bodies.end(), regions.begin(), regions.end());
  if (regions.empty()) scene.bodies.push_back(body);
  if (scene.bodies.size() > 200) table.problem("image", "makes more than 200 bodies");
}

void read_box(SceneTable table, BodyScene& body) {
  const auto from = table.numbers("from", 2), to = table.numbers("to", 2);
  if (from.size() != 2 || to.size() != 2) return;
  for (std::size_t c = 0; c < 2; ++c) {
    body.box.from[c] = from[c];
    body.box.to[c] = to[c];
    if (!(to[c] > from[c]) || !std::isfinite(to[c] - from[c])) {
      table.problem("to", "must lie right of and above `from`");
      body.box.from = {0, 0};
      body.box.to = {1, 1};
      return;
    }
  }
}

bool crosses(const Polygon& p, std::size_t i, std::size_t j) {
  const auto side = [](const auto& a, const auto& b, const auto& c) {
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
  };
  const auto &a = p[i], &b = p[(i + 1) % p.size()], &c = p[j], &d = p[(j + 1) % p.size()];
  return side(a, b, c) * side(a, b, d) < 0 && side(c, d, a) * side(c, d, b) < 0;
}

void read_polygon(SceneTable& table, std::string_view key, BodyScene& body) {
  const std::vector<double> points = table.points(key, 2);
  Polygon polygon;
  for (std::size_t k = 0; k + 1 < points.size(); k += 2) polygon.push_back({points[k], points[k + 1]});
  if (polygon.size() < 3) {
    table.problem(key, "needs at least three points [[x, y], ...]");
    return;
  }
  for (std::size_t i = 0; i < polygon.size(); ++i)
    for (std::size_t j = i + 2; j < polygon.size(); ++j)
      if (crosses(polygon, i, j)) {
        table.problem(key, "crosses itself");
        return;
      }
  body.loops.push_back(std::move(polygon));
}

// Lines of "x y" or "x y volume", blank or comma between; # begins a comment.
void read_points(SceneTable& table, const std::string& file, double spacing, BodyScene& body) {
  std::ifstream in(file);
  if (!in) {
    table.problem("points", "cannot be opened: " + file);
    return;
  }
  std::string line;
  for (int number = 1; std::getline(in, line); ++number) {
    line = line.substr(0, line.find('#'));
    std::replace(line.begin(), line.end(), ',', ' ');
    std::istringstream words(line);
    double x = 0, y = 0, volume = spacing * spacing;
    if (!(words >> x)) {
      if (words.eof()) continue;
      table.problem("points", file + ", line " + std::to_string(number) + ": not a number");
      return;
    }
    const bool has_y = static_cast<bool>(words >> y);
    if (has_y && !(words >> volume)) words.clear();
    if (!has_y || !std::isfinite(x + y + volume) || !(volume > 0)) {
      table.problem("points",
                    file + ", line " + std::to_string(number) + ": wants x, y and a positive volume");
      return;
    }
    body.points.insert(body.points.end(), {x, y, volume});
    if (body.points.size() > 15'000'000) {
      table.problem("points", file + " holds more than five million points");
      return;
    }
  }
  if (body.points.size() < 9) table.problem("points", file + " holds fewer than three points");
}

void read_shape(SceneTable& table, SolidScene& result, BodyScene& body) {
  std::vector<std::string_view> given;
  for (const std::string_view shape : kShapes)
    if (table.has(shape)) given.push_back(shape);
  if (given.size() != 1) {
    table.problem(given.empty() ? "" : given[1],
                  "give one of `box`, `disc`, `polygon`, `image`, `points` or `polyline`");
    for (const std::string_view shape : kShapes) table.leave_to_others({shape});
    return;
  }
  if (given[0] == "box") {
    body.shape = Shape::box;
    read_box(table.table("box"), body);
  } else if (given[0] == "disc") {
    body.shape = Shape::disc;
    SceneTable disc = table.table("disc");
    const auto centre = disc.numbers("centre", 2);
    if (centre.size() == 2) body.centre = {centre[0], centre[1]};
    body.radius = disc.number("radius", Range::positive());
  } else if (given[0] == "polygon") {
    body.shape = Shape::polygon;
    read_polygon(table, "polygon", body);
    if (table.has("hole")) read_polygon(table, "hole", body);
  } else if (given[0] == "image") {
    body.shape = Shape::polygon;  // see add_body
  } else if (given[0] == "polyline") {
    body.shape = Shape::polyline;
    const std::vector<double> points = table.points("polyline", 2);
    Polygon& line = body.loops.emplace_back();
    for (std::size_t k = 0; k + 1 < points.size(); k += 2) line.push_back({points[k], points[k + 1]});
    if (line.size() < 2) table.problem("polyline", "needs at least two points [[x, y], ...]");
  } else {
    body.shape = Shape::points;
    const std::string file = table.file("points");
    if (!file.empty()) read_points(table, file, result.spacing > 0 ? result.spacing : 1.0, body);
  }
}

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

// A table's own values, those of `fallback` for what it does not say; all are wanted when there is none.
MaterialScene read_material(SceneTable& table, const MaterialScene* fallback) {
  MaterialScene result;
  const auto number = [&](const char* key, double MaterialScene::*value, Range range) {
    result.*value = fallback != nullptr && fallback->*value != 0
                        ? table.number_or(key, fallback->*value, range)
                        : table.number(key, range);
  };
  number("density", &MaterialScene::density, Range::positive());
  number("young_modulus", &MaterialScene::young_modulus, Range::positive());
  if (fallback != nullptr && !table.has("poisson_ratio"))
    result.poisson_ratio = fallback->poisson_ratio;
  else
    result.poisson_ratio =
        table.number("poisson_ratio", {.minimum = -1.0, .maximum = 0.5, .exclusive = true});
  result.plasticity = read_plasticity(table, fallback != nullptr ? fallback->plasticity : Plasticity{});
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
  if (result.spacing > 0 && area / (result.spacing * result.spacing) > 5e6)
    solid.problem(by_spacing ? "spacing" : "particles_across",
                  "makes more than five million particles; use a coarser spacing");
}

}  // namespace

std::vector<Polygon> BodyScene::outline(double spacing) const {
  switch (shape) {
    case Shape::box:
      return {{{box.from[0], box.from[1]},
               {box.to[0], box.from[1]},
               {box.to[0], box.to[1]},
               {box.from[0], box.to[1]}}};
    case Shape::disc:
      return {circle(centre, radius, std::min(spacing, 0.5 * radius))};
    case Shape::polygon:
      return loops;
    case Shape::points:
    case Shape::polyline:
      break;
  }
  return {};
}

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
  if ((result.law == LawName::neo_hooke || result.law == LawName::neo_hooke_isochoric) &&
      result.plane == Plane::stress)
    solid.problem("plane", law +
                               " is available in plane strain only; use \"strain\", or the law "
                               "saint_venant_kirchhoff, hooke_almansi or j2_plasticity");

  // A point list wants the spacing for its volumes.
  if (solid.has("spacing")) result.spacing = solid.number("spacing", Range::positive());
  auto tables = solid.tables("body");
  if (tables.empty()) {
    BodyScene body;
    body.name = "body";
    read_shape(solid, result, body);
    const Kind kind = read_kind(solid);
    if (kind == Kind::rigid)
      read_rigid(solid, result, 0, body);
    else if (kind == Kind::fluid)
      read_fluid(solid, 0, body);
    else
      body.material = read_material(solid, nullptr);
    if (kind == Kind::shell)
      read_shell(solid, body);
    else if (body.shape == Shape::polyline)
      solid.problem("polyline", "is of a body with kind = \"shell\"");
    read_velocity(solid, body);
    for (const Side side : read_sides(solid, "clamped"))
      body.box.clamped[static_cast<std::size_t>(side)] = true;
    if (body.shape != Shape::box && solid.has("clamped"))
      solid.problem("clamped", "names sides of a box; use [[solid.hold]] for other shapes");
    add_body(solid, result, body);
  } else {
    for (const std::string_view shape : kShapes)
      if (solid.has(shape)) solid.problem(shape, "belongs into the [[solid.body]] tables");
    MaterialScene shared;
    if (solid.has("density")) shared.density = solid.number("density", Range::positive());
    if (solid.has("young_modulus")) shared.young_modulus = solid.number("young_modulus", Range::positive());
    const bool has_ratio = solid.has("poisson_ratio");
    if (has_ratio)
      shared.poisson_ratio =
          solid.number("poisson_ratio", {.minimum = -1.0, .maximum = 0.5, .exclusive = true});
    shared.plasticity = read_plasticity(solid, {});
    if (tables.size() > 200) solid.problem("body", "more than 200 bodies");
    for (SceneTable& table : tables) {
      BodyScene body;
      body.name = table.text_or("name", "body " + std::to_string(result.bodies.size() + 1));
      read_shape(table, result, body);
      const Kind kind = read_kind(table);
      if (kind == Kind::rigid) {
        read_rigid(table, result, shared.density, body);
      } else if (kind == Kind::fluid) {
        read_fluid(table, shared.density, body);
      } else {
        if (!has_ratio && !table.has("poisson_ratio")) table.problem("", "poisson_ratio is missing");
        body.material = read_material(table, &shared);
      }
      if (kind == Kind::shell)
        read_shell(table, body);
      else if (body.shape == Shape::polyline)
        table.problem("polyline", "is of a body with kind = \"shell\"");
      read_velocity(table, body);
      for (const Side side : read_sides(table, "clamped"))
        body.box.clamped[static_cast<std::size_t>(side)] = true;
      if (body.shape != Shape::box && table.has("clamped"))
        table.problem("clamped", "names sides of a box; use [[solid.hold]] for other shapes");
      add_body(table, result, body);
    }
    for (const char* key : {"periodic"})
      if (solid.has(key)) solid.problem(key, "is available for a single box only");
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
