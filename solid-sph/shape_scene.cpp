// Shapes of the bodies of a solid scene: boxes, discs, polygons, pictures, lists of points.
#include <algorithm>
#include <cmath>
#include <fstream>
#include <sstream>

#include "image_outline.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {
namespace {

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

void read_shape(SceneTable& table, double spacing, BodyScene& body) {
  std::vector<std::string_view> given;
  for (const std::string_view shape : kShapeKeys)
    if (table.has(shape)) given.push_back(shape);
  if (given.size() != 1) {
    table.problem(given.empty() ? "" : given[1],
                  "give one of `box`, `disc`, `polygon`, `image`, `points` or `polyline`");
    for (const std::string_view shape : kShapeKeys) table.leave_to_others({shape});
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
    body.shape = Shape::polygon;  // see add_bodies
  } else if (given[0] == "polyline") {
    body.shape = Shape::polyline;
    const std::vector<double> points = table.points("polyline", 2);
    Polygon& line = body.loops.emplace_back();
    for (std::size_t k = 0; k + 1 < points.size(); k += 2) line.push_back({points[k], points[k + 1]});
    if (line.size() < 2) table.problem("polyline", "needs at least two points [[x, y], ...]");
  } else {
    body.shape = Shape::points;
    const std::string file = table.file("points");
    if (!file.empty()) read_points(table, file, spacing > 0 ? spacing : 1.0, body);
  }
}

void add_bodies(SceneTable& table, SolidScene& scene, const BodyScene& body) {
  if (!table.has("image")) {
    scene.bodies.push_back(body);
    return;
  }
  const auto regions = regions_of(table.table("image"), scene, body);
  scene.bodies.insert(scene.bodies.end(), regions.begin(), regions.end());
  if (regions.empty()) scene.bodies.push_back(body);
  if (scene.bodies.size() > 200) table.problem("image", "makes more than 200 bodies");
}

}  // namespace estuary::solid
