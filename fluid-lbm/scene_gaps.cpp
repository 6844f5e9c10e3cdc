// Passages too narrow for the grid, said before the run.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scene_parts.hpp"

namespace estuary::fluid {
namespace {

// A passage of fewer spacings has no node that sees an undisturbed profile.
constexpr double narrow = 3;

struct Body {
  std::array<double, 3> centre{};  // lattice coordinates
  double radius = 0;
};

// The bodies, and what periodic sides show of them again within `reach`.
std::vector<Body> with_images(std::vector<Body> bodies, const Grid& grid, double reach) {
  const std::array<bool, 3> periodic{grid.periodic_x, grid.periodic_y, grid.periodic_z};
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  for (std::size_t axis = 0; axis < static_cast<std::size_t>(grid.dimension()); ++axis) {
    if (!periodic[axis]) continue;
    const std::size_t before = bodies.size();
    for (std::size_t n = 0; n < before; ++n) {
      for (const int side : {-1, 1}) {
        Body image = bodies[n];
        image.centre[axis] += side * counts[axis];
        const double at = image.centre[axis];
        if (at > -reach && at < counts[axis] + reach) bodies.push_back(image);
      }
    }
  }
  return bodies;
}

void warn_between_bodies(const FluidScene& scene, Plan& plan) {
  const Grid& grid = scene.flow.grid;
  std::vector<Body> bodies;
  double largest = 0;
  for (const RoundObstacle& obstacle : scene.round_obstacles) {
    const auto& c = obstacle.centre;
    bodies.push_back(
        {{grid.to_lattice_x(c[0]), grid.to_lattice_y(c[1]), grid.nz > 0 ? grid.to_lattice_z(c[2]) : 0.0},
         obstacle.radius / grid.spacing});
    largest = std::max(largest, bodies.back().radius);
  }
  const double reach = 2 * largest + narrow;
  bodies = with_images(std::move(bodies), grid, reach);
  std::sort(bodies.begin(), bodies.end(), [](const Body& a, const Body& b) { return a.centre < b.centre; });
  double smallest = narrow;
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    for (std::size_t b = a + 1; b < bodies.size(); ++b) {
      const auto& p = bodies[a].centre;
      const auto& q = bodies[b].centre;
      if (q[0] - p[0] > reach) break;
      const double gap =
          std::hypot(q[0] - p[0], q[1] - p[1], q[2] - p[2]) - bodies[a].radius - bodies[b].radius;
      if (gap <= 0.01 || gap >= narrow) continue;  // bodies that touch leave none
      smallest = std::min(smallest, gap);
    }
  }
  if (smallest == narrow) return;
  plan.warnings.push_back(
      fmt::format("the narrowest gap between discs or spheres is {:.2g} spacings wide: below 3 refine, or "
                  "take wall_rule = "
                  "\"one-point\", which needs two nodes between walls",
                  smallest));
}

// Distance of a point from a segment, in the units of both.
double distance(const double* point, const double* a, const double* b) {
  const std::array<double, 2> along{b[0] - a[0], b[1] - a[1]};
  const double length = along[0] * along[0] + along[1] * along[1];
  const double t =
      ((point[0] - a[0]) * along[0] + (point[1] - a[1]) * along[1]) / (length > 0 ? length : 1.0);
  const double at = std::clamp(t, 0.0, 1.0);
  return std::hypot(a[0] + at * along[0] - point[0], a[1] + at * along[1] - point[1]);
}

void warn_between_outlines(const FluidScene& scene, Plan& plan) {
  const auto& positions = scene.obstacle_positions;
  const auto& segments = scene.obstacle_connectivity;
  constexpr std::size_t too_many = 4000;  // every point is compared with every segment
  if (scene.obstacle_of_point.size() > too_many) return;
  double smallest = narrow;
  for (std::size_t point = 0; point < scene.obstacle_of_point.size(); ++point) {
    for (std::size_t k = 0; k + 1 < segments.size(); k += 2) {
      if (scene.obstacle_of_point[segments[k]] == scene.obstacle_of_point[point]) continue;
      const double gap = distance(&positions[2 * point], &positions[2 * std::size_t{segments[k]}],
                                  &positions[2 * std::size_t{segments[k + 1]}]) /
                         scene.flow.grid.spacing;
      if (gap > 0.01) smallest = std::min(smallest, gap);
    }
  }
  if (smallest == narrow) return;
  plan.warnings.push_back(
      fmt::format("the narrowest gap between polygons or boxes is {:.2g} spacings wide: below 3 "
                  "the flow through it is inaccurate",
                  smallest));
}

// Runs of fluid nodes between two solid ones, along every axis.
void warn_in_images(const FluidScene& scene, Plan& plan) {
  if (scene.solid_nodes.empty()) return;
  const Grid& grid = scene.flow.grid;
  const std::array<std::size_t, 3> counts{static_cast<std::size_t>(grid.nx),
                                          static_cast<std::size_t>(grid.ny),
                                          static_cast<std::size_t>(grid.layers())};
  const std::array<std::size_t, 3> strides{1, counts[0], counts[0] * counts[1]};
  std::size_t all = 0;
  std::size_t tight = 0;
  for (std::size_t axis = 0; axis < static_cast<std::size_t>(grid.dimension()); ++axis) {
    const std::size_t u = axis == 0 ? 1 : 0;
    const std::size_t v = axis == 2 ? 1 : 2;
    for (std::size_t line = 0; line < counts[u] * counts[v]; ++line) {
      const std::size_t start = line % counts[u] * strides[u] + line / counts[u] * strides[v];
      std::size_t run = 0;
      bool after_solid = false;
      for (std::size_t n = 0; n < counts[axis]; ++n) {
        if (scene.solid_nodes[start + n * strides[axis]] == 0) {
          ++run;
          continue;
        }
        if (after_solid && run > 0) {
          ++all;
          tight += static_cast<double>(run) < narrow ? 1 : 0;
        }
        after_solid = true;
        run = 0;
      }
    }
  }
  if (tight == 0) return;
  plan.warnings.push_back(fmt::format(
      "{:.2g} % of the passages between solid nodes, counted along the axes, are under 3 spacings wide: the "
      "flow through them is inaccurate",
      100.0 * static_cast<double>(tight) / static_cast<double>(all)));
}

}  // namespace

void warn_of_narrow_gaps(const FluidScene& scene, Plan& plan) {
  if (scene.flow.grid.nx == 0) return;  // a problem was noted
  warn_between_bodies(scene, plan);
  warn_between_outlines(scene, plan);
  warn_in_images(scene, plan);
}

}  // namespace estuary::fluid
