#include "sampling.hpp"

#include <algorithm>
#include <cmath>

#include "side_frame.hpp"

namespace estuary::fluid {
namespace {

// Nodes along one axis and their weights.
struct Stencil {
  int first = 0;
  int count = 1;
  std::array<double, 4> weight{1, 0, 0, 0};
};

Stencil linear(double at) {
  Stencil stencil;
  stencil.first = static_cast<int>(std::floor(at));
  stencil.count = 2;
  stencil.weight = {1 - (at - stencil.first), at - stencil.first, 0, 0};
  return stencil;
}

// Lagrange's polynomial through four nodes, or linear where there are fewer.
Stencil cubic(double at, int nodes, bool periodic) {
  if (nodes < 4) return linear(at);
  Stencil stencil;
  stencil.first = static_cast<int>(std::floor(at)) - 1;
  if (!periodic) stencil.first = std::clamp(stencil.first, 0, nodes - 4);
  stencil.count = 4;
  for (int k = 0; k < 4; ++k) {
    double weight = 1;
    for (int other = 0; other < 4; ++other) {
      if (other != k) weight *= (at - stencil.first - other) / (k - other);
    }
    stencil.weight[static_cast<std::size_t>(k)] = weight;
  }
  return stencil;
}

struct Sum {
  Sample sample;
  double weight = 0;
  bool whole = true;  // every node with a weight was fluid
};

Sum add_up(const Fields& fields, const Cells& cells, const std::array<Stencil, 3>& stencils) {
  const Grid& grid = cells.grid();
  Sum sum;
  for (int c = 0; c < stencils[2].count; ++c) {
    for (int b = 0; b < stencils[1].count; ++b) {
      for (int a = 0; a < stencils[0].count; ++a) {
        const double weight = stencils[0].weight[static_cast<std::size_t>(a)] *
                              stencils[1].weight[static_cast<std::size_t>(b)] *
                              stencils[2].weight[static_cast<std::size_t>(c)];
        if (weight == 0) continue;
        const Node node{grid.wrap_x(stencils[0].first + a), grid.wrap_y(stencils[1].first + b),
                        grid.wrap_z(stencils[2].first + c)};
        if (!grid.inside(node.x, node.y, node.z) || !cells.fluid(node.x, node.y, node.z)) {
          sum.whole = false;
          continue;
        }
        const std::size_t k = grid.index(node.x, node.y, node.z);
        sum.weight += weight;
        sum.sample.velocity[0] += weight * fields.velocity_x[k];
        sum.sample.velocity[1] += weight * fields.velocity_y[k];
        if (grid.nz > 0) sum.sample.velocity[2] += weight * fields.velocity_z[k];
        sum.sample.excess += weight * fields.excess[k];
      }
    }
  }
  return sum;
}

// Of the wall's point nearest to the place.
std::array<double, 3> wall_velocity(const Side& side, int name, const std::array<int, 3>& counts,
                                    int dimension, const std::array<double, 3>& at) {
  if (side.velocity_x.empty()) return {};
  const SideFrame frame(name, counts);
  const auto along = [&](int axis, int points) {
    return std::clamp(static_cast<int>(std::lround(2 * at[static_cast<std::size_t>(axis)] + 1)), 0,
                      points - 1);
  };
  const int a = along(frame.u, frame.points_u());
  const int b = dimension == 3 ? along(frame.v, frame.points_v(dimension)) : 0;
  const std::size_t point =
      static_cast<std::size_t>(b) * static_cast<std::size_t>(frame.points_u()) + static_cast<std::size_t>(a);
  return {side.velocity_x[point], side.velocity_y[point],
          side.velocity_z.empty() ? 0.0 : side.velocity_z[point]};
}

}  // namespace

Sample sample_at(const Fields& fields, const Cells& cells, const Sides& sides,
                 const std::array<double, 3>& at) {
  const Grid& grid = cells.grid();
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  const std::array<bool, 3> periodic{grid.periodic_x, grid.periodic_y, grid.periodic_z};
  const auto axes = static_cast<std::size_t>(grid.dimension());
  std::array<double, 3> inside = at;
  std::array<Stencil, 3> stencils;
  for (std::size_t axis = 0; axis < axes; ++axis) {
    if (!periodic[axis]) inside[axis] = std::clamp(at[axis], 0.0, counts[axis] - 1.0);
    stencils[axis] = cubic(inside[axis], counts[axis], periodic[axis]);
  }
  Sum sum = add_up(fields, cells, stencils);
  if (!sum.whole) {
    for (std::size_t axis = 0; axis < axes; ++axis) stencils[axis] = linear(inside[axis]);
    sum = add_up(fields, cells, stencils);
  }
  if (sum.weight <= 0) return {};
  Sample sample = sum.sample;
  for (double& component : sample.velocity) component /= sum.weight;
  sample.excess /= sum.weight;
  for (std::size_t axis = 0; axis < axes; ++axis) {
    const double beyond = std::abs(at[axis] - inside[axis]);
    const int name = 2 * static_cast<int>(axis) + (at[axis] > inside[axis] ? 1 : 0);
    const Side& side = sides[static_cast<std::size_t>(name)];
    if (beyond == 0 || side.kind != SideKind::wall) continue;
    const double share = std::min(1.0, 2 * beyond);
    const auto wall = wall_velocity(side, name, counts, grid.dimension(), at);
    for (std::size_t k = 0; k < axes; ++k) sample.velocity[k] += share * (wall[k] - sample.velocity[k]);
  }
  return sample;
}

}  // namespace estuary::fluid
