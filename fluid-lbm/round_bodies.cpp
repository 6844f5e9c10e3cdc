#include "round_bodies.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace estuary::fluid {
namespace {

// Rounding allowance for a node on the wall.
constexpr double tolerance = 1e-9;

void add_run(std::vector<Span>& row, int begin, int end, int count, bool periodic) {
  if (!periodic) {
    begin = std::max(begin, 0);
    end = std::min(end, count);
    if (begin < end) row.push_back({begin, end});
    return;
  }
  if (end - begin >= count) {
    row.push_back({0, count});
    return;
  }
  const int from = image_inside(begin, count, true);
  const int to = from + (end - begin);
  row.push_back({from, std::min(to, count)});
  if (to > count) row.push_back({0, to - count});
}

void merge(std::vector<Span>& row) {
  std::sort(row.begin(), row.end(), [](Span a, Span b) { return a.begin < b.begin; });
  std::size_t last = 0;
  for (std::size_t n = 1; n < row.size(); ++n) {
    if (row[n].begin <= row[last].end) {
      row[last].end = std::max(row[last].end, row[n].end);
    } else {
      row[++last] = row[n];
    }
  }
  if (!row.empty()) row.resize(last + 1);
}

}  // namespace

RoundBodies::RoundBodies(const Grid& grid, RelaxationParts relaxation, Ranks* ranks)
    : grid_(grid), ranks_(ranks), links_(relaxation, ranks) {}

// From the body's centre, or its image nearest to the node, to the node.
std::array<double, 3> RoundBodies::offset(std::size_t body, Node node) const {
  const auto components = static_cast<std::size_t>(bodies_.dimension);
  const double* centre = &bodies_.centre[components * body];
  const auto difference = [](double value, int count, bool periodic) {
    return periodic ? value - count * std::round(value / count) : value;
  };
  return {difference(node.x - centre[0], grid_.nx, grid_.periodic_x),
          difference(node.y - centre[1], grid_.ny, grid_.periodic_y),
          components == 3 ? difference(node.z - centre[2], grid_.nz, grid_.periodic_z) : 0.0};
}

std::array<double, 3> RoundBodies::velocity_at(std::size_t body, const std::array<double, 3>& arm) const {
  if (bodies_.dimension == 3) {
    const double* v = &bodies_.velocity[3 * body];
    const double* w = &bodies_.spin[3 * body];
    return {v[0] + w[1] * arm[2] - w[2] * arm[1], v[1] + w[2] * arm[0] - w[0] * arm[2],
            v[2] + w[0] * arm[1] - w[1] * arm[0]};
  }
  const double* v = &bodies_.velocity[2 * body];
  const double w = bodies_.spin[body];
  return {v[0] - w * arm[1], v[1] + w * arm[0], 0.0};
}

bool RoundBodies::place(const Grains& bodies, const std::vector<WallRule>& rules, Cells& cells,
                        const Populations& layout, RoundMove& move) {
  if (bodies == bodies_ && !rules_.empty()) return false;
  if (bodies.count() != bodies_.count()) {
    sums_.assign(bodies.count(), {});
    steps_ = 0;
  }
  bodies_ = bodies;
  rules_ = rules;
  mark(cells, move);
  find_links(cells, layout);
  return true;
}

void RoundBodies::mark(Cells& cells, RoundMove& move) {
  const auto row_count = static_cast<std::size_t>(grid_.rows());
  rows_.resize(row_count);
  for (auto& row : rows_) row.clear();
  const auto components = static_cast<std::size_t>(bodies_.dimension);
  for (std::size_t body = 0; body < bodies_.count(); ++body) {
    const double r = bodies_.radius[body] + tolerance;
    const double* centre = &bodies_.centre[components * body];
    const double cz = components == 3 ? centre[2] : 0.0;
    const int z_first = components == 3 ? static_cast<int>(std::ceil(cz - r)) : 0;
    const int z_last = components == 3 ? static_cast<int>(std::floor(cz + r)) : 0;
    for (int z = z_first; z <= z_last; ++z) {
      const int k = components == 3 ? image_inside(z, grid_.nz, grid_.periodic_z) : 0;
      if (k < 0) continue;
      const double square_z = components == 3 ? (z - cz) * (z - cz) : 0.0;
      for (int y = static_cast<int>(std::ceil(centre[1] - r));
           y <= static_cast<int>(std::floor(centre[1] + r)); ++y) {
        const int j = image_inside(y, grid_.ny, grid_.periodic_y);
        const double square = r * r - square_z - (y - centre[1]) * (y - centre[1]);
        if (j < 0 || square < 0) continue;
        const double half = std::sqrt(square);
        add_run(rows_[static_cast<std::size_t>(k) * static_cast<std::size_t>(grid_.ny) +
                      static_cast<std::size_t>(j)],
                static_cast<int>(std::ceil(centre[0] - half)),
                static_cast<int>(std::floor(centre[0] + half)) + 1, grid_.nx, grid_.periodic_x);
      }
    }
  }
  for (std::size_t row = 0; row < row_count; ++row) {
    merge(rows_[row]);
    move.covered += cells.set_solid(static_cast<int>(row), cell_body, rows_[row], move.uncovered);
  }
}

void RoundBodies::find_links(const Cells& cells, const Populations& layout) {
  const LatticeTable& lattice = layout.lattice();
  const auto components = static_cast<std::size_t>(bodies_.dimension);
  if (candidate_of_.empty()) candidate_of_.assign(grid_.size(), -1);
  candidates_.clear();
  for (std::size_t body = 0; body < bodies_.count(); ++body) {
    const double r = bodies_.radius[body];
    const double* centre = &bodies_.centre[components * body];
    const double cz = components == 3 ? centre[2] : 0.0;
    const double reach = r + 1;
    const int z_first = components == 3 ? static_cast<int>(std::ceil(cz - reach)) : 0;
    const int z_last = components == 3 ? static_cast<int>(std::floor(cz + reach)) : 0;
    for (int z = z_first; z <= z_last; ++z) {
      const int k = components == 3 ? image_inside(z, grid_.nz, grid_.periodic_z) : 0;
      if (k < 0) continue;
      for (int y = static_cast<int>(std::ceil(centre[1] - reach));
           y <= static_cast<int>(std::floor(centre[1] + reach)); ++y) {
        const int j = image_inside(y, grid_.ny, grid_.periodic_y);
        if (j < 0) continue;
        for (int x = static_cast<int>(std::ceil(centre[0] - reach));
             x <= static_cast<int>(std::floor(centre[0] + reach)); ++x) {
          const int i = image_inside(x, grid_.nx, grid_.periodic_x);
          if (i < 0 || !cells.fluid(i, j, k)) continue;
          const std::array<double, 3> d{x - centre[0], y - centre[1], components == 3 ? z - cz : 0.0};
          const double beyond = d[0] * d[0] + d[1] * d[1] + d[2] * d[2] - r * r;
          for (int direction = 1; direction < lattice.count; ++direction) {
            const auto& c = lattice.velocity[direction];
            if ((cells.state(i + c[0], j + c[1], k + c[2]) & cell_body) == 0) continue;
            // |d + q c| = r, the smaller root.
            const double cc = c[0] * c[0] + c[1] * c[1] + c[2] * c[2];
            const double dc = d[0] * c[0] + d[1] * c[1] + d[2] * c[2];
            const double discriminant = dc * dc - cc * beyond;
            if (discriminant < 0) continue;
            const double q = (-dc - std::sqrt(discriminant)) / cc;
            if (!(q >= -tolerance && q <= 1 + tolerance)) continue;
            std::int32_t& number = candidate_of_[grid_.index(i, j, k)];
            if (number < 0) {
              number = static_cast<std::int32_t>(candidates_.size());
              candidates_.push_back({{i, j, k}, {}});
            }
            Cut& cut =
                candidates_[static_cast<std::size_t>(number)].cuts[static_cast<std::size_t>(direction)];
            if (q < cut.q) cut = {std::clamp(q, 0.0, 1.0), static_cast<std::uint32_t>(body)};
          }
        }
      }
    }
  }
  links_.clear();
  for (const Candidate& candidate : candidates_) {
    const Node node = candidate.node;
    candidate_of_[grid_.index(node.x, node.y, node.z)] = -1;
    for (int direction = 1; direction < lattice.count; ++direction) {
      const Cut& cut = candidate.cuts[static_cast<std::size_t>(direction)];
      if (cut.q > 1) continue;
      const auto& c = lattice.velocity[direction];
      std::array<double, 3> arm = offset(cut.body, node);
      for (std::size_t axis = 0; axis < 3; ++axis) arm[axis] += cut.q * c[axis];
      links_.add(node, direction, cut.q, rules_[cut.body], velocity_at(cut.body, arm), cut.body, arm, cells,
                 layout);
    }
  }
  links_.finish(bodies_.count());
  // For the loads that ranks share in each step, in which no memory is asked for.
  if (ranks_ != nullptr) of_step_.reserve(bodies_.count() + links_.counts().links);
}

RoundBodies::Wall RoundBodies::nearest(Node node) const {
  double best = std::numeric_limits<double>::infinity();
  Wall wall;
  for (std::size_t body = 0; body < bodies_.count(); ++body) {
    const auto arm = offset(body, node);
    const double distance = std::sqrt(arm[0] * arm[0] + arm[1] * arm[1] + arm[2] * arm[2]);
    if (distance - bodies_.radius[body] >= best) continue;
    best = distance - bodies_.radius[body];
    for (std::size_t axis = 0; axis < 3; ++axis)
      wall.normal[axis] = distance > 0 ? arm[axis] / distance : 0.0;
    wall.velocity = velocity_at(body, arm);
  }
  return wall;
}

void RoundBodies::add_loads(const Populations& populations, Parity parity) {
  if (ranks_ != nullptr) {
#pragma omp master
    links_.loads(populations, parity, of_step_);
#pragma omp barrier
  }
#pragma omp for schedule(static)
  for (std::size_t body = 0; body < bodies_.count(); ++body) {
    const BodyLoad load = ranks_ != nullptr ? of_step_[body] : links_.load(populations, parity, body);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      sums_[body].force[axis] += load.force[axis];
      sums_[body].torque[axis] += load.torque[axis];
    }
  }
#pragma omp single
  ++steps_;
}

BodyLoad RoundBodies::mean_load(std::size_t body) const {
  BodyLoad load = sums_[body];
  const double scale = steps_ > 0 ? 1.0 / static_cast<double>(steps_) : 0.0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    load.force[axis] *= scale;
    load.torque[axis] *= scale;
  }
  return load;
}

GrainLoads RoundBodies::mean_loads() const {
  GrainLoads loads;
  const double scale = steps_ > 0 ? 1.0 / static_cast<double>(steps_) : 0.0;
  for (const BodyLoad& sum : sums_) {
    for (int axis = 0; axis < bodies_.dimension; ++axis)
      loads.force.push_back(scale * sum.force[static_cast<std::size_t>(axis)]);
    for (std::size_t axis = bodies_.dimension == 3 ? 0 : 2; axis < 3; ++axis)
      loads.torque.push_back(scale * sum.torque[axis]);
  }
  return loads;
}

void RoundBodies::restart_loads() {
  std::fill(sums_.begin(), sums_.end(), BodyLoad{});
  steps_ = 0;
}

}  // namespace estuary::fluid
