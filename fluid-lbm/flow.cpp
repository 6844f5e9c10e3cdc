#include "flow.hpp"

#include <omp.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "on_team.hpp"
#include "refill.hpp"

namespace estuary::fluid {
namespace {

std::vector<double> bounds_of(const Surface& surface) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  std::vector<double> bounds{infinity, infinity, -infinity, -infinity};
  for (const Segment& s : surface.segments()) {
    bounds[0] = std::min({bounds[0], s.ax, s.bx});
    bounds[1] = std::min({bounds[1], s.ay, s.by});
    bounds[2] = std::max({bounds[2], s.ax, s.bx});
    bounds[3] = std::max({bounds[3], s.ay, s.by});
  }
  return bounds;
}

bool near(const std::vector<double>& a, const std::vector<double>& b) {
  constexpr double margin = 3.0;
  return a[0] < b[2] + margin && b[0] < a[2] + margin && a[1] < b[3] + margin && b[1] < a[3] + margin;
}

RelaxationParts relaxation_of(const FlowSettings& settings) {
  if (settings.viscosity != ViscosityModel::constant) return {};
  const double even = 1 / settings.rates.even - 0.5;
  switch (settings.collision) {
    case CollisionModel::trt:
      return {even, 1 / settings.rates.odd - 0.5};
    case CollisionModel::bgk:
      return {even, even};
    case CollisionModel::recursive_regularised:
    case CollisionModel::central_moment:
      break;
  }
  return {even, 0.5};  // the odd part is set to equilibrium
}

/// The node is less than `distance` away from a node of an open side.
bool open_side_within(const FlowSettings& settings, const Node& node, int distance) {
  const Grid& grid = settings.grid;
  const std::array<int, 3> at{node.x, node.y, node.z};
  const std::array<int, 3> counts{grid.nx, grid.ny, grid.layers()};
  for (std::size_t side = 0; side < 2 * static_cast<std::size_t>(grid.dimension()); ++side) {
    const int away = side % 2 == 0 ? at[side / 2] : counts[side / 2] - 1 - at[side / 2];
    if (away < distance && is_open(settings.sides[side].kind)) return true;
  }
  return false;
}

}  // namespace

Flow::Flow(const FlowSettings& settings)
    : settings_(settings),
      populations_(settings.grid, settings.storage),
      cells_(settings.grid),
      step_(collide_and_stream(settings.step())),
      halo_(settings.ranks != nullptr ? std::make_unique<Halo>(*settings.ranks, settings.grid) : nullptr),
      viscosities_(settings.viscosity == ViscosityModel::generalised_newtonian
                       ? std::make_unique<const ViscosityTable>(settings.law)
                       : nullptr),
      parameters_{settings.rates, settings.acceleration, settings.magic_parameter, settings.law,
                  viscosities_.get()},
      rows_(settings.grid),
      obstacle_links_(settings.grid, settings.ranks),
      wet_links_(settings.grid, settings.ranks),
      obstacle_edges_(EdgeLinks::Extent::edges, 1 / settings.rates.even, settings.ranks),
      saturated_(settings.grid, settings.ranks),
      bodies_(settings.grid, relaxation_of(settings), settings.ranks),
      solid_node_links_(settings.ranks),
      links_at_sides_(settings.ranks),
      outline_links_(relaxation_of(settings), settings.ranks) {
  if (step_ == nullptr) throw std::invalid_argument("no such variant: " + variant_name(settings.step()));
}

void Flow::set_obstacles(std::size_t nodes, std::vector<std::uint32_t> connectivity,
                         std::span<const double> positions, std::optional<WallRule> rule,
                         std::vector<std::uint32_t> bodies) {
  outline_rule_ = rule;
  outline_bodies_ = std::move(bodies);
  outline_bodies_.resize(nodes, 0);
  obstacles_.emplace(grid(), nodes, std::move(connectivity));
  obstacles_->place(positions, std::vector<double>(2 * nodes, 0.0), 0.0);
  obstacle_bounds_ = bounds_of(*obstacles_);
  std::vector<Node> uncovered;
  const auto& solid = rows_.classify(obstacles_->segments());
  for (int y = 0; y < grid().ny; ++y)
    cells_.set_solid(y, cell_obstacle, solid[static_cast<std::size_t>(y)], uncovered);
  link_obstacles();
}

void Flow::link_obstacles() {
  obstacle_links_.build(*obstacles_, cells_, cell_obstacle, populations_);
  if (!outline_rule_) {
    obstacle_edges_.build(*obstacles_, cells_, populations_);
    return;
  }
  outline_links_.clear();
  for (const Links::Place& place : obstacle_links_.places()) {
    const auto& c = D2Q9::velocity[static_cast<std::size_t>(place.direction)];
    outline_links_.add(
        place.node, place.direction, place.q, *outline_rule_, {}, outline_bodies_[place.surface_node],
        {place.node.x + place.q * c[0], place.node.y + place.q * c[1], 0}, cells_, populations_);
  }
  outline_links_.finish(1 + *std::max_element(outline_bodies_.begin(), outline_bodies_.end()));
  obstacle_links_.clear();
}

void Flow::set_wet_surface(std::size_t nodes, std::vector<std::uint32_t> connectivity,
                           EdgeLinks::Extent closing) {
  expect_other_walls();
  wet_.emplace(grid(), nodes, std::move(connectivity));
  wet_edges_ = EdgeLinks(closing, 1 / settings_.rates.even, settings_.ranks);
  placed_.clear();
}

MoveCounts Flow::place(std::span<const double> positions, std::span<const double> velocities,
                       double velocity_scale, bool fill) {
  const std::size_t size = positions.size();
  if (placed_.size() == 2 * size && std::equal(positions.begin(), positions.end(), placed_.begin()) &&
      std::equal(velocities.begin(), velocities.end(), placed_.begin() + static_cast<std::ptrdiff_t>(size))) {
    return {};
  }
  if (rules_applied_) {
    wet_edges_.reopen(populations_, populations_.parity());
    if (obstacles_) obstacle_edges_.reopen(populations_, populations_.parity());
  }
  settle();
  rules_applied_ = false;
  const bool first = placed_.empty();
  placed_.assign(positions.begin(), positions.end());
  placed_.insert(placed_.end(), velocities.begin(), velocities.end());
  wet_->place(positions, velocities, velocity_scale);
  std::vector<Node> uncovered;
  MoveCounts counts;
  const auto& solid = rows_.classify(wet_->inset_segments(surface_inset));
  for (int y = 0; y < grid().ny; ++y) {
    counts.covered += cells_.set_solid(y, cell_wet_solid, solid[static_cast<std::size_t>(y)], uncovered);
  }
  counts.uncovered = uncovered.size();
#pragma omp parallel sections num_threads(std::min(threads(), 2))
  {
#pragma omp section
    wet_links_.build(*wet_, cells_, cell_wet_solid, populations_);
#pragma omp section
    wet_edges_.build(*wet_, cells_, populations_);
  }
  // Links of obstacles look at the node behind, which the wet solid may have covered or left.
  if (obstacles_ && !outline_rule_ && near(bounds_of(*wet_), obstacle_bounds_)) {
    obstacle_links_.build(*obstacles_, cells_, cell_obstacle, populations_);
    obstacle_edges_.build(*obstacles_, cells_, populations_);
  }
  if (fill && !first) {
    counts.orphans =
        refill(populations_, cells_, std::move(uncovered), *wet_, settings_.equilibrium, halo_.get());
  }
  return counts;
}

void Flow::settle() {
  if (halo_ && rules_applied_) halo_->tell_of_rules(populations_, populations_.parity());
}

bool Flow::looks_beside() const {
  return bodies_.links().looks_beside() || outline_links_.looks_beside();
}

MoveCounts Flow::move_wet_surface(std::span<const double> positions, std::span<const double> velocities,
                                  double velocity_scale) {
  return place(positions, velocities, velocity_scale, true);
}

MoveCounts Flow::place_bodies(const Grains& bodies, const std::vector<WallRule>& rules, bool fill) {
  if (!bodies.radius.empty()) expect_other_walls();
  RoundMove move;
  const bool first = bodies_.empty();
  if (!bodies_.place(bodies, rules, cells_, populations_, move)) return {};
  settle();
  rules_applied_ = false;
  MoveCounts counts{move.covered, move.uncovered.size(), 0};
  if (fill && !first) {
    const auto wall_at = [this](Node node) -> WallPoint {
      const auto wall = bodies_.nearest(node);
      return {wall.normal, wall.velocity};
    };
    counts.orphans = refill(populations_, cells_, std::move(move.uncovered), wall_at, settings_.equilibrium,
                            settings_.refill, halo_.get());
  }
  return counts;
}

void Flow::expect_other_walls() const {
  if (!other_walls_)
    throw std::logic_error(
        "solid nodes without memory cannot lie beside other walls: give set_solid_nodes other_walls = true");
}

void Flow::set_solid_nodes(const std::vector<std::uint16_t>& solid, bool other_walls) {
  const LatticeTable& lattice = populations_.lattice();
  std::vector<Node> uncovered;
  for (int row = 0; row < grid().rows(); ++row) {
    std::vector<Span> runs;
    for (int x = 0; x < grid().nx; ++x) {
      const int y = row % grid().ny;
      const int z = row / grid().ny;
      // What other obstacles cover stays covered.
      if (solid[grid().index(x, y, z)] == 0 && (cells_.state(x, y, z) & cell_obstacle) == 0) continue;
      if (!runs.empty() && runs.back().end == x) {
        ++runs.back().end;
      } else {
        runs.push_back({x, x + 1});
      }
    }
    cells_.set_solid(row, cell_obstacle, runs, uncovered);
  }
  packs_alone_ = settings_.drop_solid_nodes;
  other_walls_ = other_walls || obstacles_ || !packs_alone_;
  if (settings_.drop_solid_nodes && !halo_) drop_solid_nodes();
  solid_node_links_.clear();
  links_at_sides_.clear();
  for (int row = grid().first_row(); row < grid().past_row(); ++row) {
    const int y = row % grid().ny;
    const int z = row / grid().ny;
    for (const Span span : cells_.row(row)) {
      for (int x = span.begin; x < span.end; ++x) {
        for (int i = 1; i < lattice.count; ++i) {
          const auto& c = lattice.velocity[i];
          const Node end{grid().wrap_x(x + c[0]), grid().wrap_y(y + c[1]), grid().wrap_z(z + c[2])};
          if (!grid().inside(end.x, end.y, end.z)) continue;
          const std::uint16_t body = solid[grid().index(end.x, end.y, end.z)];
          if (body == 0) continue;
          const bool across = end != Node{x + c[0], y + c[1], z + c[2]};
          StillLinks& links =
              across || open_side_within(settings_, {x, y, z}, 2) ? links_at_sides_ : solid_node_links_;
          links.add({x, y, z}, i, body - 1U, {x + 0.5 * c[0], y + 0.5 * c[1], z + 0.5 * c[2]}, populations_);
        }
      }
    }
  }
}

// Among pores most memory would be that of the solid, which the processor fetches along with the fluid's.
std::vector<std::uint8_t> Flow::needed_nodes() const {
  const Grid& g = grid();
  std::vector<std::uint8_t> needed(g.size(), 0);
  const auto mark = [&](int x, int y, int z) {
    x = g.wrap_x(x);
    y = g.wrap_y(y);
    z = g.wrap_z(z);
    if (g.inside(x, y, z)) needed[g.index(x, y, z)] = 1;
  };
  const int reach = other_walls_ ? 1 : 0;
  const int reach_z = g.nz > 0 ? reach : 0;
  for (int row = 0; row < g.rows(); ++row) {
    const int y = row % g.ny;
    const int z = row / g.ny;
    for (int x = 0; x < g.nx; ++x) {
      if ((cells_.state(x, y, z) & cell_obstacle) != 0) {
        // Ends of links of nodes that an open side looks at.
        if (open_side_within(settings_, {x, y, z}, 3)) mark(x, y, z);
        continue;
      }
      for (int dz = -reach_z; dz <= reach_z; ++dz) {
        for (int dy = -reach; dy <= reach; ++dy) {
          for (int dx = -reach; dx <= reach; ++dx) mark(x + dx, y + dy, z + dz);
        }
      }
    }
  }
  const auto held = std::count(needed.begin(), needed.end(), 1);
  constexpr double worthwhile = 0.9;
  Grid alone = g;
  alone.ranks = 1;
  alone.rank = 0;
  const bool places_fit = Populations::plane_of(alone) <= std::numeric_limits<std::int32_t>::max();
  if (!places_fit || static_cast<double>(held) > worthwhile * static_cast<double>(needed.size()))
    needed.clear();
  return needed;
}

void Flow::drop_solid_nodes() {
  const std::vector<std::uint8_t> needed = needed_nodes();
  if (needed.empty()) return;
  populations_.pack(needed);
  if (obstacles_) link_obstacles();
}

void Flow::apply_rules(Parity parity, bool sides_complete) {
  const bool compressible = settings_.equilibrium == EquilibriumModel::compressible;
  exchange_and_reflect(populations_, parity, settings_.sides, {halo_.get(), halo_ && looks_beside()});
  if (obstacles_) obstacle_links_.reflect(populations_, parity, compressible);
  if (wet_) wet_links_.reflect(populations_, parity, compressible);
  if (!bodies_.empty()) bodies_.links().reflect(populations_, parity, compressible, settings_.acceleration);
  if (!outline_links_.empty())
    outline_links_.reflect(populations_, parity, compressible, settings_.acceleration);
  if (!links_at_sides_.empty()) links_at_sides_.reflect(populations_, parity);
  if (!solid_node_links_.empty()) solid_node_links_.reflect(populations_, parity);
  if (obstacles_) obstacle_edges_.close(populations_, parity, compressible);
  // Edges replace what fluid nodes of two slabs may exchange.
  const auto tell = [&] {
    if (!halo_ || obstacle_edges_.count() + wet_edges_.count() == 0) return;
#pragma omp master
    {
      halo_->ruled(parity);
      halo_->tell_of_rules(populations_, parity);
    }
#pragma omp barrier
  };
  if (obstacles_ && wet_) tell();
  if (wet_) wet_edges_.close(populations_, parity, compressible);
  tell();
  complete_open_sides(populations_, parity, cells_, settings_.sides, settings_.equilibrium,
                      settings_.force == ForceModel::guo ? settings_.acceleration : std::array<double, 3>{},
                      sides_complete);
  bodies_.links().note(populations_, parity);
  outline_links_.note(populations_, parity);
  if (halo_) {
#pragma omp master
    halo_->ruled(parity);
  }
}

BodyLoad Flow::body_load(std::size_t body) const {
  if (measure_bodies_) return bodies_.mean_load(body);
  return bodies_.links().load(populations_, populations_.parity(), body);
}

BodyLoad Flow::solid_nodes_load() const {
  BodyLoad load = solid_node_links_.load(populations_, populations_.parity());
  load += links_at_sides_.load(populations_, populations_.parity());
  return load;
}

Force Flow::wet_force() const {
  return wet_links_.force(populations_) + wet_edges_.force();
}

void Flow::add_wet_node_forces(double weight, std::vector<double>& force) const {
  wet_links_.add_node_forces(populations_, weight, force);
  wet_edges_.add_node_forces(weight, force);
}

Force Flow::obstacle_force() const {
  if (outline_rule_) {
    const BodyLoad load = outline_links_.load(populations_, populations_.parity());
    return {load.force[0], load.force[1], load.torque[2]};
  }
  return obstacle_links_.force(populations_) + obstacle_edges_.force();
}

BodyLoad Flow::obstacle_load(std::uint32_t body) const {
  BodyLoad load = solid_node_links_.load(populations_, populations_.parity(), body);
  load += links_at_sides_.load(populations_, populations_.parity(), body);
  if (!obstacles_) return load;
  if (outline_rule_) {
    load += outline_links_.load(populations_, populations_.parity(), body);
    return load;
  }
  const Force outline = obstacle_links_.force(populations_, outline_bodies_, body) +
                        obstacle_edges_.force(outline_bodies_, body);
  load += {{outline.x, outline.y, 0.0}, {0.0, 0.0, outline.moment}};
  return load;
}

WallCounts Flow::wall_counts() const {
  WallCounts counts;
  for (const Links* links : {&wet_links_, &obstacle_links_}) {
    counts.links += links->counts().links;
    counts.fallbacks += links->counts().halfway;
    counts.unresolved += links->counts().unresolved;
  }
  for (const WallLinks* links : {&bodies_.links(), &outline_links_}) {
    counts.links += links->counts().links;
    counts.fallbacks += links->counts().fallbacks;
  }
  return counts;
}

// Threads meet several times in a step; on few nodes that would take longer than the nodes themselves.
int Flow::threads() const {
  constexpr std::size_t nodes_per_thread = 8192;
  const auto nodes =
      static_cast<std::size_t>(grid().past_row() - grid().first_row()) * static_cast<std::size_t>(grid().nx);
  return std::clamp(static_cast<int>(nodes / nodes_per_thread), 1, omp_get_max_threads());
}

void Flow::run(std::size_t steps) {
  const Parity start = populations_.parity();
  const Parity other = start == Parity::even ? Parity::odd : Parity::even;
  const bool in_blocks = populations_.packed();
  if (in_blocks) blocks_.follow(cells_, populations_);
  const FluidNodes nodes{cells_.rows(), in_blocks ? &blocks_ : nullptr};
  on_team_of(threads(), [&] {
    for (std::size_t n = 0; n < steps; ++n) {
      const Parity parity = n % 2 == 0 ? start : other;
      if (halo_ && n > 0) {
#pragma omp master
        halo_->stepped(parity);
      }
      if (n > 0 || !rules_applied_) apply_rules(parity, n == 0 && sides_complete_);
      if (measure_bodies_ && !bodies_.empty()) bodies_.add_loads(populations_, parity);
      if (saturated_.empty()) {
        step_(populations_, parity, nodes, parameters_);
        continue;
      }
      saturated_.keep(populations_, parity);
      step_(populations_, parity, nodes, parameters_);
      saturated_.replace(populations_, parity, parameters_, settings_.equilibrium);
    }
  });
  populations_.set_parity(steps % 2 == 0 ? start : other);
  if (halo_ && steps > 0) halo_->stepped(populations_.parity());
  if (steps > 0) rules_applied_ = sides_complete_ = false;
}

void Flow::compute_fields(Fields& fields) {
  apply_boundaries();
  const auto shift = settings_.velocity_shift();
  fluid::compute_fields(populations_, cells_, settings_.equilibrium, fields, shift);
  if (!saturated_.empty()) saturated_.blend_velocities(fields, settings_.rates.even);
}

void Flow::apply_boundaries() {
  if (rules_applied_) return;
  on_team_of(threads(), [&] { apply_rules(populations_.parity(), sides_complete_); });
  rules_applied_ = sides_complete_ = true;
}

}  // namespace estuary::fluid
