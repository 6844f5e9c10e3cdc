// The walls of a scene: sides of the box, planes, polylines and meshes.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scene_sections.hpp"

namespace estuary::grains {
namespace {

constexpr std::array<std::string_view, 3> kAxes{"x", "y", "z"};
constexpr std::array<std::string_view, 6> kSides{"left", "right", "bottom", "top", "back", "front"};

// From a file, scaled and shifted, or given number by number.
TriangleMesh read_mesh(SceneTable& table) {
  TriangleMesh mesh;
  try {
    if (table.has("mesh")) {
      const std::string file = table.file("mesh");
      if (!file.empty()) mesh = read_stl(file);
      const double scale = table.number_or("scale", 1, Range::positive());
      const std::vector<double> shift = vector_or(table, "shift", 3, 0);
      for (std::size_t k = 0; k < mesh.node.size(); ++k) mesh.node[k] = scale * mesh.node[k] + shift[k % 3];
      return mesh;
    }
    mesh.node = table.points("nodes", 3);
    const std::size_t nodes = mesh.node.size() / 3;
    for (const double corner : table.points("triangles", 3)) {
      if (!(corner >= 0 && corner < static_cast<double>(nodes)) || corner != std::floor(corner)) {
        table.problem("triangles", fmt::format("there is no node {:g}: they count from 0 to {}", corner,
                                               static_cast<std::ptrdiff_t>(nodes) - 1));
        return {};
      }
      mesh.triangle.push_back(static_cast<std::uint32_t>(corner));
    }
    check_mesh(mesh);
  } catch (const std::invalid_argument& error) {
    table.problem(table.has("mesh") ? "mesh" : "triangles", error.what());
  }
  return mesh;
}

}  // namespace

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
      if (d == 3)
        table.problem("polyline", "polylines are walls of the plane; use planes or a `mesh` in space");
      wall.polyline = table.points("polyline", 2);
      wall.closed = table.boolean_or("closed", false);
      if (wall.polyline.size() < 4) table.problem("polyline", "needs at least two nodes");
      for (std::size_t k = 2; k + 1 < wall.polyline.size(); k += 2)
        if (wall.polyline[k] == wall.polyline[k - 2] && wall.polyline[k + 1] == wall.polyline[k - 1])
          table.problem("polyline", fmt::format("node {} is given twice", k / 2));
    } else if (table.has("mesh") || table.has("triangles")) {
      if (d == 2) table.problem("", "meshes are walls in space; use a `polyline` in the plane");
      wall.mesh = read_mesh(table);
    } else {
      if (!table.has("point") && !table.has("normal")) {
        table.problem(
            "", d == 2 ? "a wall is a plane (`point`, `normal`) or a `polyline`"
                       : "a wall is a plane (`point`, `normal`), a `mesh` file, or `nodes` and `triangles`");
        continue;
      }
      wall.point = table.numbers("point", d);
      wall.normal = table.numbers("normal", d);
      double length = 0;
      for (const double n : wall.normal) length += n * n;
      length = std::sqrt(length);
      if (!(length > 0)) table.problem("normal", "must not be zero");
      for (double& n : wall.normal) n /= length;
    }
    wall.velocity = motion_of(table, "velocity", d);
    wall.spin = motion_of(table, "spin", d == 2 ? 1 : 3);
    if (!wall.spin.empty() && wall.polyline.empty() && wall.mesh.triangle.empty())
      table.problem("spin",
                    d == 2 ? "a plane does not turn: use a polyline" : "a plane does not turn: use a mesh");
    if (table.has("pivot")) wall.pivot = table.numbers("pivot", d);
    wall.pivot.resize(d, 0.0);
    if (!wall.spin.empty() && !table.has("pivot")) table.problem("spin", "needs a `pivot` to turn about");
    wall.constants =
        with_material(result, table.number_or("friction", result.constants.friction, Range::not_negative()),
                      table.number_or("restitution", result.restitution, {1e-6, 1}));
    result.walls.push_back(std::move(wall));
  }
  bool any_friction = result.constants.friction > 0;
  for (const WallScene& wall : result.walls) any_friction = any_friction || wall.constants.friction > 0;
  if (!any_friction) result.law.friction = FrictionLaw::none;
}

}  // namespace estuary::grains
