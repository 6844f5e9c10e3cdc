#include "fields.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::fluid {
namespace {

std::size_t place(const Cells& cells, int x, int y) {
  return static_cast<std::size_t>(y) * static_cast<std::size_t>(cells.grid().nx) +
         static_cast<std::size_t>(x);
}

// On fewer nodes waiting for the other threads takes longer than the nodes.
bool parallel_pays(const Cells& cells) {
  return cells.grid().nx * cells.grid().ny > 16384;
}

// Adds what `of_node(x, y, sums)` contributes: row by row, then the rows in order, whatever the number of
// threads.
template <class Sums, class OfNode, class Combine>
Sums over_rows(const Cells& cells, const OfNode& of_node, const Combine& combine) {
  std::vector<Sums> rows(static_cast<std::size_t>(cells.grid().ny));
#pragma omp parallel for schedule(static) if (parallel_pays(cells))
  for (int y = 0; y < cells.grid().ny; ++y) {
    Sums sums;
    for (const Span span : cells.row(y)) {
      for (int x = span.begin; x < span.end; ++x) of_node(x, y, sums);
    }
    rows[static_cast<std::size_t>(y)] = sums;
  }
  Sums total;
  for (const Sums& row : rows) combine(total, row);
  return total;
}

}  // namespace

Moments incoming_moments(const Populations& p, Node node) {
  const std::ptrdiff_t n = p.node(node.x, node.y);
  std::array<double, D2Q9::count> f;
  for (int i = 0; i < D2Q9::count; ++i) f[static_cast<std::size_t>(i)] = p[p.incoming(p.parity(), i, n)];
  return moments_of<D2Q9>(f);
}

void compute_fields(const Populations& populations, const Cells& cells, EquilibriumModel model,
                    Fields& fields) {
  const std::size_t size =
      static_cast<std::size_t>(cells.grid().nx) * static_cast<std::size_t>(cells.grid().ny);
  fields.excess.resize(size);
  fields.velocity_x.resize(size);
  fields.velocity_y.resize(size);
  const int nx = cells.grid().nx;
#pragma omp parallel for schedule(static) if (parallel_pays(cells))
  for (int y = 0; y < cells.grid().ny; ++y) {
    for (auto* field : {&fields.excess, &fields.velocity_x, &fields.velocity_y}) {
      std::fill_n(field->data() + place(cells, 0, y), nx, 0.0);
    }
    for (const Span span : cells.row(y)) {
      for (int x = span.begin; x < span.end; ++x) {
        const Moments m = incoming_moments(populations, {x, y});
        const double inverse =
            model == EquilibriumModel::compressible ? Compressible::inverse_density(m.excess) : 1.0;
        const std::size_t k = place(cells, x, y);
        fields.excess[k] = m.excess;
        fields.velocity_x[k] = m.momentum_x * inverse;
        fields.velocity_y[k] = m.momentum_y * inverse;
      }
    }
  }
}

void set_equilibrium(Populations& p, const Fields& fields, EquilibriumModel model) {
#pragma omp parallel for schedule(static)
  for (int y = 0; y < p.ny(); ++y) {
    for (int x = 0; x < p.nx(); ++x) {
      const std::size_t k =
          static_cast<std::size_t>(y) * static_cast<std::size_t>(p.nx()) + static_cast<std::size_t>(x);
      const double excess = fields.excess[k];
      const bool compressible = model == EquilibriumModel::compressible;
      const double density = compressible ? 1 + excess : 1.0;
      const Moments m{excess, density * fields.velocity_x[k], density * fields.velocity_y[k]};
      const double inverse = 1 / density;
      const std::ptrdiff_t node = p.node(x, y);
      for (int i = 0; i < D2Q9::count; ++i) {
        p[p.post_collision(p.parity(), i, node)] = equilibrium<D2Q9>(i, m, inverse);
      }
    }
  }
}

FieldSums sum_fields(const Fields& fields, const Cells& cells, const Sides& sides) {
  const auto open = [&](SideName name) {
    return sides[name].kind == SideKind::velocity || sides[name].kind == SideKind::pressure;
  };
  const Grid& grid = cells.grid();
  return over_rows<FieldSums>(
      cells,
      [&](int x, int y, FieldSums& sums) {
        const std::size_t k = place(cells, x, y);
        const bool half_x = (x == 0 && open(left)) || (x == grid.nx - 1 && open(right));
        const bool half_y = (y == 0 && open(bottom)) || (y == grid.ny - 1 && open(top));
        const double area = (half_x ? 0.5 : 1.0) * (half_y ? 0.5 : 1.0);
        const double square =
            fields.velocity_x[k] * fields.velocity_x[k] + fields.velocity_y[k] * fields.velocity_y[k];
        sums.area += area;
        sums.excess += area * fields.excess[k];
        sums.kinetic_energy += area * 0.5 * square;
        sums.maximum_speed = std::max(sums.maximum_speed, std::sqrt(square));
        sums.momentum_x += area * fields.velocity_x[k];
        sums.momentum_y += area * fields.velocity_y[k];
      },
      [](FieldSums& total, const FieldSums& row) {
        total.area += row.area;
        total.excess += row.excess;
        total.kinetic_energy += row.kinetic_energy;
        total.maximum_speed = std::max(total.maximum_speed, row.maximum_speed);
        total.momentum_x += row.momentum_x;
        total.momentum_y += row.momentum_y;
      });
}

VelocityChange update_velocities(const Fields& now, const Cells& cells, std::vector<double>& previous_x,
                                 std::vector<double>& previous_y) {
  previous_x.resize(now.velocity_x.size());
  previous_y.resize(now.velocity_y.size());
  return over_rows<VelocityChange>(
      cells,
      [&](int x, int y, VelocityChange& sums) {
        const std::size_t k = place(cells, x, y);
        const double dx = now.velocity_x[k] - previous_x[k];
        const double dy = now.velocity_y[k] - previous_y[k];
        sums.change += dx * dx + dy * dy;
        sums.norm += now.velocity_x[k] * now.velocity_x[k] + now.velocity_y[k] * now.velocity_y[k];
        previous_x[k] = now.velocity_x[k];
        previous_y[k] = now.velocity_y[k];
      },
      [](VelocityChange& total, const VelocityChange& row) {
        total.change += row.change;
        total.norm += row.norm;
      });
}

std::optional<BadNode> find_bad_node(const Fields& fields, const Cells& cells) {
  const double limit = D2Q9::sound_speed_squared;
  for (int y = 0; y < cells.grid().ny; ++y) {
    for (const Span span : cells.row(y)) {
      for (int x = span.begin; x < span.end; ++x) {
        const std::size_t k = place(cells, x, y);
        const double square =
            fields.velocity_x[k] * fields.velocity_x[k] + fields.velocity_y[k] * fields.velocity_y[k];
        // Written so that a value that is no number fails the test.
        if (square < limit && std::abs(fields.excess[k]) < 1e3) continue;
        const bool finite = std::isfinite(square) && std::isfinite(fields.excess[k]);
        return BadNode{{x, y}, finite, std::sqrt(square), fields.excess[k]};
      }
    }
  }
  return std::nullopt;
}

}  // namespace estuary::fluid
