#include "links.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::fluid {
namespace {

// Rounding allowance for a cut at the very end of a link or of a segment [fraction].
constexpr double end_tolerance = 1e-9;

}  // namespace

Links::Links(const Grid& grid, Ranks* ranks)
    : grid_(grid),
      ranks_(ranks),
      candidate_of_(static_cast<std::size_t>(grid.nx) * static_cast<std::size_t>(grid.ny), -1) {}

void Links::clear() {
  candidates_.clear();
  places_.clear();
  rules_.clear();
  first_of_node_.clear();
  counts_ = {};
}

void Links::visit(Node node, const Segment& s, std::uint32_t number, const Cells& cells,
                  std::uint8_t reason) {
  const int x = grid_.wrap_x(node.x);
  const int y = grid_.wrap_y(node.y);
  if (!cells.fluid(x, y) || cells.surrounded_by_fluid(x, y)) return;
  std::int32_t& known = candidate_of_[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid_.nx) +
                                      static_cast<std::size_t>(x)];
  for (int i = 1; i < D2Q9::count; ++i) {
    const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
    const std::uint8_t neighbour = cells.state(x + c[0], y + c[1]);
    if (neighbour == cell_fluid) continue;
    if (known < 0 && (neighbour & reason) != 0) {
      known = static_cast<std::int32_t>(candidates_.size());
      candidates_.push_back({{x, y}, {}});
    }
    // Solves node + q c = a + along (b - a).
    const double tx = s.bx - s.ax;
    const double ty = s.by - s.ay;
    const double determinant = c[1] * tx - c[0] * ty;
    if (determinant == 0) continue;
    const double dx = s.ax - node.x;
    const double dy = s.ay - node.y;
    const double q_numerator = dy * tx - dx * ty;
    const double along_numerator = c[0] * dy - c[1] * dx;
    // Most links miss the segment by far, which is seen without a division.
    constexpr double far = 1.01;
    const double size = far * std::abs(determinant);
    if (std::abs(q_numerator) > size || std::abs(along_numerator) > size) continue;
    double q = q_numerator / determinant;
    double along = along_numerator / determinant;
    // Beside a wall of the grid the surface may cut a link that the wall would cut half-way.
    const double furthest = (neighbour & cell_outside) != 0 ? 0.5 : 1.0 + end_tolerance;
    // A fluid node may lie a little inside the surface; its links into the solid (c . n < 0) are then cut at
    // once.
    const double nearest = determinant < 0 ? -2 * surface_inset : -end_tolerance;
    if (q < nearest || q > furthest || along < -end_tolerance || along > 1 + end_tolerance) continue;
    q = std::clamp(q, 0.0, 1.0);
    along = std::clamp(along, 0.0, 1.0);
    if (known < 0) {
      known = static_cast<std::int32_t>(candidates_.size());
      candidates_.push_back({{x, y}, {}});
    }
    Cut& cut = candidates_[static_cast<std::size_t>(known)].cuts[static_cast<std::size_t>(i)];
    if (q < cut.q) cut = {q, along, number};
  }
}

void Links::build(const Surface& surface, const Cells& cells, std::uint8_t reason,
                  const Populations& layout) {
  clear();
  const auto& segments = surface.segments();
  for (std::uint32_t number = 0; number < segments.size(); ++number) {
    const Segment& s = segments[number];
    const double low = std::min(s.ay, s.by);
    const double high = std::max(s.ay, s.by);
    const int y_first =
        std::max(grid_.periodic_y ? -1 : 0, static_cast<int>(std::floor(std::max(low, -3.0))) - 1);
    const int y_last = std::min(grid_.periodic_y ? grid_.ny : grid_.ny - 1,
                                static_cast<int>(std::ceil(std::min(high, grid_.ny + 3.0))) + 1);
    for (int y = y_first; y <= y_last; ++y) {
      // The part of the segment that links of this row can reach.
      double left = std::min(s.ax, s.bx);
      double right = std::max(s.ax, s.bx);
      if (high > low) {
        const double from = std::clamp((y - 1.0 - s.ay) / (s.by - s.ay), 0.0, 1.0);
        const double to = std::clamp((y + 1.0 - s.ay) / (s.by - s.ay), 0.0, 1.0);
        const double x_from = s.ax + from * (s.bx - s.ax);
        const double x_to = s.ax + to * (s.bx - s.ax);
        left = std::min(x_from, x_to);
        right = std::max(x_from, x_to);
      }
      const double limit = grid_.nx + 3.0;
      const int x_first = std::max(grid_.periodic_x ? -1 : 0,
                                   static_cast<int>(std::floor(std::clamp(left, -3.0, limit))) - 1);
      const int x_last = std::min(grid_.periodic_x ? grid_.nx : grid_.nx - 1,
                                  static_cast<int>(std::ceil(std::clamp(right, -3.0, limit))) + 1);
      for (int x = x_first; x <= x_last; ++x) visit({x, y}, s, number, cells, reason);
    }
  }
  for (const Candidate& candidate : candidates_) {
    const Node node = candidate.node;
    candidate_of_[static_cast<std::size_t>(node.y) * static_cast<std::size_t>(grid_.nx) +
                  static_cast<std::size_t>(node.x)] = -1;
    first_of_node_.push_back(rules_.size());
    for (int i = 1; i < D2Q9::count; ++i) {
      const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
      const bool into_solid = (cells.state(node.x + c[0], node.y + c[1]) & reason) != 0;
      if (into_solid || candidate.cuts[static_cast<std::size_t>(i)].q <= 1)
        add(candidate, i, surface, cells, layout);
    }
  }
  first_of_node_.push_back(rules_.size());
  counts_.links = rules_.size();
}

void Links::add(const Candidate& candidate, int i, const Surface& surface, const Cells& cells,
                const Populations& layout) {
  const auto direction = static_cast<std::size_t>(i);
  const auto& c = D2Q9::velocity[direction];
  const int o = D2Q9::opposite[direction];
  Cut cut = candidate.cuts[direction];
  Place place{candidate.node, i, cut.q, 0, 0, 0, 0, 0};
  if (cut.q > 1) {
    ++counts_.unresolved;
    place.q = 0.5;
    const auto near = surface.nearest(candidate.node.x + 0.5 * c[0], candidate.node.y + 0.5 * c[1]);
    place.velocity_x = near.velocity_x;
    place.velocity_y = near.velocity_y;
    place.surface_node = place.surface_end = near.node;
  } else {
    const Segment& s = surface.segments()[cut.segment];
    const auto& v = surface.velocities();
    place.surface_node = s.a;
    place.surface_end = s.b;
    place.along = cut.along;
    place.velocity_x = (1 - cut.along) * v[2 * s.a] + cut.along * v[2 * s.b];
    place.velocity_y = (1 - cut.along) * v[2 * s.a + 1] + cut.along * v[2 * s.b + 1];
  }
  const bool second_fluid = cells.fluid(candidate.node.x - c[0], candidate.node.y - c[1]);
  if (place.q < 0.5 && !second_fluid) {
    ++counts_.halfway;
    place.q = 0.5;
  }
  const std::ptrdiff_t node = layout.node(candidate.node.x, candidate.node.y);
  Rule rule;
  for (const Parity parity : {Parity::even, Parity::odd}) {
    const std::size_t k = index_of(parity);
    rule.leaving[k] = layout.post_collision(parity, i, node);
    rule.incoming[k] = layout.incoming(parity, o, node);
    // The population that left the node behind along i is the one that comes in along i.
    rule.second[k] =
        place.q < 0.5 ? layout.incoming(parity, i, node) : layout.post_collision(parity, o, node);
  }
  const double along_wall = -(c[0] * place.velocity_x + c[1] * place.velocity_y);  // c_in . u_wall
  rule.wall = 6.0 * D2Q9::weight[direction] * along_wall;
  if (place.q < 0.5) {
    rule.weight_leaving = 2 * place.q;
    rule.weight_second = 1 - 2 * place.q;
  } else {
    rule.weight_leaving = 1 / (2 * place.q);
    rule.weight_second = 1 - rule.weight_leaving;
    rule.wall_weight = rule.weight_leaving;
  }
  places_.push_back(place);
  rules_.push_back(rule);
}

void Links::reflect(Populations& populations, Parity parity, bool compressible) const {
  const std::size_t k = index_of(parity);
  Populations& f = populations;
  const std::size_t groups = first_of_node_.empty() ? 0 : first_of_node_.size() - 1;
#pragma omp for schedule(static)
  for (std::size_t group = 0; group < groups; ++group) {
    const std::size_t begin = first_of_node_[group];
    const std::size_t end = first_of_node_[group + 1];
    if (begin == end || !grid_.owns(places_[begin].node.y)) continue;
    const std::ptrdiff_t node = populations.node(places_[begin].node.x, places_[begin].node.y);
    double density = 1;
    if (compressible) {
      for (int i = 0; i < D2Q9::count; ++i) density += f[populations.post_collision(parity, i, node)];
    }
    double gained = 0;
    for (std::size_t n = begin; n < end; ++n) {
      const Rule& rule = rules_[n];
      const double leaving = f[rule.leaving[k]];
      const double incoming = rule.weight_leaving * leaving + rule.weight_second * f[rule.second[k]] +
                              rule.wall * rule.wall_weight * density;
      gained += incoming - leaving - rule.wall * density;
      f[rule.incoming[k]] = incoming;
    }
    f[populations.slot(0, node)] -= gained;
  }
}

Force Links::force_of(std::size_t link, const Populations& populations) const {
  const std::size_t k = index_of(populations.parity());
  const Place& place = places_[link];
  const auto& c = D2Q9::velocity[static_cast<std::size_t>(place.direction)];
  const double leaving = populations[rules_[link].leaving[k]];
  const double incoming = populations[rules_[link].incoming[k]];
  const double fx = leaving * (c[0] - place.velocity_x) - incoming * (-c[0] - place.velocity_x);
  const double fy = leaving * (c[1] - place.velocity_y) - incoming * (-c[1] - place.velocity_y);
  return {fx, fy, (place.node.x + place.q * c[0]) * fy - (place.node.y + place.q * c[1]) * fx};
}

const std::vector<Force>& Links::forces(const Populations& populations) const {
  forces_.assign(rules_.size(), {});
  for (std::size_t n = 0; n < rules_.size(); ++n) {
    if (grid_.owns(places_[n].node.y)) forces_[n] = force_of(n, populations);
  }
  if (!forces_.empty()) share(ranks_, {&forces_.front().x, 3 * forces_.size()});
  return forces_;
}

Force Links::force(const Populations& populations, std::span<const std::uint32_t> bodies,
                   std::uint32_t body) const {
  Force total;
  const std::vector<Force>& of_link = forces(populations);
  for (std::size_t n = 0; n < rules_.size(); ++n) {
    if (!bodies.empty() && bodies[places_[n].surface_node] != body) continue;
    total = total + of_link[n];
  }
  return total;
}

void Links::add_node_forces(const Populations& populations, double weight, std::vector<double>& force) const {
  const std::vector<Force>& of_link = forces(populations);
  for (std::size_t n = 0; n < rules_.size(); ++n) {
    const Force one = weight * of_link[n];
    const Place& place = places_[n];
    force[2 * place.surface_node] += (1 - place.along) * one.x;
    force[2 * place.surface_node + 1] += (1 - place.along) * one.y;
    force[2 * place.surface_end] += place.along * one.x;
    force[2 * place.surface_end + 1] += place.along * one.y;
  }
}

}  // namespace estuary::fluid
