#include "refill.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace estuary::fluid {
namespace {

template <class Lattice>
using Values = std::array<double, Lattice::count>;

template <class Lattice>
Values<Lattice> post_collision_of(const Populations& p, Node node) {
  Values<Lattice> f;
  const std::ptrdiff_t n = p.held_node(node.x, node.y, node.z);
  for (int i = 0; i < Lattice::count; ++i)
    f[static_cast<std::size_t>(i)] = p[p.post_collision(p.parity(), i, n)];
  return f;
}

double inverse_density(EquilibriumModel model, double excess) {
  return model == EquilibriumModel::compressible ? Compressible::inverse_density(excess)
                                                 : Incompressible::inverse_density(excess);
}

bool row_first(Node p, Node q) {
  return std::tie(p.z, p.y, p.x) < std::tie(q.z, q.y, q.x);
}

template <class Lattice>
class Refill {
public:
  Refill(Populations& populations, const Cells& cells, const std::function<WallPoint(Node)>& wall_at,
         EquilibriumModel model, RefillRule rule, Halo* halo)
      : populations_(populations),
        cells_(cells),
        wall_at_(wall_at),
        model_(model),
        rule_(rule),
        halo_(halo) {}

  std::size_t fill(std::vector<Node> uncovered) {
    std::vector<Filling> layer;
    std::vector<Node> later;
    std::size_t orphans = 0;
    while (!uncovered.empty()) {
      layer.clear();
      later.clear();
      std::sort(uncovered.begin(), uncovered.end(), row_first);
      if (halo_ != nullptr) halo_->look_around(populations_, populations_.parity());
      for (const Node node : uncovered) {
        if (!fill_from_neighbours(node, uncovered, layer)) later.push_back(node);
      }
      if (layer.empty()) {  // cut off from all fluid
        for (const Node node : later) layer.push_back(value_at(node, 0, wall_at_(node), {}));
        orphans += later.size();
        later.clear();
      }
      for (const Filling& filling : layer) {
        if (!populations_.owns(filling.node.y, filling.node.z)) continue;
        const std::ptrdiff_t n = populations_.node(filling.node.x, filling.node.y, filling.node.z);
        for (int i = 0; i < Lattice::count; ++i) {
          populations_[populations_.post_collision(populations_.parity(), i, n)] =
              filling.f[static_cast<std::size_t>(i)];
        }
      }
      if (halo_ != nullptr) halo_->filled(populations_.parity());
      uncovered.swap(later);
    }
    return orphans;
  }

private:
  struct Filling {
    Node node;
    Values<Lattice> f;
  };

  Filling value_at(Node node, double excess, const WallPoint& wall,
                   const Values<Lattice>& nonequilibrium) const {
    const double density = model_ == EquilibriumModel::compressible ? 1 + excess : 1;
    const Moments m{excess, density * wall.velocity[0], density * wall.velocity[1],
                    density * wall.velocity[2]};
    const double inverse = inverse_density(model_, excess);
    Filling filling{node, {}};
    for (int i = 0; i < Lattice::count; ++i) {
      filling.f[static_cast<std::size_t>(i)] =
          equilibrium<Lattice>(i, m, inverse) + nonequilibrium[static_cast<std::size_t>(i)];
    }
    return filling;
  }

  bool fill_from_neighbours(Node node, const std::vector<Node>& uncovered,
                            std::vector<Filling>& layer) const {
    const Grid& grid = cells_.grid();
    const bool own = populations_.owns(node.y, node.z);
    const WallPoint wall = own ? wall_at_(node) : WallPoint{};
    double sum = 0;
    int count = 0;
    double best = -2;
    Values<Lattice> f_best{};
    for (int i = 1; i < Lattice::count; ++i) {
      const auto& c = Lattice::velocity[static_cast<std::size_t>(i)];
      const Node neighbour{grid.wrap_x(node.x + c[0]), grid.wrap_y(node.y + c[1]),
                           grid.wrap_z(node.z + c[2])};
      if (!grid.inside(neighbour.x, neighbour.y, neighbour.z) ||
          !cells_.fluid(neighbour.x, neighbour.y, neighbour.z) ||
          std::binary_search(uncovered.begin(), uncovered.end(), neighbour, row_first)) {
        continue;
      }
      if (!own) {  // another rank's: whether it can be filled is all that counts here
        layer.push_back({node, {}});
        return true;
      }
      const auto f = post_collision_of<Lattice>(populations_, neighbour);
      sum += moments_of<Lattice>(f).excess;
      ++count;
      const double length = std::sqrt(static_cast<double>(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]));
      const double aligned = (c[0] * wall.normal[0] + c[1] * wall.normal[1] + c[2] * wall.normal[2]) / length;
      if (aligned > best) {
        best = aligned;
        f_best = f;
      }
    }
    if (count == 0) return false;
    if (rule_ == RefillRule::equilibrium) {
      f_best.fill(0.0);
    } else {
      const Moments neighbour = moments_of<Lattice>(f_best);
      const double inverse = inverse_density(model_, neighbour.excess);
      for (int i = 0; i < Lattice::count; ++i) {
        f_best[static_cast<std::size_t>(i)] -= equilibrium<Lattice>(i, neighbour, inverse);
      }
    }
    layer.push_back(value_at(node, sum / count, wall, f_best));
    return true;
  }

  Populations& populations_;
  const Cells& cells_;
  const std::function<WallPoint(Node)>& wall_at_;
  EquilibriumModel model_;
  RefillRule rule_;
  Halo* halo_;
};

}  // namespace

std::size_t refill(Populations& populations, const Cells& cells, std::vector<Node> uncovered,
                   const std::function<WallPoint(Node)>& wall_at, EquilibriumModel model, RefillRule rule,
                   Halo* halo) {
  if (populations.lattice().dimension == 3) {
    return Refill<D3Q19>(populations, cells, wall_at, model, rule, halo).fill(std::move(uncovered));
  }
  return Refill<D2Q9>(populations, cells, wall_at, model, rule, halo).fill(std::move(uncovered));
}

std::size_t refill(Populations& populations, const Cells& cells, std::vector<Node> uncovered,
                   const Surface& surface, EquilibriumModel model, Halo* halo) {
  const auto wall_at = [&](Node node) -> WallPoint {
    const auto near = surface.nearest(node.x, node.y);
    return {{near.normal_x, near.normal_y, 0}, {near.velocity_x, near.velocity_y, 0}};
  };
  return refill(populations, cells, std::move(uncovered), wall_at, model,
                RefillRule::extrapolated_nonequilibrium, halo);
}

}  // namespace estuary::fluid
