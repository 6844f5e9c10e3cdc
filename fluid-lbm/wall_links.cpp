#include "wall_links.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::fluid {
namespace {

// c_in . velocity at a node, from what left it.
double velocity_along(const Populations& p, Parity parity, std::ptrdiff_t node, int i, bool compressible) {
  const LatticeTable& lattice = p.lattice();
  std::array<double, 3> momentum{};
  double density = 1;
  for (int k = 0; k < lattice.count; ++k) {
    const double f = p[p.post_collision(parity, k, node)];
    if (compressible) density += f;
    for (std::size_t axis = 0; axis < 3; ++axis) momentum[axis] += lattice.velocity[k][axis] * f;
  }
  double along = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) along -= lattice.velocity[i][axis] * momentum[axis];
  return along / density;
}

}  // namespace

void WallLinks::clear() {
  rules_.clear();
  places_.clear();
  first_of_node_.clear();
  nodes_.clear();
  counts_ = {};
  looks_beside_ = false;
  memory_.clear();
}

void WallLinks::add(Node node, int i, double q, WallRule rule, const std::array<double, 3>& velocity,
                    std::uint32_t body, const std::array<double, 3>& arm, const Cells& cells,
                    const Populations& layout) {
  const LatticeTable& lattice = layout.lattice();
  const Grid& grid = cells.grid();
  const auto& c = lattice.velocity[i];
  const int o = lattice.opposite[i];
  const auto behind = [&](int steps) {
    return Node{grid.wrap_x(node.x - steps * c[0]), grid.wrap_y(node.y - steps * c[1]),
                grid.wrap_z(node.z - steps * c[2])};
  };
  const auto is_fluid = [&](Node at) {
    return grid.inside(at.x, at.y, at.z) && cells.fluid(at.x, at.y, at.z);
  };
  const Node second = behind(1);
  const bool has_second = is_fluid(second);
  // Whether x - 2c_i is fluid, which only q < 1/2 of the quadratic rule needs.
  const bool has_third = has_second && is_fluid(behind(2));
  ++counts_.links;
  if (rule == WallRule::quadratic && !(has_second && (q >= 0.5 || has_third))) {
    rule = WallRule::linear;
    ++counts_.fallbacks;
  }
  const bool needs_second = (rule == WallRule::linear && q < 0.5) || rule == WallRule::central_linear ||
                            (rule == WallRule::yin_zhang && q < 0.5);
  if (needs_second && !has_second) {
    rule = WallRule::halfway;
    ++counts_.fallbacks;
  }
  const std::ptrdiff_t here = layout.node(node.x, node.y, node.z);
  const bool own = layout.owns(node.y, node.z);
  // A row that only its own rank can look at from here.
  const std::ptrdiff_t there = has_second && own ? layout.held_node(second.x, second.y, second.z) : here;
  if (nodes_.empty() || nodes_.back() != here) {
    nodes_.push_back(here);
    first_of_node_.push_back(rules_.size());
  }
  Rule r;
  r.direction = i;
  double along_wall = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) along_wall -= c[axis] * velocity[axis];
  r.wall = 6.0 * lattice.weight[i] * along_wall;
  for (const Parity parity : parities) {
    const std::size_t k = index_of(parity);
    r.leaving[k] = layout.post_collision(parity, i, here);
    r.incoming[k] = layout.incoming(parity, o, here);
    r.second[k] = layout.post_collision(parity, o, here);
    r.third[k] = r.second[k];
  }
  // The population that left x - c_i along i is the one that comes in at x along i.
  const auto from_behind = [&](std::array<std::ptrdiff_t, 2>& places, std::ptrdiff_t at) {
    for (const Parity parity : parities) places[index_of(parity)] = layout.incoming(parity, i, at);
  };
  switch (rule) {
    case WallRule::halfway:
      break;
    case WallRule::linear:
      if (q < 0.5) {
        r.weight_leaving = 2 * q;
        r.weight_second = 1 - 2 * q;
        from_behind(r.second, here);
      } else {
        r.weight_leaving = r.wall_weight = 1 / (2 * q);
        r.weight_second = 1 - r.weight_leaving;
      }
      break;
    case WallRule::quadratic:
      if (q < 0.5) {
        r.weight_leaving = q * (2 * q + 1);
        r.weight_second = 1 - 4 * q * q;
        r.weight_third = -q * (1 - 2 * q);
        from_behind(r.second, here);
        from_behind(r.third, there);
      } else {
        r.weight_leaving = r.wall_weight = 1 / (q * (2 * q + 1));
        r.weight_second = (2 * q - 1) / q;
        r.weight_third = (1 - 2 * q) / (1 + 2 * q);
        for (const Parity parity : parities)
          r.third[index_of(parity)] = layout.post_collision(parity, o, there);
      }
      break;
    case WallRule::central_linear: {
      const double kappa = (1 - 2 * q) / (1 + 2 * q);
      r.wall_weight = 2 / (1 + 2 * q);
      r.weight_second = -kappa;
      r.weight_third = kappa;
      from_behind(r.third, here);
      break;
    }
    case WallRule::yin_zhang: {
      // Distances from the solid node: the wall at `at`, x at 1, x - c_i at 2.
      const double at = 1 - q;
      const bool near = at <= 0.5;
      r.wall_weight = near ? 0.5 / (1 - at) : 1.5 / (2 - at);
      r.velocity_share = 1 - r.wall_weight;
      r.velocity_node = near ? here : there;
      break;
    }
    case WallRule::one_point: {
      const double k = q < 0.5 ? 1.0 : 1 / (2 * q);
      r.weight_leaving = r.wall_weight = k;
      r.weight_second = 1 - k;
      const bool known = relaxation_.even > 0;
      const double parabola = known ? 0.75 * q * q / relaxation_.even - relaxation_.odd : 0.0;
      r.weight_even = 2 * k * q - 1;
      r.weight_excess = 2 * k * parabola;
      r.mean_rate = std::min(0.5, 0.5 / std::abs(r.weight_excess));
      r.weight_odd = 1 - k;
      r.memory = static_cast<std::ptrdiff_t>(memory_.add(here, i, layout, own));
      break;
    }
  }
  looks_beside_ = looks_beside_ || rule == WallRule::quadratic || rule == WallRule::yin_zhang;
  rules_.push_back(r);
  places_.push_back({body, i, velocity, arm, grid.owner(node.y, node.z)});
}

void WallLinks::finish(std::size_t bodies) {
  memory_.finish();
  first_of_node_.push_back(rules_.size());
  first_of_body_.assign(bodies + 1, 0);
  for (const Place& place : places_) ++first_of_body_[place.body + 1];
  for (std::size_t body = 0; body < bodies; ++body) first_of_body_[body + 1] += first_of_body_[body];
  std::vector<std::size_t> next(first_of_body_.begin(), first_of_body_.end() - 1);
  by_body_.resize(places_.size());
  for (std::size_t n = 0; n < places_.size(); ++n) {
    by_body_[next[places_[n].body]++] = static_cast<std::uint32_t>(n);
  }
  if (ranks_ == nullptr) return;
  owner_of_body_.assign(bodies, 0);
  for (std::size_t body = 0; body < bodies; ++body) {
    for (std::size_t m = first_of_body_[body]; m < first_of_body_[body + 1]; ++m) {
      const std::int32_t owner = places_[by_body_[m]].owner;
      if (m == first_of_body_[body]) owner_of_body_[body] = owner;
      if (owner_of_body_[body] != owner) owner_of_body_[body] = -1;
    }
  }
}

void WallLinks::reflect(Populations& populations, Parity parity, bool compressible,
                        const std::array<double, 3>& acceleration) {
  const std::size_t k = index_of(parity);
  Populations& f = populations;
  const LatticeTable& lattice = populations.lattice();
#pragma omp for schedule(static)
  for (std::size_t group = 0; group < nodes_.size(); ++group) {
    const std::ptrdiff_t node = nodes_[group];
    if (ranks_ != nullptr && places_[first_of_node_[group]].owner != ranks_->rank()) continue;
    double density = 1;
    if (compressible) {
      for (int i = 0; i < lattice.count; ++i) density += f[populations.post_collision(parity, i, node)];
    }
    double gained = 0;
    for (std::size_t n = first_of_node_[group]; n < first_of_node_[group + 1]; ++n) {
      const Rule& rule = rules_[n];
      const double leaving = f[rule.leaving[k]];
      double incoming = rule.weight_leaving * leaving + rule.weight_second * f[rule.second[k]] +
                        rule.weight_third * f[rule.third[k]] + rule.wall * rule.wall_weight * density;
      double pushed = rule.wall * density;
      if (rule.velocity_node >= 0) {
        const double slip =
            rule.velocity_share * 6.0 * lattice.weight[rule.direction] * density *
            velocity_along(populations, parity, rule.velocity_node, rule.direction, compressible);
        incoming += slip;
        pushed = 0;  // its own sum over a node's links is what the rule keeps
      }
      if (rule.memory >= 0) {
        const auto& c = lattice.velocity[rule.direction];
        const double force = 3.0 * lattice.weight[rule.direction] * density *
                             (c[0] * acceleration[0] + c[1] * acceleration[1] + c[2] * acceleration[2]);
        const auto change =
            memory_.change(static_cast<std::size_t>(rule.memory), populations, parity, force, rule.mean_rate);
        incoming += rule.weight_even * change.even + rule.weight_odd * change.odd +
                    rule.weight_excess * change.mean_excess;
      }
      gained += incoming - leaving - pushed;
      f[rule.incoming[k]] = incoming;
    }
    f[populations.slot(0, node)] -= gained;
  }
}

BodyLoad WallLinks::load_of_link(const Populations& populations, Parity parity, std::size_t n) const {
  const std::size_t k = index_of(parity);
  const Place& place = places_[n];
  const auto& c = populations.lattice().velocity[place.direction];
  const double leaving = populations[rules_[n].leaving[k]];
  const double incoming = populations[rules_[n].incoming[k]];
  std::array<double, 3> f;
  for (std::size_t axis = 0; axis < 3; ++axis)
    f[axis] = leaving * (c[axis] - place.velocity[axis]) + incoming * (c[axis] + place.velocity[axis]);
  const auto& arm = place.arm;
  return {f, {arm[1] * f[2] - arm[2] * f[1], arm[2] * f[0] - arm[0] * f[2], arm[0] * f[1] - arm[1] * f[0]}};
}

BodyLoad WallLinks::load(const Populations& populations, Parity parity, std::size_t body) const {
  BodyLoad total;
  if (body + 1 >= first_of_body_.size()) return total;
  if (ranks_ != nullptr) {
    std::vector<BodyLoad> all;
    loads(populations, parity, all);
    return all[body];
  }
  for (std::size_t m = first_of_body_[body]; m < first_of_body_[body + 1]; ++m)
    total += load_of_link(populations, parity, by_body_[m]);
  return total;
}

// Bodies that one rank has to itself it adds up alone; of the others the links' loads are shared, so that
// every rank adds them up in their order.
void WallLinks::loads(const Populations& populations, Parity parity, std::vector<BodyLoad>& of_body) const {
  const std::size_t bodies = first_of_body_.empty() ? 0 : first_of_body_.size() - 1;
  constexpr std::size_t entries = 6;
  static_assert(sizeof(BodyLoad) == entries * sizeof(double));
  of_body.assign(bodies, {});
  if (ranks_ == nullptr) {
    for (std::size_t body = 0; body < bodies; ++body) of_body[body] = load(populations, parity, body);
    return;
  }
  const std::int32_t own = ranks_->rank();
  for (std::size_t body = 0; body < bodies; ++body) {
    for (std::size_t m = first_of_body_[body]; m < first_of_body_[body + 1]; ++m) {
      const std::uint32_t n = by_body_[m];
      if (owner_of_body_[body] == own) of_body[body] += load_of_link(populations, parity, n);
      if (owner_of_body_[body] >= 0) continue;
      of_body.push_back(places_[n].owner == own ? load_of_link(populations, parity, n) : BodyLoad{});
    }
  }
  if (!of_body.empty()) share(ranks_, {of_body.front().force.data(), entries * of_body.size()});
  std::size_t link = bodies;
  for (std::size_t body = 0; body < bodies; ++body) {
    if (owner_of_body_[body] >= 0) continue;
    for (std::size_t m = first_of_body_[body]; m < first_of_body_[body + 1]; ++m)
      of_body[body] += of_body[link++];
  }
  of_body.resize(bodies);
}

BodyLoad WallLinks::load(const Populations& populations, Parity parity) const {
  BodyLoad total;
  std::vector<BodyLoad> of_body;
  loads(populations, parity, of_body);
  for (const BodyLoad& load : of_body) total += load;
  return total;
}

std::vector<double> WallLinks::save_memory() const {
  std::vector<double> values = memory_.save();
  share(ranks_, values);
  return values;
}

}  // namespace estuary::fluid
