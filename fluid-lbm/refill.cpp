#include "refill.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::fluid {
namespace {

using Nine = std::array<double, D2Q9::count>;

Nine post_collision_of(const Populations& p, Node node) {
  Nine f;
  const std::ptrdiff_t n = p.node(node.x, node.y);
  for (int i = 0; i < D2Q9::count; ++i)
    f[static_cast<std::size_t>(i)] = p[p.post_collision(p.parity(), i, n)];
  return f;
}

double inverse_density(EquilibriumModel model, double excess) {
  return model == EquilibriumModel::compressible ? Compressible::inverse_density(excess)
                                                 : Incompressible::inverse_density(excess);
}

struct Filling {
  Node node;
  Nine f;
};

}  // namespace

std::size_t refill(Populations& populations, const Cells& cells, std::vector<Node> uncovered,
                   const Surface& surface, EquilibriumModel model) {
  const Grid& grid = cells.grid();
  std::vector<Filling> layer;
  std::vector<Node> later;
  std::size_t orphans = 0;
  while (!uncovered.empty()) {
    layer.clear();
    later.clear();
    const auto row_first = [](Node p, Node q) { return p.y != q.y ? p.y < q.y : p.x < q.x; };
    std::sort(uncovered.begin(), uncovered.end(), row_first);
    const auto usable = [&](Node node) {
      return cells.fluid(node.x, node.y) &&
             !std::binary_search(uncovered.begin(), uncovered.end(), node, row_first);
    };
    const auto value_at = [&](Node node, const Moments& m, const Nine& nonequilibrium) {
      const double inverse = inverse_density(model, m.excess);
      Filling filling{node, {}};
      for (int i = 0; i < D2Q9::count; ++i) {
        filling.f[static_cast<std::size_t>(i)] =
            equilibrium<D2Q9>(i, m, inverse) + nonequilibrium[static_cast<std::size_t>(i)];
      }
      return filling;
    };
    const auto moments_at_wall = [&](double excess, const Surface::Nearest& wall) {
      const double density = model == EquilibriumModel::compressible ? 1 + excess : 1;
      return Moments{excess, density * wall.velocity_x, density * wall.velocity_y};
    };
    for (const Node node : uncovered) {
      const auto wall = surface.nearest(node.x, node.y);
      double sum = 0;
      int count = 0;
      double best = -2;
      Nine f_best{};
      for (int i = 1; i < D2Q9::count; ++i) {
        const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
        const Node neighbour{grid.wrap_x(node.x + c[0]), grid.wrap_y(node.y + c[1])};
        if (!grid.inside(neighbour.x, neighbour.y) || !usable(neighbour)) continue;
        const Nine f = post_collision_of(populations, neighbour);
        sum += moments_of<D2Q9>(f).excess;
        ++count;
        const double aligned = (c[0] * wall.normal_x + c[1] * wall.normal_y) / std::hypot(c[0], c[1]);
        if (aligned > best) {
          best = aligned;
          f_best = f;
        }
      }
      if (count == 0) {
        later.push_back(node);
        continue;
      }
      const Moments neighbour = moments_of<D2Q9>(f_best);
      const double inverse = inverse_density(model, neighbour.excess);
      for (int i = 0; i < D2Q9::count; ++i) {
        f_best[static_cast<std::size_t>(i)] -= equilibrium<D2Q9>(i, neighbour, inverse);
      }
      layer.push_back(value_at(node, moments_at_wall(sum / count, wall), f_best));
    }
    if (layer.empty()) {  // cut off from all fluid
      for (const Node node : later) {
        layer.push_back(value_at(node, moments_at_wall(0, surface.nearest(node.x, node.y)), Nine{}));
      }
      orphans += later.size();
      later.clear();
    }
    for (const Filling& filling : layer) {
      const std::ptrdiff_t n = populations.node(filling.node.x, filling.node.y);
      for (int i = 0; i < D2Q9::count; ++i) {
        populations[populations.post_collision(populations.parity(), i, n)] =
            filling.f[static_cast<std::size_t>(i)];
      }
    }
    uncovered.swap(later);
  }
  return orphans;
}

}  // namespace estuary::fluid
