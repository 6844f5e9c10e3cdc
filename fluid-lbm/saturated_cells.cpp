#include "saturated_cells.hpp"

#include <algorithm>
#include <cmath>

#include "on_team.hpp"
#include "solid_fraction.hpp"

namespace estuary::fluid {
namespace {

// How far covered cells turn the momentum that reaches them, relative to the grain: all of it back is 2, and
// rings for ever between cells; 1 leaves none, and lets density diffuse through the grain at 1/6. In between
// rings die by 0.8 per step, and the leak is a ninth.
constexpr double turning = 1.8;

// The method's B.
double weight_of(double fraction, double t) {
  return fraction * t / (1 - fraction + t);
}

struct Range {
  int begin;
  int end;
};

// Nodes whose cells a grain can reach.
Range reach(double centre, double radius, int count, bool periodic) {
  const double low = std::floor(centre - radius - 0.5);
  const double high = std::ceil(centre + radius + 0.5);
  if (periodic) return {static_cast<int>(low), static_cast<int>(high) + 1};
  return {static_cast<int>(std::clamp(low, 0.0, static_cast<double>(count))),
          static_cast<int>(std::clamp(high + 1, 0.0, static_cast<double>(count)))};
}

}  // namespace

SaturatedCells::SaturatedCells(const Grid& grid, Ranks* ranks) : grid_(grid), ranks_(ranks) {}

void SaturatedCells::place(const Grains& grains, const Cells& cells) {
  if (placed_ && grains == grains_) return;
  placed_ = true;
  if (grains.count() != grains_.count() || force_sum_.empty()) {
    const std::size_t turns = grains.dimension == 3 ? 3 : 1;
    force_sum_.assign(static_cast<std::size_t>(grains.dimension) * grains.count(), 0.0);
    torque_sum_.assign(turns * grains.count(), 0.0);
    last_force_.assign(force_sum_.size(), 0.0);
    last_torque_.assign(torque_sum_.size(), 0.0);
    has_last_ = false;
    steps_ = 0;
  }
  const bool moved = grains.centre != grains_.centre || grains.radius != grains_.radius;
  grains_ = grains;
  if (!moved) return;
  if (cell_of_.empty()) cell_of_.assign(grid_.size(), -1);
  find_covers(cells);
  gather_cells();
}

void SaturatedCells::find_covers(const Cells& cells) {
  const auto dimension = static_cast<std::size_t>(grains_.dimension);
  const auto count = static_cast<std::ptrdiff_t>(grains_.count());
  of_grain_.resize(grains_.count());
  on_team(count > 64, [&] {
#pragma omp for schedule(static) nowait
    for (std::ptrdiff_t g = 0; g < count; ++g) {
      const auto grain = static_cast<std::size_t>(g);
      auto& covers = of_grain_[grain];
      covers.clear();
      const double radius = grains_.radius[grain];
      const double* centre = &grains_.centre[dimension * grain];
      const double cz = dimension == 3 ? centre[2] : 0.0;
      const Range xs = reach(centre[0], radius, grid_.nx, grid_.periodic_x);
      const Range ys = reach(centre[1], radius, grid_.ny, grid_.periodic_y);
      const Range zs = dimension == 3 ? reach(cz, radius, grid_.nz, grid_.periodic_z) : Range{0, 1};
      for (int z = zs.begin; z < zs.end; ++z) {
        const int k = dimension == 3 ? image_inside(z, grid_.nz, grid_.periodic_z) : 0;
        for (int y = ys.begin; y < ys.end; ++y) {
          const int j = image_inside(y, grid_.ny, grid_.periodic_y);
          for (int x = xs.begin; x < xs.end; ++x) {
            const int i = image_inside(x, grid_.nx, grid_.periodic_x);
            if (!cells.fluid(i, j, k)) continue;
            const std::array<double, 3> arm{x - centre[0], y - centre[1], dimension == 3 ? z - cz : 0.0};
            const double fraction = dimension == 3 ? sphere_fraction(arm[0], arm[1], arm[2], radius)
                                                   : disc_fraction(arm[0], arm[1], radius);
            if (fraction > 0) covers.push_back({static_cast<std::int32_t>(g), {i, j, k}, fraction, arm});
          }
        }
      }
    }
  });
  covers_.clear();
  first_of_grain_.assign(1, 0);
  for (const auto& covers : of_grain_) {
    covers_.insert(covers_.end(), covers.begin(), covers.end());
    first_of_grain_.push_back(covers_.size());
  }
}

void SaturatedCells::gather_cells() {
  cells_.clear();
  for (const Cover& cover : covers_) {
    const std::size_t place = grid_.index(cover.node.x, cover.node.y, cover.node.z);
    std::int32_t& number = cell_of_[place];
    if (number < 0) {
      number = static_cast<std::int32_t>(cells_.size());
      cells_.push_back({static_cast<std::ptrdiff_t>(place), 0, 0, 0});
    }
    Cell& cell = cells_[static_cast<std::size_t>(number)];
    ++cell.count;
    cell.fraction += cover.fraction;
  }
  std::uint32_t next = 0;
  for (Cell& cell : cells_) {
    cell.first = next;
    next += cell.count;
    cell.count = 0;
  }
  order_.resize(covers_.size());
  for (std::size_t n = 0; n < covers_.size(); ++n) {
    const Node node = covers_[n].node;
    Cell& cell = cells_[static_cast<std::size_t>(cell_of_[grid_.index(node.x, node.y, node.z)])];
    order_[cell.first + cell.count++] = static_cast<std::uint32_t>(n);
  }
  for (const Cell& cell : cells_) cell_of_[static_cast<std::size_t>(cell.node)] = -1;
  for (Cell& cell : cells_) {
    if (cell.fraction <= 1) continue;
    for (std::uint32_t k = 0; k < cell.count; ++k) covers_[order_[cell.first + k]].fraction /= cell.fraction;
    cell.fraction = 1;
  }
  kept_.resize(cells_.size() * static_cast<std::size_t>(lattice_of_dimension(grains_.dimension).count));
  push_.assign(3 * covers_.size(), 0.0);
  if (ranks_ != nullptr) find_owners();
}

void SaturatedCells::keep(const Populations& populations, Parity parity) {
  const auto count = static_cast<std::size_t>(populations.lattice().count);
#pragma omp for schedule(static)
  for (std::size_t n = 0; n < cells_.size(); ++n) {
    const Node at = covers_[order_[cells_[n].first]].node;
    if (!grid_.owns(at.y, at.z)) continue;
    const std::ptrdiff_t node = populations.node(at.x, at.y, at.z);
    for (std::size_t i = 0; i < count; ++i) {
      kept_[count * n + i] = populations[populations.incoming(parity, static_cast<int>(i), node)];
    }
  }
}

std::array<double, 3> SaturatedCells::velocity_at(const Cover& cover) const {
  const auto grain = static_cast<std::size_t>(cover.grain);
  if (grains_.dimension == 3) {
    const double* v = &grains_.velocity[3 * grain];
    const double* w = &grains_.spin[3 * grain];
    return {v[0] + w[1] * cover.arm[2] - w[2] * cover.arm[1],
            v[1] + w[2] * cover.arm[0] - w[0] * cover.arm[2],
            v[2] + w[0] * cover.arm[1] - w[1] * cover.arm[0]};
  }
  const double* v = &grains_.velocity[2 * grain];
  const double w = grains_.spin[grain];
  return {v[0] - w * cover.arm[1], v[1] + w * cover.arm[0], 0.0};
}

template <std::size_t dimension>
void SaturatedCells::add_pushes(std::size_t grain, double* force, double* torque) const {
  constexpr std::size_t turns = dimension == 3 ? 3 : 1;
  for (std::size_t n = first_of_grain_[grain]; n < first_of_grain_[grain + 1]; ++n) {
    const double* push = &push_[3 * n];
    const auto& arm = covers_[n].arm;
    for (std::size_t axis = 0; axis < dimension; ++axis) force[axis] += push[axis];
    if constexpr (dimension == 3) {
      torque[0] += arm[1] * push[2] - arm[2] * push[1];
      torque[1] += arm[2] * push[0] - arm[0] * push[2];
    }
    torque[turns - 1] += arm[0] * push[1] - arm[1] * push[0];
  }
}

void SaturatedCells::find_owners() {
  owner_of_grain_.assign(grains_.count(), -1);
  std::size_t shared = 0;
  for (std::size_t grain = 0; grain < grains_.count(); ++grain) {
    const std::size_t first = first_of_grain_[grain];
    const std::size_t past = first_of_grain_[grain + 1];
    if (first == past) continue;
    const auto owner_of = [&](std::size_t n) { return grid_.owner(covers_[n].node.y, covers_[n].node.z); };
    std::int32_t& owner = owner_of_grain_[grain];
    owner = owner_of(first);
    for (std::size_t n = first; n < past && owner >= 0; ++n)
      if (owner_of(n) != owner) owner = -1;
    if (owner < 0) shared += past - first;
  }
  const std::size_t entries = grains_.dimension == 3 ? 6 : 3;
  of_step_.resize(entries * grains_.count() + 3 * shared);
}

// A grain whose covered cells are all one rank's is added up there; of the others the pushes are shared, so
// that every rank adds them up in their order.
void SaturatedCells::share_pushes() {
  const bool space = grains_.dimension == 3;
  const std::size_t entries = space ? 6 : 3;
  const std::size_t dimension = space ? 3 : 2;
  const std::int32_t own = ranks_->rank();
  const std::size_t count = grains_.count();
  const auto add_up = [&](std::size_t grain) {
    double* const to = &of_step_[entries * grain];
    if (space) {
      add_pushes<3>(grain, to, to + dimension);
    } else {
      add_pushes<2>(grain, to, to + dimension);
    }
  };
  std::fill(of_step_.begin(), of_step_.end(), 0.0);
  double* push = of_step_.data() + entries * count;
  for (std::size_t grain = 0; grain < count; ++grain) {
    if (owner_of_grain_[grain] == own) add_up(grain);
    if (owner_of_grain_[grain] >= 0) continue;
    for (std::size_t n = first_of_grain_[grain]; n < first_of_grain_[grain + 1]; ++n, push += 3)
      if (grid_.owner(covers_[n].node.y, covers_[n].node.z) == own) std::copy_n(&push_[3 * n], 3, push);
  }
  share(ranks_, of_step_);
  push = of_step_.data() + entries * count;
  for (std::size_t grain = 0; grain < count; ++grain) {
    if (owner_of_grain_[grain] >= 0) continue;
    const std::size_t values = 3 * (first_of_grain_[grain + 1] - first_of_grain_[grain]);
    std::copy_n(push, values, push_.begin() + static_cast<std::ptrdiff_t>(3 * first_of_grain_[grain]));
    push += values;
    add_up(grain);
  }
}

template <class Lattice>
void SaturatedCells::replace_all(Populations& populations, Parity parity,
                                 const CollisionParameters& parameters, EquilibriumModel equilibrium_model) {
  constexpr auto count = static_cast<std::size_t>(Lattice::count);
  constexpr auto dimension = static_cast<std::size_t>(Lattice::dimension);
  const double t = 1.0 / parameters.rates.even - 0.5;
  const bool compressible = equilibrium_model == EquilibriumModel::compressible;
#pragma omp for schedule(static)
  for (std::size_t n = 0; n < cells_.size(); ++n) {
    const Cell& cell = cells_[n];
    const Node at = covers_[order_[cell.first]].node;
    if (!grid_.owns(at.y, at.z)) continue;
    const std::ptrdiff_t node = populations.node(at.x, at.y, at.z);
    std::array<double, count> f;
    for (std::size_t i = 0; i < count; ++i) f[i] = kept_[count * n + i];
    // Without half the body force: the rule sets the populations' momentum.
    const Moments m = moments_of<Lattice>(f);
    const double density = compressible ? 1 + m.excess : 1.0;
    const double weight = weight_of(cell.fraction, t);
    // f_i^eq - f_o^eq = 6 w_i c_i.(rho v), so that the push is 2 B rho (u - v), and the grains of a cell act
    // together through their mean momentum.
    std::array<double, 3> given{};
    // A body force acts on the fluid's share 1 - e of the cell, the collision has taken 1 - B of it.
    for (std::size_t axis = 0; axis < dimension; ++axis)
      given[axis] = 0.5 * (weight - cell.fraction) * density * parameters.acceleration[axis];
    for (std::uint32_t k = cell.first; k < cell.first + cell.count; ++k) {
      const Cover& cover = covers_[order_[k]];
      const double share = weight * cover.fraction / cell.fraction;
      const auto v = velocity_at(cover);
      const std::array<double, 3> fluid{m.momentum_x, m.momentum_y, m.momentum_z};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const double momentum = density * v[axis];
        const double slip = fluid[axis] - momentum;
        given[axis] += share * (momentum + (1 - 0.5 * turning) * slip);
        push_[3 * order_[k] + axis] = turning * share * slip;
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      const auto o = static_cast<std::size_t>(Lattice::opposite[i]);
      double along = 0;
      for (std::size_t axis = 0; axis < dimension; ++axis) along += Lattice::velocity[i][axis] * given[axis];
      // What is there now is the fluid's own collision.
      const std::ptrdiff_t place = populations.incoming(parity, static_cast<int>(o), node);
      populations[place] = (1 - weight) * populations[place] + weight * f[o] + 6 * Lattice::weight[i] * along;
    }
  }
  // Half of this step's and half of the one before.
  const double before = has_last_ ? 0.5 : 0.0;
  constexpr std::size_t turns = dimension == 3 ? 3 : 1;
  if (ranks_ != nullptr) {
#pragma omp master
    share_pushes();
#pragma omp barrier
  }
#pragma omp for schedule(static)
  for (std::size_t grain = 0; grain < grains_.count(); ++grain) {
    std::array<double, dimension> force{};
    std::array<double, turns> torque{};
    if (ranks_ != nullptr) {
      const double* const shared = &of_step_[(dimension + turns) * grain];
      std::copy_n(shared, dimension, force.begin());
      std::copy_n(shared + dimension, turns, torque.begin());
    } else {
      add_pushes<dimension>(grain, force.data(), torque.data());
    }
    const auto add = [&](std::vector<double>& sum, std::vector<double>& last, std::size_t k, double now) {
      sum[k] += before * last[k] + (1 - before) * now;
      last[k] = now;
    };
    for (std::size_t axis = 0; axis < dimension; ++axis)
      add(force_sum_, last_force_, dimension * grain + axis, force[axis]);
    for (std::size_t turn = 0; turn < turns; ++turn)
      add(torque_sum_, last_torque_, turns * grain + turn, torque[turn]);
  }
#pragma omp single
  {
    ++steps_;
    has_last_ = true;
  }
}

void SaturatedCells::replace(Populations& populations, Parity parity, const CollisionParameters& parameters,
                             EquilibriumModel equilibrium_model) {
  if (populations.lattice().dimension == 3) {
    replace_all<D3Q19>(populations, parity, parameters, equilibrium_model);
  } else {
    replace_all<D2Q9>(populations, parity, parameters, equilibrium_model);
  }
}

void SaturatedCells::blend_velocities(Fields& fields, double even_rate) const {
  const auto dimension = static_cast<std::size_t>(grains_.dimension);
  const double t = 1.0 / even_rate - 0.5;
  for (const Cell& cell : cells_) {
    const auto k = static_cast<std::size_t>(cell.node);
    const Node at = covers_[order_[cell.first]].node;
    if (!grid_.owns(at.y, at.z)) continue;
    const double weight = weight_of(cell.fraction, t);
    std::array<double, 3> velocity{fields.velocity_x[k], fields.velocity_y[k],
                                   dimension == 3 ? fields.velocity_z[k] : 0.0};
    for (double& component : velocity) component *= 1 - weight;
    for (std::uint32_t n = cell.first; n < cell.first + cell.count; ++n) {
      const Cover& cover = covers_[order_[n]];
      const double share = weight * cover.fraction / cell.fraction;
      const auto moving = velocity_at(cover);
      for (std::size_t axis = 0; axis < 3; ++axis) velocity[axis] += share * moving[axis];
    }
    fields.velocity_x[k] = velocity[0];
    fields.velocity_y[k] = velocity[1];
    if (dimension == 3) fields.velocity_z[k] = velocity[2];
  }
}

GrainLoads SaturatedCells::mean_loads() const {
  GrainLoads loads{force_sum_, torque_sum_};
  const double scale = steps_ > 0 ? 1.0 / static_cast<double>(steps_) : 0.0;
  for (double& value : loads.force) value *= scale;
  for (double& value : loads.torque) value *= scale;
  return loads;
}

void SaturatedCells::restart_loads() {
  std::fill(force_sum_.begin(), force_sum_.end(), 0.0);
  std::fill(torque_sum_.begin(), torque_sum_.end(), 0.0);
  steps_ = 0;
}

std::vector<double> SaturatedCells::save() const {
  if (empty()) return {};
  std::vector<double> last{has_last_ ? 1.0 : 0.0};
  last.insert(last.end(), last_force_.begin(), last_force_.end());
  last.insert(last.end(), last_torque_.begin(), last_torque_.end());
  return last;
}

void SaturatedCells::restore(const std::vector<double>& last) {
  if (last.size() != 1 + last_force_.size() + last_torque_.size()) return;
  has_last_ = last.front() == 1.0;
  const auto torques = last.begin() + 1 + static_cast<std::ptrdiff_t>(last_force_.size());
  last_force_.assign(last.begin() + 1, torques);
  last_torque_.assign(torques, last.end());
}

void SaturatedCells::fractions(std::vector<double>& shares) const {
  shares.assign(grid_.size(), 0.0);
  for (const Cell& cell : cells_) shares[static_cast<std::size_t>(cell.node)] = cell.fraction;
}

}  // namespace estuary::fluid
