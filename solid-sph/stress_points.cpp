#include "stress_points.hpp"

#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "neighbourhood.hpp"
#include "outline_filling.hpp"

namespace estuary::solid {
namespace {

using Triangle = std::array<std::uint32_t, 3>;

void add(Body& body, std::size_t member, double x, double y, double volume) {
  body.position.insert(body.position.end(), {x, y});
  body.volume.push_back(0);  // of mass and springs
  body.energy_volume.push_back(volume);
  body.mass.push_back(0);
  body.fixed.push_back(3);
  body.edge.push_back(0);
  body.member.push_back(static_cast<std::uint8_t>(member));
  ++body.stress_points;
}

// The two points of Gauss's rule along a diagonal; cells alternate between their diagonals.
void fill_cells(Body& body, std::size_t member, const Box& box, int per_cell) {
  const double away = per_cell == 2 ? 0.5 / std::sqrt(3.0) : 0.0;
  const std::array<double, 2> d = actual_spacing(box);
  std::array<std::size_t, 2> cells{};
  for (std::size_t c = 0; c < 2; ++c) cells[c] = static_cast<std::size_t>(std::lround(box.length(c) / d[c]));
  for (std::size_t i = 0; i < cells[0]; ++i)
    for (std::size_t j = 0; j < cells[1]; ++j)
      for (int p = 0; p < per_cell; ++p) {
        const double along = p == 0 ? -away : away, across = (i + j) % 2 == 0 ? along : -along;
        add(body, member, box.from[0] + (static_cast<double>(i) + 0.5 + along) * d[0],
            box.from[1] + (static_cast<double>(j) + 0.5 + across) * d[1], d[0] * d[1] / per_cell);
      }
}

// Moved by a hair, each its own way, so that no four particles lie on one circle.
std::array<double, 2> nudged(const Body& body, std::size_t i, double hair) {
  const auto noise = [&](std::uint64_t seed) {
    std::uint64_t z = seed * 0x9e3779b97f4a7c15ULL;
    z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9ULL;
    z = (z ^ (z >> 27U)) * 0x94d049bb133111ebULL;
    return static_cast<double>(z >> 11U) / 9007199254740992.0 - 0.5;
  };
  return {body.position[2 * i] + hair * noise(2 * i + 1), body.position[2 * i + 1] + hair * noise(2 * i + 2)};
}

// Delaunay's triangles of the particles of one body: those whose circle holds no other particle. Bodies are
// filled evenly, so circles are small.
std::vector<Triangle> triangles(const Body& body, std::size_t member) {
  const double d = body.mean_spacing(), largest = 1.5 * d;
  const ReferenceSearch search(body, 2 * largest);
  std::vector<std::array<double, 2>> place(body.particles());
  for (std::size_t i = 0; i < body.particles(); ++i) place[i] = nudged(body, i, 1e-6 * d);
  std::vector<Triangle> result;
  std::vector<std::uint32_t> near;
  for (std::uint32_t i = 0; i < body.particles(); ++i) {
    if (body.member[i] != member) continue;
    near.clear();
    for (const auto& found : search.within(body.position[2 * i], body.position[2 * i + 1], 2 * largest))
      if (found.particle != i && body.member[found.particle] == member) near.push_back(found.particle);
    for (const std::uint32_t j : near)
      for (const std::uint32_t k : near) {
        if (j <= i || k <= j) continue;
        const double ax = place[j][0] - place[i][0], ay = place[j][1] - place[i][1],
                     bx = place[k][0] - place[i][0], by = place[k][1] - place[i][1];
        const double twice_area = ax * by - ay * bx;
        if (std::abs(twice_area) < 1e-3 * d * d) continue;  // along a straight contour
        const double a = ax * ax + ay * ay, b = bx * bx + by * by;
        const double x = 0.5 * (by * a - ay * b) / twice_area, y = 0.5 * (ax * b - bx * a) / twice_area;
        const double squared_radius = x * x + y * y;
        if (squared_radius > largest * largest) continue;
        bool empty = true;
        for (const std::uint32_t m : near) {
          if (m == j || m == k) continue;
          const double mx = place[m][0] - place[i][0] - x, my = place[m][1] - place[i][1] - y;
          if (mx * mx + my * my < squared_radius) {
            empty = false;
            break;
          }
        }
        if (empty) result.push_back({i, j, k});
      }
  }
  return result;
}

// One stress point in every triangle inside the contours.
void fill_triangles(Body& body, std::size_t member) {
  std::vector<Polygon> loops;
  double wanted = 0;
  for (std::size_t o = 0; o < body.outlines.size(); ++o) {
    if (body.outline_member[o] != member) continue;
    Polygon loop;
    for (const std::uint32_t i : body.outlines[o].particle)
      loop.push_back({body.position[2 * i], body.position[2 * i + 1]});
    wanted -= signed_area(loop);  // walked clockwise, holes the other way
    loops.push_back(std::move(loop));
  }
  struct StressPoint {
    double x, y, volume;
  };
  std::vector<StressPoint> points;
  double reached = 0;
  for (const auto& [i, j, k] : triangles(body, member)) {
    const double* a = &body.position[2 * std::size_t{i}];
    const double* b = &body.position[2 * std::size_t{j}];
    const double* c = &body.position[2 * std::size_t{k}];
    const double x = (a[0] + b[0] + c[0]) / 3, y = (a[1] + b[1] + c[1]) / 3;
    if (!contains(loops, x, y)) continue;
    const double area = 0.5 * std::abs((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]));
    points.push_back({x, y, area});
    reached += area;
  }
  if (!(std::abs(reached - wanted) < 1e-6 * wanted))
    throw std::invalid_argument("stress points: triangles between the particles cover " +
                                std::to_string(100 * reached / wanted) +
                                " % of the body; its outline is too fine for the spacing");
  for (const StressPoint& point : points) add(body, member, point.x, point.y, point.volume);
}

}  // namespace

void add_stress_points(Body& body, std::span<const Box* const> boxes, int per_cell) {
  const std::size_t particles = body.size();
  for (std::size_t member = 0; member < boxes.size(); ++member) {
    bool strained = false;
    for (std::size_t i = 0; i < particles; ++i)
      if (body.member[i] == member && !body.carried(i)) {
        strained = true;
        body.energy_volume[i] = 0;
      }
    if (!strained) continue;
    if (boxes[member] != nullptr)
      fill_cells(body, member, *boxes[member], per_cell);
    else
      fill_triangles(body, member);
  }
}

}  // namespace estuary::solid
