#include "edge_links.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace estuary::fluid {
namespace {

// Turning of a convex outline within `window` spacings of arc: none of an edge below, all of one above [rad].
constexpr double window = 1.5;
constexpr double weakest_turn = 0.6;
constexpr double full_turn = 1.2;
// How far an edge acts [spacings].
constexpr double full_reach = 2.0;
constexpr double reach = 3.5;
// A diagonal link from a node in reach ends this much further out.
constexpr double link_length = 1.5;

std::size_t index_of(Parity parity) {
  return parity == Parity::even ? 0 : 1;
}

double length_of(const Segment& s) {
  return std::hypot(s.bx - s.ax, s.by - s.ay);
}

// Angle by which the outline turns towards the solid, which lies to the right, from one segment to the next.
double convex_turn(const Segment& from, const Segment& to) {
  const double fx = from.bx - from.ax;
  const double fy = from.by - from.ay;
  const double tx = to.bx - to.ax;
  const double ty = to.by - to.ay;
  return -std::atan2(fx * ty - fy * tx, fx * tx + fy * ty);
}

double distance_to(const Segment& s, double x, double y, double& along) {
  const double tx = s.bx - s.ax;
  const double ty = s.by - s.ay;
  const double square = tx * tx + ty * ty;
  along = square > 0 ? std::clamp(((x - s.ax) * tx + (y - s.ay) * ty) / square, 0.0, 1.0) : 0.0;
  return std::hypot(x - s.ax - along * tx, y - s.ay - along * ty);
}

}  // namespace

void EdgeLinks::find_edges(const Surface& surface) {
  edges_.clear();
  const auto& segments = surface.segments();
  constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  // Images beyond periodic sides repeat node numbers; the first of each will do, since only shapes matter.
  std::vector<std::uint32_t> leaving(surface.node_count(), none);
  std::vector<std::uint32_t> arriving(surface.node_count(), none);
  for (std::uint32_t k = 0; k < segments.size(); ++k) {
    if (leaving[segments[k].a] == none) leaving[segments[k].a] = k;
    if (arriving[segments[k].b] == none) arriving[segments[k].b] = k;
  }
  std::vector<double> turn(surface.node_count(), 0.0);
  for (std::size_t n = 0; n < turn.size(); ++n) {
    if (leaving[n] != none && arriving[n] != none)
      turn[n] = convex_turn(segments[arriving[n]], segments[leaving[n]]);
  }
  for (const Segment& at : segments) {
    // Turning near node a, falling off linearly along the outline to both sides.
    double sum = turn[at.a];
    double arc = 0;
    for (std::uint32_t k = leaving[at.a]; k != none; k = leaving[segments[k].b]) {
      arc += length_of(segments[k]);
      if (arc >= window || segments[k].b == at.a) break;
      sum += turn[segments[k].b] * (1 - arc / window);
    }
    arc = 0;
    for (std::uint32_t k = arriving[at.a]; k != none; k = arriving[segments[k].a]) {
      arc += length_of(segments[k]);
      if (arc >= window || segments[k].a == at.a) break;
      sum += turn[segments[k].a] * (1 - arc / window);
    }
    const double strength = std::clamp((sum - weakest_turn) / (full_turn - weakest_turn), 0.0, 1.0);
    if (strength > 0) edges_.push_back({at.ax, at.ay, strength});
  }
}

void EdgeLinks::find_near_nodes(const Surface& surface, const Cells& cells) {
  const Grid& grid = cells.grid();
  const auto in_reach = [](double a, double b) { return std::abs(a - b) <= reach + link_length; };
  for (const Edge& edge : edges_) {
    if (!(std::abs(edge.x) < 1e8 && std::abs(edge.y) < 1e8)) continue;
    const double box = reach + link_length;
    for (int j = static_cast<int>(std::ceil(edge.y - box)); j <= static_cast<int>(std::floor(edge.y + box));
         ++j) {
      for (int i = static_cast<int>(std::ceil(edge.x - box)); i <= static_cast<int>(std::floor(edge.x + box));
           ++i) {
        const int x = grid.wrap_x(i);
        const int y = grid.wrap_y(j);
        if (!grid.inside(x, y) || !cells.fluid(x, y)) continue;
        auto& known = near_node_of_[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.nx) +
                                    static_cast<std::size_t>(x)];
        const double to_edge = std::hypot(i - edge.x, j - edge.y);
        const double nearness =
            edge.strength * std::clamp((reach - to_edge) / (reach - full_reach), 0.0, 1.0);
        if (known >= 0) {
          double& so_far = near_nodes_[static_cast<std::size_t>(known)].edge;
          so_far = std::max(so_far, nearness);
          continue;
        }
        known = static_cast<std::int32_t>(near_nodes_.size());
        NearNode near{{x, y}, std::numeric_limits<double>::infinity(), nearness, 0, 0};
        for (const Segment& s : surface.segments()) {
          const bool beside = (s.ax > i) == (s.bx > i) && !in_reach(s.ax, i) && !in_reach(s.bx, i);
          const bool above = (s.ay > j) == (s.by > j) && !in_reach(s.ay, j) && !in_reach(s.by, j);
          if (beside || above) continue;
          double along = 0;
          const double distance = distance_to(s, i, j, along);
          if (distance >= near.distance) continue;
          const auto& v = surface.velocities();
          near.distance = distance;
          near.velocity_x = (1 - along) * v[2 * s.a] + along * v[2 * s.b];
          near.velocity_y = (1 - along) * v[2 * s.a + 1] + along * v[2 * s.b + 1];
        }
        near_nodes_.push_back(near);
      }
    }
  }
}

const EdgeLinks::NearNode* EdgeLinks::find(const Grid& grid, int x, int y) const {
  const int column = grid.wrap_x(x);
  const int row = grid.wrap_y(y);
  if (!grid.inside(column, row)) return nullptr;
  const auto known = near_node_of_[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.nx) +
                                   static_cast<std::size_t>(column)];
  return known < 0 ? nullptr : &near_nodes_[static_cast<std::size_t>(known)];
}

void EdgeLinks::build(const Surface& surface, const Cells& cells, const Populations& layout) {
  const Grid& grid = cells.grid();
  for (const NearNode& near : near_nodes_) {
    near_node_of_[static_cast<std::size_t>(near.node.y) * static_cast<std::size_t>(grid.nx) +
                  static_cast<std::size_t>(near.node.x)] = -1;
  }
  near_nodes_.clear();
  closings_.clear();
  find_edges(surface);
  if (edges_.empty()) return;
  if (near_node_of_.empty()) {
    near_node_of_.assign(static_cast<std::size_t>(grid.nx) * static_cast<std::size_t>(grid.ny), -1);
  }
  find_near_nodes(surface, cells);
  for (const NearNode& nearer : near_nodes_) {
    const double b_nearer = nearer.edge * (1 - nearer.distance);
    if (b_nearer <= 0) continue;
    for (int i = 1; i < D2Q9::count; ++i) {
      const auto direction = static_cast<std::size_t>(i);
      const auto& c = D2Q9::velocity[direction];
      const NearNode* further = find(grid, nearer.node.x - c[0], nearer.node.y - c[1]);
      if (further == nullptr) continue;
      const double b_further = further->edge * std::max(0.0, 1 - further->distance);
      if (b_nearer <= b_further || further->distance <= nearer.distance) continue;
      const double q = further->distance / (further->distance - nearer.distance);
      const int o = D2Q9::opposite[direction];
      const std::ptrdiff_t node = layout.node(further->node.x, further->node.y);
      Closing closing{further->node,
                      i,
                      (b_nearer - b_further) / (1 - b_further),
                      nearer.velocity_x,
                      nearer.velocity_y,
                      {},
                      {},
                      {},
                      1 / (2 * q),
                      0};
      for (const Parity parity : {Parity::even, Parity::odd}) {
        const std::size_t k = index_of(parity);
        closing.leaving[k] = layout.post_collision(parity, i, node);
        closing.second[k] = layout.post_collision(parity, o, node);
        closing.incoming[k] = layout.incoming(parity, o, node);
      }
      closing.wall = -6.0 * D2Q9::weight[direction] * (c[0] * nearer.velocity_x + c[1] * nearer.velocity_y);
      closings_.push_back(closing);
    }
  }
  open_values_.assign(closings_.size(), 0.0);
  closed_values_.assign(closings_.size(), 0.0);
  gained_.assign(closings_.size(), 0.0);
}

// In two passes: a value that one link replaces may be what another one's rule needs.
void EdgeLinks::close(Populations& populations, Parity parity, bool compressible) {
  if (closings_.empty()) return;
  const std::size_t k = index_of(parity);
  double* const f = populations.data();
#pragma omp for schedule(static)
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Closing& closing = closings_[n];
    double density = 1;
    if (compressible && closing.wall != 0) {
      const std::ptrdiff_t node = populations.node(closing.node.x, closing.node.y);
      for (int i = 0; i < D2Q9::count; ++i) density += f[populations.post_collision(parity, i, node)];
    }
    const double open = f[closing.incoming[k]];
    const double leaving = f[closing.leaving[k]];
    const double wall = closing.wall * density;
    const double closed =
        closing.weight_leaving * (leaving + wall) + (1 - closing.weight_leaving) * f[closing.second[k]];
    open_values_[n] = open;
    closed_values_[n] = (1 - closing.share) * open + closing.share * closed;
    gained_[n] = closing.share * (closed - leaving - wall);
  }
#pragma omp single
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Node node = closings_[n].node;
    f[closings_[n].incoming[k]] = closed_values_[n];
    f[populations.slot(0, populations.node(node.x, node.y))] -= gained_[n];
  }
}

void EdgeLinks::reopen(Populations& populations, Parity parity) const {
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Node node = closings_[n].node;
    populations[closings_[n].incoming[index_of(parity)]] = open_values_[n];
    populations[populations.slot(0, populations.node(node.x, node.y))] += gained_[n];
  }
}

Force EdgeLinks::force() const {
  Force total;
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Closing& closing = closings_[n];
    const auto& c = D2Q9::velocity[static_cast<std::size_t>(closing.direction)];
    const double taken = open_values_[n] - closed_values_[n];  // of the population that moves along -c
    const double fx = taken * (-c[0] - closing.velocity_x);
    const double fy = taken * (-c[1] - closing.velocity_y);
    total.x += fx;
    total.y += fy;
    total.moment += (closing.node.x + c[0]) * fy - (closing.node.y + c[1]) * fx;
  }
  return total;
}

}  // namespace estuary::fluid
