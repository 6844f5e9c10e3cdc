#include "fields.hpp"

#include <algorithm>
#include <cmath>

#include "on_team.hpp"

namespace estuary::fluid {
namespace {

// On fewer nodes waiting for the other threads takes longer than the nodes.
bool parallel_pays(const Grid& grid) {
  return grid.size() > 16384;
}

// Adds what `of_node(x, y, z, k, sums)` contributes: row by row, then the rows in order, whatever the number
// of threads.
template <class Sums, class OfNode, class Combine>
Sums over_rows(const Cells& cells, Ranks* ranks, const OfNode& of_node, const Combine& combine) {
  const Grid& grid = cells.grid();
  const int first = grid.first_row();
  std::vector<Sums> rows(static_cast<std::size_t>(grid.past_row() - first));
  on_team(parallel_pays(grid), [&] {
#pragma omp for schedule(static) nowait
    for (int row = first; row < grid.past_row(); ++row) {
      const int y = row % grid.ny;
      const int z = row / grid.ny;
      Sums sums;
      for (const Span span : cells.row(row)) {
        for (int x = span.begin; x < span.end; ++x) of_node(x, y, z, grid.index(x, y, z), sums);
      }
      rows[static_cast<std::size_t>(row - first)] = sums;
    }
  });
  Sums total;
  in_turn(ranks, total, [&](Sums& so_far) {
    for (const Sums& row : rows) combine(so_far, row);
  });
  return total;
}

template <class Lattice>
Moments moments_at(const Populations& p, std::ptrdiff_t node) {
  std::array<double, Lattice::count> f;
  for (int i = 0; i < Lattice::count; ++i)
    f[static_cast<std::size_t>(i)] = p[p.incoming(p.parity(), i, node)];
  return moments_of<Lattice>(f);
}

template <class Lattice>
void fill_row(const Populations& p, const Cells& cells, int row, EquilibriumModel model, Fields& fields,
              const std::array<double, 3>& shift) {
  const auto start = static_cast<std::size_t>(row) * static_cast<std::size_t>(cells.grid().nx);
  for (const Span span : cells.row(row)) {
    for (int x = span.begin; x < span.end; ++x) {
      const Moments m = moments_at<Lattice>(p, p.row_start(row) + x);
      const double inverse =
          model == EquilibriumModel::compressible ? Compressible::inverse_density(m.excess) : 1.0;
      const std::size_t k = start + static_cast<std::size_t>(x);
      fields.excess[k] = m.excess;
      fields.velocity_x[k] = m.momentum_x * inverse + shift[0];
      fields.velocity_y[k] = m.momentum_y * inverse + shift[1];
      if constexpr (Lattice::dimension == 3) fields.velocity_z[k] = m.momentum_z * inverse + shift[2];
    }
  }
}

double square_at(const Fields& fields, std::size_t k) {
  const double square =
      fields.velocity_x[k] * fields.velocity_x[k] + fields.velocity_y[k] * fields.velocity_y[k];
  return fields.velocity_z.empty() ? square : square + fields.velocity_z[k] * fields.velocity_z[k];
}

}  // namespace

Moments incoming_moments(const Populations& p, Node node) {
  const std::ptrdiff_t n = p.node(node.x, node.y, node.z);
  return p.lattice().dimension == 3 ? moments_at<D3Q19>(p, n) : moments_at<D2Q9>(p, n);
}

void compute_fields(const Populations& populations, const Cells& cells, EquilibriumModel model,
                    Fields& fields, const std::array<double, 3>& shift) {
  const Grid& grid = cells.grid();
  const bool space = grid.dimension() == 3;
  fields.excess.resize(grid.size());
  fields.velocity_x.resize(grid.size());
  fields.velocity_y.resize(grid.size());
  fields.velocity_z.resize(space ? grid.size() : 0);
  on_team(parallel_pays(grid), [&] {
#pragma omp for schedule(static) nowait
    for (int row = grid.first_row(); row < grid.past_row(); ++row) {
      for (auto* field : {&fields.excess, &fields.velocity_x, &fields.velocity_y, &fields.velocity_z}) {
        if (field->empty()) continue;
        std::fill_n(field->data() + static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.nx),
                    grid.nx, 0.0);
      }
      if (space) {
        fill_row<D3Q19>(populations, cells, row, model, fields, shift);
      } else {
        fill_row<D2Q9>(populations, cells, row, model, fields, shift);
      }
    }
  });
}

void set_equilibrium(Populations& p, const Fields& fields, EquilibriumModel model) {
  const bool space = p.lattice().dimension == 3;
#pragma omp parallel for schedule(static)
  for (int row = p.first_row(); row < p.past_row(); ++row) {
    for (int x = 0; x < p.nx(); ++x) {
      const std::size_t k =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(p.nx()) + static_cast<std::size_t>(x);
      const double excess = fields.excess[k];
      const bool compressible = model == EquilibriumModel::compressible;
      const double density = compressible ? 1 + excess : 1.0;
      const Moments m{excess, density * fields.velocity_x[k], density * fields.velocity_y[k],
                      space ? density * fields.velocity_z[k] : 0.0};
      const double inverse = 1 / density;
      const std::ptrdiff_t node = p.row_start(row) + x;
      for (int i = 0; i < p.lattice().count; ++i) {
        if (!p.holds(node)) continue;
        p[p.post_collision(p.parity(), i, node)] =
            space ? equilibrium<D3Q19>(i, m, inverse) : equilibrium<D2Q9>(i, m, inverse);
      }
    }
  }
}

FieldSums sum_fields(const Fields& fields, const Cells& cells, const Sides& sides, Ranks* ranks) {
  const Grid& grid = cells.grid();
  const auto share = [&](int at, int count, int axis) {
    const bool half = (at == 0 && is_open(sides[2 * static_cast<std::size_t>(axis)].kind)) ||
                      (at == count - 1 && is_open(sides[2 * static_cast<std::size_t>(axis) + 1].kind));
    return half ? 0.5 : 1.0;
  };
  return over_rows<FieldSums>(
      cells, ranks,
      [&](int x, int y, int z, std::size_t k, FieldSums& sums) {
        double area = share(x, grid.nx, 0) * share(y, grid.ny, 1);
        if (grid.nz > 0) area *= share(z, grid.nz, 2);
        const double square = square_at(fields, k);
        sums.area += area;
        sums.excess += area * fields.excess[k];
        sums.kinetic_energy += area * 0.5 * square;
        sums.maximum_speed = std::max(sums.maximum_speed, std::sqrt(square));
        sums.momentum_x += area * fields.velocity_x[k];
        sums.momentum_y += area * fields.velocity_y[k];
        if (!fields.velocity_z.empty()) sums.momentum_z += area * fields.velocity_z[k];
      },
      [](FieldSums& total, const FieldSums& row) {
        total.area += row.area;
        total.excess += row.excess;
        total.kinetic_energy += row.kinetic_energy;
        total.maximum_speed = std::max(total.maximum_speed, row.maximum_speed);
        total.momentum_x += row.momentum_x;
        total.momentum_y += row.momentum_y;
        total.momentum_z += row.momentum_z;
      });
}

VelocityChange update_velocities(const Fields& now, const Cells& cells, NodeValues& previous_x,
                                 NodeValues& previous_y, NodeValues& previous_z, Ranks* ranks) {
  previous_x.resize(now.velocity_x.size());
  previous_y.resize(now.velocity_y.size());
  previous_z.resize(now.velocity_z.size());
  return over_rows<VelocityChange>(
      cells, ranks,
      [&](int, int, int, std::size_t k, VelocityChange& sums) {
        const double dx = now.velocity_x[k] - previous_x[k];
        const double dy = now.velocity_y[k] - previous_y[k];
        sums.change += dx * dx + dy * dy;
        previous_x[k] = now.velocity_x[k];
        previous_y[k] = now.velocity_y[k];
        if (!previous_z.empty()) {
          const double dz = now.velocity_z[k] - previous_z[k];
          sums.change += dz * dz;
          previous_z[k] = now.velocity_z[k];
        }
        sums.norm += square_at(now, k);
      },
      [](VelocityChange& total, const VelocityChange& row) {
        total.change += row.change;
        total.norm += row.norm;
      });
}

namespace {

std::optional<BadNode> find_bad_node_of_own(const Fields& fields, const Cells& cells) {
  const double limit = D2Q9::sound_speed_squared;
  const Grid& grid = cells.grid();
  for (int row = grid.first_row(); row < grid.past_row(); ++row) {
    const int y = row % grid.ny;
    const int z = row / grid.ny;
    for (const Span span : cells.row(row)) {
      for (int x = span.begin; x < span.end; ++x) {
        const std::size_t k = grid.index(x, y, z);
        const double square = square_at(fields, k);
        // Written so that a value that is no number fails the test.
        if (square < limit && std::abs(fields.excess[k]) < 1e3) continue;
        const bool finite = std::isfinite(square) && std::isfinite(fields.excess[k]);
        return BadNode{{x, y, z}, finite, std::sqrt(square), fields.excess[k]};
      }
    }
  }
  return std::nullopt;
}

}  // namespace

std::optional<BadNode> find_bad_node(const Fields& fields, const Cells& cells, Ranks* ranks) {
  struct First {
    BadNode node;
    bool any = false;
  };
  First first;
  in_turn(ranks, first, [&](First& so_far) {
    if (so_far.any) return;
    if (const auto own = find_bad_node_of_own(fields, cells)) so_far = {*own, true};
  });
  if (!first.any) return std::nullopt;
  return first.node;
}

void gather_fields(Ranks* ranks, const Grid& grid, Fields& fields) {
  if (ranks == nullptr) return;
  const auto nx = static_cast<std::size_t>(grid.nx);
  const auto layer = nx * static_cast<std::size_t>(grid.nz > 0 ? grid.ny : 1);
  for (auto* field : {&fields.excess, &fields.velocity_x, &fields.velocity_y, &fields.velocity_z}) {
    if (field->empty()) continue;
    const auto rows_of = [&](int rank) {
      const auto first = static_cast<std::size_t>(grid.first_layer_of(rank)) * layer;
      const auto past = static_cast<std::size_t>(grid.first_layer_of(rank + 1)) * layer;
      return std::as_writable_bytes(std::span(field->data() + first, past - first));
    };
    if (ranks->rank() > 0) {
      ranks->send(0, rows_of(ranks->rank()));
      continue;
    }
    for (int rank = 1; rank < ranks->count(); ++rank) ranks->receive(rank, rows_of(rank));
  }
}

void share_fields(Ranks* ranks, const Grid& grid, const std::vector<Node>& nodes, Fields& fields) {
  if (ranks == nullptr) return;
  for (auto* field : {&fields.excess, &fields.velocity_x, &fields.velocity_y, &fields.velocity_z}) {
    if (field->empty()) continue;
    std::vector<double> values;
    values.reserve(nodes.size());
    for (const Node& node : nodes)
      values.push_back(grid.owns(node.y, node.z) ? (*field)[grid.index(node.x, node.y, node.z)] : 0.0);
    share(ranks, values);
    for (std::size_t k = 0; k < nodes.size(); ++k)
      (*field)[grid.index(nodes[k].x, nodes[k].y, nodes[k].z)] = values[k];
  }
}

}  // namespace estuary::fluid
