#include "surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace estuary::fluid {
namespace {

// How far outside the grid images of the surface are kept: links and the fit of the loads look this far
// [spacings].
constexpr double image_margin = 4.0;

struct Shifts {
  int first = 0;
  int last = 0;
};

// The whole periods by which [low, high] has to be moved to meet the grid.
Shifts shifts_into(bool periodic, int count, double low, double high) {
  if (!periodic) return {};
  return {static_cast<int>(std::ceil((-image_margin - high) / count)),
          static_cast<int>(std::floor((count + image_margin - low) / count))};
}

// Last and first node of each line that does not come back to where it began.
std::vector<std::uint32_t> ends_of_open_lines(std::size_t nodes,
                                              const std::vector<std::uint32_t>& connectivity) {
  const auto none = static_cast<std::uint32_t>(nodes);
  std::vector<std::uint32_t> next(nodes, none);
  std::vector<std::uint32_t> previous(nodes, none);
  for (std::size_t s = 0; s + 1 < connectivity.size(); s += 2) {
    next[connectivity[s]] = connectivity[s + 1];
    previous[connectivity[s + 1]] = connectivity[s];
  }
  std::vector<std::uint32_t> ends;
  for (std::uint32_t first = 0; first < none; ++first) {
    if (previous[first] != none || next[first] == none) continue;
    std::uint32_t last = first;
    while (next[last] != none) last = next[last];
    ends.insert(ends.end(), {last, first});
  }
  return ends;
}

}  // namespace

Surface::Surface(const Grid& grid, std::size_t nodes, std::vector<std::uint32_t> connectivity)
    : grid_(grid),
      nodes_(nodes),
      connectivity_(std::move(connectivity)),
      open_ends_(ends_of_open_lines(nodes, connectivity_)),
      positions_(2 * nodes),
      velocities_(2 * nodes) {
  segments_.reserve(connectivity_.size() + open_ends_.size());
}

// Ends on a side of the domain lie on its outermost nodes or half a spacing outside.
bool Surface::lies_inside(std::uint32_t node) const {
  const double x = positions_[2 * node];
  const double y = positions_[2 * node + 1];
  return x > 0.25 && y > 0.25 && x < grid_.nx - 1.25 && y < grid_.ny - 1.25;
}

void Surface::add_segment(std::uint32_t a, std::uint32_t b) {
  const double ax = positions_[2 * a];
  const double ay = positions_[2 * a + 1];
  const double bx = positions_[2 * b];
  const double by = positions_[2 * b + 1];
  const Shifts in_x = shifts_into(grid_.periodic_x, grid_.nx, std::min(ax, bx), std::max(ax, bx));
  const Shifts in_y = shifts_into(grid_.periodic_y, grid_.ny, std::min(ay, by), std::max(ay, by));
  for (int ky = in_y.first; ky <= in_y.last; ++ky) {
    for (int kx = in_x.first; kx <= in_x.last; ++kx) {
      const double dx = kx * grid_.nx;
      const double dy = ky * grid_.ny;
      segments_.push_back({ax + dx, ay + dy, bx + dx, by + dy, a, b});
    }
  }
}

void Surface::place(std::span<const double> positions, std::span<const double> velocities,
                    double velocity_scale) {
  for (std::size_t n = 0; n < nodes_; ++n) {
    positions_[2 * n] = grid_.to_lattice_x(positions[2 * n]);
    positions_[2 * n + 1] = grid_.to_lattice_y(positions[2 * n + 1]);
    velocities_[2 * n] = velocities[2 * n] * velocity_scale;
    velocities_[2 * n + 1] = velocities[2 * n + 1] * velocity_scale;
  }
  segments_.clear();
  for (std::size_t s = 0; s + 1 < connectivity_.size(); s += 2)
    add_segment(connectivity_[s], connectivity_[s + 1]);
  for (std::size_t e = 0; e + 1 < open_ends_.size(); e += 2) {
    if (lies_inside(open_ends_[e]) && lies_inside(open_ends_[e + 1]))
      add_segment(open_ends_[e], open_ends_[e + 1]);
  }
}

bool Surface::closes_a_line(const Segment& segment) const {
  for (std::size_t e = 0; e + 1 < open_ends_.size(); e += 2) {
    if (open_ends_[e] == segment.a && open_ends_[e + 1] == segment.b) return true;
  }
  return false;
}

const std::vector<Segment>& Surface::inset_segments(double distance) {
  find_normals(normals_);
  inset_.assign(segments_.begin(), segments_.end());
  for (Segment& s : inset_) {
    s.ax -= distance * normals_[2 * s.a];
    s.ay -= distance * normals_[2 * s.a + 1];
    s.bx -= distance * normals_[2 * s.b];
    s.by -= distance * normals_[2 * s.b + 1];
  }
  return inset_;
}

std::vector<double> Surface::node_normals() const {
  std::vector<double> normals;
  find_normals(normals);
  return normals;
}

void Surface::find_normals(std::vector<double>& normals) const {
  normals.assign(2 * nodes_, 0.0);
  for (std::size_t s = 0; s + 1 < connectivity_.size(); s += 2) {
    const std::uint32_t a = connectivity_[s];
    const std::uint32_t b = connectivity_[s + 1];
    const double tx = positions_[2 * b] - positions_[2 * a];
    const double ty = positions_[2 * b + 1] - positions_[2 * a + 1];
    for (const std::uint32_t n : {a, b}) {
      normals[2 * n] -= ty;  // left of the walking direction, as long as the segment
      normals[2 * n + 1] += tx;
    }
  }
  for (std::size_t n = 0; n < nodes_; ++n) {
    const double length = std::hypot(normals[2 * n], normals[2 * n + 1]);
    if (length > 0) {
      normals[2 * n] /= length;
      normals[2 * n + 1] /= length;
    }
  }
}

Surface::Nearest Surface::nearest(double x, double y) const {
  Nearest best;
  best.distance_squared = std::numeric_limits<double>::infinity();
  for (const Segment& s : segments_) {
    const double tx = s.bx - s.ax;
    const double ty = s.by - s.ay;
    const double square = tx * tx + ty * ty;
    if (square == 0) continue;
    const double r = std::clamp(((x - s.ax) * tx + (y - s.ay) * ty) / square, 0.0, 1.0);
    const double dx = x - s.ax - r * tx;
    const double dy = y - s.ay - r * ty;
    const double distance = dx * dx + dy * dy;
    if (distance >= best.distance_squared) continue;
    const double length = std::sqrt(square);
    best = {distance,
            -ty / length,
            tx / length,
            (1 - r) * velocities_[2 * s.a] + r * velocities_[2 * s.b],
            (1 - r) * velocities_[2 * s.a + 1] + r * velocities_[2 * s.b + 1],
            s.a};
  }
  return best;
}

SolidRows::SolidRows(const Grid& grid)
    : grid_(grid),
      rows_(static_cast<std::size_t>(grid.ny)),
      first_solid_(static_cast<std::size_t>(grid.ny)),
      solid_(static_cast<std::size_t>(grid.ny)) {}

// Number of solids a walker is in before the first crossing: as few as the crossings allow.
int SolidRows::depth_before(const std::vector<Crossing>& crossings) {
  int depth = 0;
  int lowest = 0;
  for (const Crossing& crossing : crossings) {
    depth += crossing.change;
    lowest = std::min(lowest, depth);
  }
  return -lowest;
}

void SolidRows::sort(std::vector<Crossing>& crossings) {
  // At equal places the entering one first: two bodies that touch leave no gap.
  std::sort(crossings.begin(), crossings.end(), [](const Crossing& p, const Crossing& q) {
    return p.at != q.at ? p.at < q.at : p.change > q.change;
  });
}

// A segment crosses a row when exactly one of its ends lies above it; an end on the row counts as above. So a
// row through a node of the surface is crossed by one of the two segments that meet there, or by both, or by
// none, as it must be.
void SolidRows::find_crossings(const std::vector<Segment>& segments) {
  for (auto& row : rows_) row.clear();
  first_column_.clear();
  for (const Segment& s : segments) {
    if (s.ay != s.by) {
      const double low = std::min(s.ay, s.by);
      const double high = std::max(s.ay, s.by);
      const int first = static_cast<int>(std::ceil(std::clamp(low, 0.0, static_cast<double>(grid_.ny))));
      const int last = static_cast<int>(std::ceil(std::clamp(high, 0.0, static_cast<double>(grid_.ny))));
      for (int y = first; y < last; ++y) {
        const double at = s.ax + (y - s.ay) * (s.bx - s.ax) / (s.by - s.ay);
        rows_[static_cast<std::size_t>(y)].push_back({at, s.by > s.ay ? 1 : -1});
      }
    }
    if ((s.ax > 0) != (s.bx > 0)) {
      const double at = s.ay + (0.0 - s.ax) * (s.by - s.ay) / (s.bx - s.ax);
      first_column_.push_back({at, s.bx > s.ax ? -1 : 1});
    }
  }
}

// Node (0, y) of a row that is not crossed: from the crossings of the first column; when that is not crossed
// either, the whole column is alike and any crossed row tells.
void SolidRows::set_first_states() {
  sort(first_column_);
  int depth = depth_before(first_column_);
  std::size_t next = 0;
  std::uint8_t whole_column = 0;
  if (first_column_.empty()) {
    for (const auto& row : rows_) {
      if (row.empty()) continue;
      int at_first_node = depth_before(row);
      for (const Crossing& crossing : row) {
        if (crossing.at <= 0) at_first_node += crossing.change;
      }
      whole_column = at_first_node > 0;
      break;
    }
  }
  for (int y = 0; y < grid_.ny; ++y) {
    while (next < first_column_.size() && first_column_[next].at <= y) depth += first_column_[next++].change;
    first_solid_[static_cast<std::size_t>(y)] = first_column_.empty() ? whole_column : depth > 0;
  }
}

const std::vector<std::vector<Span>>& SolidRows::classify(const std::vector<Segment>& segments) {
  find_crossings(segments);
  for (auto& row : rows_) sort(row);
  set_first_states();
  for (std::size_t y = 0; y < rows_.size(); ++y) {
    auto& runs = solid_[y];
    runs.clear();
    if (rows_[y].empty()) {
      if (first_solid_[y] != 0) runs.push_back({0, grid_.nx});
      continue;
    }
    const auto add = [&](double from, double to) {
      const double limit = grid_.nx;
      const int begin = static_cast<int>(std::ceil(std::clamp(from, 0.0, limit)));
      const int end = to < 0 ? 0 : static_cast<int>(std::floor(std::min(to, limit - 1))) + 1;
      if (begin >= end) return;
      if (!runs.empty() && runs.back().end >= begin) {
        runs.back().end = std::max(runs.back().end, end);
      } else {
        runs.push_back({begin, end});
      }
    };
    int depth = depth_before(rows_[y]);
    double entered = -1;
    for (const Crossing& crossing : rows_[y]) {
      const int before = depth;
      depth += crossing.change;
      if (before == 0 && depth > 0) entered = crossing.at;
      if (before > 0 && depth == 0) add(entered, crossing.at);
    }
    if (depth > 0) add(entered, grid_.nx);
  }
  return solid_;
}

}  // namespace estuary::fluid
