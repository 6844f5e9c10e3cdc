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
// Distance from the surface within which links end that may close [spacings].
constexpr double near_surface = 1 + link_length;

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
    if (surface.closes_a_line(segments[k])) continue;  // its ends lie in what holds the body
    if (leaving[segments[k].a] == none) leaving[segments[k].a] = k;
    if (arriving[segments[k].b] == none) arriving[segments[k].b] = k;
  }
  std::vector<double> turn(surface.node_count(), 0.0);
  double most = 0;
  for (std::size_t n = 0; n < turn.size(); ++n) {
    if (leaving[n] == none || arriving[n] == none) continue;
    turn[n] = convex_turn(segments[arriving[n]], segments[leaving[n]]);
    most = std::max(most, turn[n]);
  }
  std::vector<double> length(segments.size());
  std::transform(segments.begin(), segments.end(), length.begin(), length_of);
  // A smooth outline has no two nodes that turn enough together.
  const double shortest = length.empty() ? 0 : *std::min_element(length.begin(), length.end());
  if (shortest > 0 && most * (2 * std::floor(window / shortest) + 1) <= weakest_turn) return;
  for (const Segment& at : segments) {
    // Turning near node a, falling off linearly along the outline to both sides.
    double sum = turn[at.a];
    double arc = 0;
    for (std::uint32_t k = leaving[at.a]; k != none; k = leaving[segments[k].b]) {
      arc += length[k];
      if (arc >= window || segments[k].b == at.a) break;
      sum += turn[segments[k].b] * (1 - arc / window);
    }
    arc = 0;
    for (std::uint32_t k = arriving[at.a]; k != none; k = arriving[segments[k].a]) {
      arc += length[k];
      if (arc >= window || segments[k].a == at.a) break;
      sum += turn[segments[k].a] * (1 - arc / window);
    }
    const double strength = std::clamp((sum - weakest_turn) / (full_turn - weakest_turn), 0.0, 1.0);
    if (strength > 0) edges_.push_back({at.ax, at.ay, strength});
  }
}

void EdgeLinks::see(std::uint32_t segment, int x, int y, const Surface& surface, const Cells& cells) {
  const Segment& s = near_segments_[segment];
  const Grid& grid = cells.grid();
  const int column = grid.wrap_x(x);
  const int row = grid.wrap_y(y);
  if (!grid.inside(column, row) || !cells.fluid(column, row)) return;
  double along = 0;
  const double distance = distance_to(s, x, y, along);
  if (distance >= near_surface) return;
  auto& known = near_node_of_[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.nx) +
                              static_cast<std::size_t>(column)];
  if (known < 0) {
    double edge = 0;
    for (const Edge& at : edges_) {
      const double to_edge = std::hypot(x - at.x, y - at.y);
      edge = std::max(edge, at.strength * std::clamp((reach - to_edge) / (reach - full_reach), 0.0, 1.0));
    }
    known = static_cast<std::int32_t>(near_nodes_.size());
    near_nodes_.push_back(
        {{column, row}, near_surface, edge, everywhere_ ? 1.0 : edge, 0, 0, s.a, s.b, 0, -1});
  }
  NearNode& near = near_nodes_[static_cast<std::size_t>(known)];
  seen_.push_back({segment, near.last_seen});
  near.last_seen = static_cast<std::int32_t>(seen_.size() - 1);
  if (distance >= near.distance) return;
  const auto& v = surface.velocities();
  near.distance = distance;
  near.surface_node = s.a;
  near.surface_end = s.b;
  near.along = along;
  near.velocity_x = (1 - along) * v[2 * s.a] + along * v[2 * s.b];
  near.velocity_y = (1 - along) * v[2 * s.a + 1] + along * v[2 * s.b + 1];
}

void EdgeLinks::find_near_nodes(const Surface& surface, const Cells& cells) {
  for (std::uint32_t segment = 0; segment < near_segments_.size(); ++segment) {
    const Segment& s = near_segments_[segment];
    const double low = std::min(s.ay, s.by);
    const double high = std::max(s.ay, s.by);
    if (!(std::abs(s.ax) < 1e8 && std::abs(s.bx) < 1e8 && low > -1e8 && high < 1e8)) continue;
    const int y_last = static_cast<int>(std::floor(high + near_surface));
    for (int y = static_cast<int>(std::ceil(low - near_surface)); y <= y_last; ++y) {
      // The part of the segment that this row comes near to.
      double left = std::min(s.ax, s.bx);
      double right = std::max(s.ax, s.bx);
      if (high > low) {
        const double from = std::clamp((y - near_surface - s.ay) / (s.by - s.ay), 0.0, 1.0);
        const double to = std::clamp((y + near_surface - s.ay) / (s.by - s.ay), 0.0, 1.0);
        left = std::min(s.ax + from * (s.bx - s.ax), s.ax + to * (s.bx - s.ax));
        right = std::max(s.ax + from * (s.bx - s.ax), s.ax + to * (s.bx - s.ax));
      }
      const int x_last = static_cast<int>(std::floor(right + near_surface));
      for (int x = static_cast<int>(std::ceil(left - near_surface)); x <= x_last; ++x)
        see(segment, x, y, surface, cells);
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

void EdgeLinks::find_near_segments(const Surface& surface) {
  near_segments_.clear();
  near_insets_.clear();
  const std::vector<double> normals = surface.node_normals();
  constexpr double box = reach + link_length + near_surface;
  for (const Segment& s : surface.segments()) {
    const bool near = everywhere_ || std::any_of(edges_.begin(), edges_.end(), [&](const Edge& edge) {
                        return std::min(s.ax, s.bx) <= edge.x + box && std::max(s.ax, s.bx) >= edge.x - box &&
                               std::min(s.ay, s.by) <= edge.y + box && std::max(s.ay, s.by) >= edge.y - box;
                      });
    if (!near) continue;
    near_segments_.push_back(s);
    const std::size_t a = 2 * s.a;
    const std::size_t b = 2 * s.b;
    near_insets_.push_back({s.ax - surface_inset * normals[a], s.ay - surface_inset * normals[a + 1],
                            s.bx - surface_inset * normals[b], s.by - surface_inset * normals[b + 1], s.a,
                            s.b});
  }
}

// Measured where nodes become solid, a little inside: a face that lies on a row of nodes would otherwise cut
// all its links or none when it moves by round-off.
EdgeLinks::Chord EdgeLinks::chord_of(const NearNode& from, int direction) const {
  const auto& c = D2Q9::velocity[static_cast<std::size_t>(direction)];
  Chord chord{2, -1};
  for (std::int32_t k = from.last_seen; k >= 0; k = seen_[static_cast<std::size_t>(k)].before) {
    const Segment& s = near_insets_[seen_[static_cast<std::size_t>(k)].segment];
    // Solves from + q c = a + along (b - a).
    const double tx = s.bx - s.ax;
    const double ty = s.by - s.ay;
    const double determinant = c[1] * tx - c[0] * ty;
    if (determinant == 0) continue;
    const double dx = s.ax - from.node.x;
    const double dy = s.ay - from.node.y;
    const double q = (dy * tx - dx * ty) / determinant;
    if (!(q >= 0 && q <= 1)) continue;
    const double along = (c[0] * dy - c[1] * dx) / determinant;
    if (!(along >= 0 && along <= 1)) continue;
    chord.begin = std::min(chord.begin, q);
    chord.end = std::max(chord.end, q);
  }
  return chord.end > chord.begin ? chord : Chord{};
}

void EdgeLinks::add(const NearNode& from, const NearNode& to, int i, const Cells& cells,
                    const Populations& layout) {
  const auto direction = static_cast<std::size_t>(i);
  const auto& c = D2Q9::velocity[direction];
  const double length = std::hypot(c[0], c[1]);
  Chord chord;
  if (from.distance < length && to.distance < length) chord = chord_of(from, i);
  const double inside = length * (chord.end - chord.begin);
  double cut = 0;
  if (inside > 0) {
    const double soft = std::max(from.edge, to.edge) * (0.5 + 4 * std::min(from.distance, to.distance));
    cut = inside < soft ? inside / soft : 1.0;
  }
  // Both with the strength of the node that closes: beside a face the two distances are the same but for
  // round-off, and what decides between them must not be a difference of strengths.
  const double b_from = to.strength * std::max(0.0, 1 - from.distance);
  const double b_to = to.strength * std::max(0.0, 1 - to.distance);
  double fading = 0;
  if (b_to > b_from) {
    const double b = (b_to - b_from) / (1 - b_from);
    fading = (1 - cut) * b / (1 + (1 - b) * holding_);
  }
  const double share = cut + fading;
  if (share <= 0) return;

  const int o = D2Q9::opposite[direction];
  const std::ptrdiff_t node = layout.node(from.node.x, from.node.y);
  Closing closing{.node = from.node,
                  .direction = i,
                  .share = share,
                  .velocity_x = to.velocity_x,
                  .velocity_y = to.velocity_y,
                  .surface_node = to.surface_node,
                  .surface_end = to.surface_end,
                  .along = to.along,
                  .leaving = {},
                  .second = {},
                  .behind = {},
                  .incoming = {}};
  closing.place = fading / share;
  if (fading > 0) {
    const double weight = (from.distance - to.distance) / (2 * from.distance);  // 1 / (2 q)
    closing.weight_leaving += fading / share * weight;
    closing.weight_second += fading / share * (1 - weight);
    closing.weight_wall += fading / share * weight;
  }
  if (cut > 0) {
    double q = chord.begin;
    if (q < 0.5 && !cells.fluid(from.node.x - c[0], from.node.y - c[1])) q = 0.5;
    const double part = cut / share;
    closing.place += part * q;
    if (q < 0.5) {
      closing.weight_leaving += part * 2 * q;
      closing.weight_behind += part * (1 - 2 * q);
      closing.weight_wall += part;
    } else {
      closing.weight_leaving += part / (2 * q);
      closing.weight_second += part * (1 - 1 / (2 * q));
      closing.weight_wall += part / (2 * q);
    }
  }
  for (const Parity parity : {Parity::even, Parity::odd}) {
    const std::size_t k = index_of(parity);
    closing.leaving[k] = layout.post_collision(parity, i, node);
    closing.second[k] = layout.post_collision(parity, o, node);
    closing.behind[k] = layout.incoming(parity, i, node);
    closing.incoming[k] = layout.incoming(parity, o, node);
  }
  closing.wall = -6.0 * D2Q9::weight[direction] * (c[0] * to.velocity_x + c[1] * to.velocity_y);
  closings_.push_back(closing);
}

void EdgeLinks::build(const Surface& surface, const Cells& cells, const Populations& layout) {
  const Grid& grid = cells.grid();
  for (const NearNode& near : near_nodes_) {
    near_node_of_[static_cast<std::size_t>(near.node.y) * static_cast<std::size_t>(grid.nx) +
                  static_cast<std::size_t>(near.node.x)] = -1;
  }
  near_nodes_.clear();
  seen_.clear();
  closings_.clear();
  find_edges(surface);
  if (edges_.empty() && !everywhere_) return;
  if (near_node_of_.empty()) {
    near_node_of_.assign(static_cast<std::size_t>(grid.nx) * static_cast<std::size_t>(grid.ny), -1);
  }
  find_near_segments(surface);
  find_near_nodes(surface, cells);
  for (const NearNode& from : near_nodes_) {
    for (int i = 1; i < D2Q9::count; ++i) {
      const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
      const NearNode* to = find(grid, from.node.x + c[0], from.node.y + c[1]);
      if (to != nullptr) add(from, *to, i, cells, layout);
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
  Populations& f = populations;
#pragma omp for schedule(static)
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Closing& closing = closings_[n];
    if (!populations.owns(closing.node.y)) continue;
    double density = 1;
    if (compressible && closing.wall != 0) {
      const std::ptrdiff_t node = populations.node(closing.node.x, closing.node.y);
      for (int i = 0; i < D2Q9::count; ++i) density += f[populations.post_collision(parity, i, node)];
    }
    const double open = f[closing.incoming[k]];
    const double leaving = f[closing.leaving[k]];
    const double wall = closing.wall * density;
    const double closed = closing.weight_leaving * leaving + closing.weight_second * f[closing.second[k]] +
                          closing.weight_behind * f[closing.behind[k]] + closing.weight_wall * wall;
    open_values_[n] = open;
    closed_values_[n] = (1 - closing.share) * open + closing.share * closed;
    gained_[n] = closing.share * (closed - leaving - wall);
  }
#pragma omp single
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Node node = closings_[n].node;
    if (!populations.owns(node.y)) continue;
    f[closings_[n].incoming[k]] = closed_values_[n];
    f[populations.slot(0, populations.node(node.x, node.y))] -= gained_[n];
  }
}

void EdgeLinks::reopen(Populations& populations, Parity parity) const {
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Node node = closings_[n].node;
    if (!populations.owns(node.y)) continue;
    populations[closings_[n].incoming[index_of(parity)]] = open_values_[n];
    populations[populations.slot(0, populations.node(node.x, node.y))] += gained_[n];
  }
}

Force EdgeLinks::force_of(std::size_t n) const {
  const Closing& closing = closings_[n];
  const auto& c = D2Q9::velocity[static_cast<std::size_t>(closing.direction)];
  const double taken = open_values_[n] - closed_values_[n];  // of the population that moves along -c
  const double fx = taken * (-c[0] - closing.velocity_x);
  const double fy = taken * (-c[1] - closing.velocity_y);
  return {fx, fy,
          (closing.node.x + closing.place * c[0]) * fy - (closing.node.y + closing.place * c[1]) * fx};
}

const std::vector<Force>& EdgeLinks::forces() const {
  forces_.assign(closings_.size(), {});
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    // Zero on ranks whose node it is not, whose values were never set.
    if (closed_values_[n] != open_values_[n]) forces_[n] = force_of(n);
  }
  if (!forces_.empty()) share(ranks_, {&forces_.front().x, 3 * forces_.size()});
  return forces_;
}

Force EdgeLinks::force(std::span<const std::uint32_t> bodies, std::uint32_t body) const {
  Force total;
  const std::vector<Force>& of_closing = forces();
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    if (!bodies.empty() && bodies[closings_[n].surface_node] != body) continue;
    total = total + of_closing[n];
  }
  return total;
}

void EdgeLinks::add_node_forces(double weight, std::vector<double>& force) const {
  const std::vector<Force>& of_closing = forces();
  for (std::size_t n = 0; n < closings_.size(); ++n) {
    const Force one = weight * of_closing[n];
    const Closing& closing = closings_[n];
    force[2 * closing.surface_node] += (1 - closing.along) * one.x;
    force[2 * closing.surface_node + 1] += (1 - closing.along) * one.y;
    force[2 * closing.surface_end] += closing.along * one.x;
    force[2 * closing.surface_end + 1] += closing.along * one.y;
  }
}

}  // namespace estuary::fluid
