#include "sides.hpp"

namespace estuary::fluid {
namespace {

constexpr std::array<std::array<int, 2>, 4> outward{{{-1, 0}, {1, 0}, {0, -1}, {0, 1}}};

constexpr int direction_of(int cx, int cy) {
  for (int i = 0; i < D2Q9::count; ++i) {
    const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
    if (c[0] == cx && c[1] == cy) return i;
  }
  return 0;
}

// After an even step ghost nodes need what the opposite edge sends out; after an odd one the opposite edge
// needs what was put into ghost nodes. `towards` is the component of the directions that cross the side.
void copy_columns(Populations& p, Parity parity, int towards) {
  const bool even = parity == Parity::even;
  // Planes that hold populations moving towards +x are read beyond the right edge (odd) or for the left ghost
  // column (even).
  for (int i = 1; i < D2Q9::count; ++i) {
    const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
    if (c[0] != towards) continue;
    const int plane = even ? D2Q9::opposite[static_cast<std::size_t>(i)] : i;
    // Moving to +x (towards = 1): even: ghost -1 <- nx-1; odd: 0 <- ghost nx. Moving to -x: mirrored.
    const int to = even ? (towards > 0 ? -1 : p.nx()) : (towards > 0 ? 0 : p.nx() - 1);
    const int from = even ? (towards > 0 ? p.nx() - 1 : 0) : (towards > 0 ? p.nx() : -1);
#pragma omp for schedule(static) nowait
    for (int y = 0; y < p.ny(); ++y) p[p.slot(plane, p.node(to, y))] = p[p.slot(plane, p.node(from, y))];
  }
}

void copy_rows(Populations& p, Parity parity, int towards) {
  const bool even = parity == Parity::even;
  for (int i = 1; i < D2Q9::count; ++i) {
    const auto& c = D2Q9::velocity[static_cast<std::size_t>(i)];
    if (c[1] != towards) continue;
    const int plane = even ? D2Q9::opposite[static_cast<std::size_t>(i)] : i;
    const int to = even ? (towards > 0 ? -1 : p.ny()) : (towards > 0 ? 0 : p.ny() - 1);
    const int from = even ? (towards > 0 ? p.ny() - 1 : 0) : (towards > 0 ? p.ny() : -1);
    // Ghost columns take part, so that corners come round in two copies.
#pragma omp for schedule(static) nowait
    for (int x = -1; x <= p.nx(); ++x) p[p.slot(plane, p.node(x, to))] = p[p.slot(plane, p.node(x, from))];
  }
}

void reflect_at_wall(Populations& p, Parity parity, const Sides& sides, SideName name) {
  const Side& side = sides[name];
  const auto n = outward[name];
  const bool vertical = n[0] != 0;  // the side's nodes differ in y
  const int count = vertical ? p.ny() : p.nx();
  const int at = name == left || name == bottom ? 0 : (vertical ? p.nx() : p.ny()) - 1;
  const bool moving = !side.velocity_x.empty();
  for (int shift = -1; shift <= 1; ++shift) {
    const int i = vertical ? direction_of(n[0], shift) : direction_of(shift, n[1]);
    const auto direction = static_cast<std::size_t>(i);
    const int o = D2Q9::opposite[direction];
    // At a corner of two walls the diagonal belongs to the bottom or top wall.
    const int begin = vertical && shift < 0 && sides[bottom].kind == SideKind::wall ? 1 : 0;
    const int end = vertical && shift > 0 && sides[top].kind == SideKind::wall ? count - 1 : count;
#pragma omp for schedule(static) nowait
    for (int k = begin; k < end; ++k) {
      const std::ptrdiff_t node = vertical ? p.node(at, k) : p.node(k, at);
      double value = p[p.post_collision(parity, i, node)];
      if (moving) {
        const auto hit = static_cast<std::size_t>(2 * k + 1 + shift);
        const auto& c = D2Q9::velocity[direction];
        value -= 6.0 * D2Q9::weight[direction] * (c[0] * side.velocity_x[hit] + c[1] * side.velocity_y[hit]);
      }
      p[p.incoming(parity, o, node)] = value;
    }
  }
}

// Equilibrium at the given density with the inner neighbour's velocity across the side and none along it, and
// the neighbour's non-equilibrium part.
void extrapolate(Populations& p, Parity parity, Node node, Node inner, double excess, bool vertical,
                 bool compressible) {
  const std::ptrdiff_t from = p.node(inner.x, inner.y);
  std::array<double, D2Q9::count> f;
  for (int i = 0; i < D2Q9::count; ++i) f[static_cast<std::size_t>(i)] = p[p.incoming(parity, i, from)];
  const Moments m = moments_of<D2Q9>(f);
  const double inverse = compressible ? Compressible::inverse_density(m.excess) : 1.0;
  const double density = compressible ? 1 + excess : 1.0;
  const double scale = density * inverse;
  const Moments wanted{excess, vertical ? scale * m.momentum_x : 0.0, vertical ? 0.0 : scale * m.momentum_y};
  const std::ptrdiff_t to = p.node(node.x, node.y);
  for (int i = 0; i < D2Q9::count; ++i) {
    p[p.incoming(parity, i, to)] = equilibrium<D2Q9>(i, wanted, 1 / density) +
                                   f[static_cast<std::size_t>(i)] - equilibrium<D2Q9>(i, m, inverse);
  }
}

template <SideName name>
void complete(Populations& p, Parity parity, const Cells& cells, const Side& side, bool compressible) {
  constexpr auto n = outward[name];
  constexpr bool vertical = n[0] != 0;
  constexpr int in = direction_of(-n[0], -n[1]);  // the unknown population along the normal
  constexpr int out = direction_of(n[0], n[1]);
  constexpr int up = vertical ? direction_of(0, 1) : direction_of(1, 0);  // along the side
  constexpr int down = vertical ? direction_of(0, -1) : direction_of(-1, 0);
  constexpr int in_up = vertical ? direction_of(-n[0], 1) : direction_of(1, -n[1]);
  constexpr int in_down = vertical ? direction_of(-n[0], -1) : direction_of(-1, -n[1]);
  constexpr int out_up = vertical ? direction_of(n[0], 1) : direction_of(1, n[1]);
  constexpr int out_down = vertical ? direction_of(n[0], -1) : direction_of(-1, n[1]);
  constexpr int inward = vertical ? -n[0] : -n[1];  // sign of the normal component that enters
  const int count = vertical ? p.ny() : p.nx();
  const int at = name == left || name == bottom ? 0 : (vertical ? p.nx() : p.ny()) - 1;
#pragma omp for schedule(static) nowait
  for (int k = 0; k < count; ++k) {
    const int x = vertical ? at : k;
    const int y = vertical ? k : at;
    if (!cells.fluid(x, y)) continue;
    const auto entry = static_cast<std::size_t>(k);
    const Node inner{x - n[0], y - n[1]};
    if (side.kind == SideKind::pressure && cells.fluid(inner.x, inner.y)) {
      extrapolate(p, parity, {x, y}, inner, side.excess[entry], vertical, compressible);
      continue;
    }
    const std::ptrdiff_t node = p.node(x, y);
    const auto known = [&](int i) { return p[p.incoming(parity, i, node)]; };
    const double along = known(0) + known(up) + known(down);
    const double leaving = known(out) + known(out_up) + known(out_down);
    double normal = 0;      // momentum into the fluid
    double tangential = 0;  // momentum along the side
    if (side.kind == SideKind::pressure) {
      normal = side.excess[entry] - along - 2 * leaving;
    } else {
      const double velocity = inward * (vertical ? side.velocity_x[entry] : side.velocity_y[entry]);
      const double density = compressible ? (1 + along + 2 * leaving) / (1 - velocity) : 1.0;
      normal = density * velocity;
      tangential = density * (vertical ? side.velocity_y[entry] : side.velocity_x[entry]);
    }
    const double half_difference = 0.5 * (known(up) - known(down));
    p[p.incoming(parity, in, node)] = known(out) + 2.0 / 3.0 * normal;
    p[p.incoming(parity, in_up, node)] = known(out_down) - half_difference + normal / 6.0 + 0.5 * tangential;
    p[p.incoming(parity, in_down, node)] = known(out_up) + half_difference + normal / 6.0 - 0.5 * tangential;
  }
}

bool open(const Side& side) {
  return side.kind == SideKind::velocity || side.kind == SideKind::pressure;
}

}  // namespace

void exchange_and_reflect(Populations& populations, Parity parity, const Sides& sides) {
  const bool in_x = sides[left].kind == SideKind::periodic;
  const bool in_y = sides[bottom].kind == SideKind::periodic;
  const auto columns = [&] {
    copy_columns(populations, parity, 1);
    copy_columns(populations, parity, -1);
#pragma omp barrier
  };
  const auto rows = [&] {
    copy_rows(populations, parity, 1);
    copy_rows(populations, parity, -1);
#pragma omp barrier
  };
  // Into ghosts columns come first, out of ghosts rows: corners then pass through the ghost column of the
  // right row.
  if (parity == Parity::even) {
    if (in_x) columns();
    if (in_y) rows();
  } else {
    if (in_y) rows();
    if (in_x) columns();
  }
  bool walls = false;
  for (const SideName name : {left, right, bottom, top}) {
    if (sides[name].kind != SideKind::wall) continue;
    reflect_at_wall(populations, parity, sides, name);
    walls = true;
  }
  if (walls) {
#pragma omp barrier
  }
}

void complete_open_sides(Populations& populations, Parity parity, const Cells& cells, const Sides& sides,
                         EquilibriumModel equilibrium) {
  const bool compressible = equilibrium == EquilibriumModel::compressible;
  if (open(sides[left])) complete<left>(populations, parity, cells, sides[left], compressible);
  if (open(sides[right])) complete<right>(populations, parity, cells, sides[right], compressible);
  if (open(sides[bottom])) complete<bottom>(populations, parity, cells, sides[bottom], compressible);
  if (open(sides[top])) complete<top>(populations, parity, cells, sides[top], compressible);
  if (open(sides[left]) || open(sides[right]) || open(sides[bottom]) || open(sides[top])) {
#pragma omp barrier
  }
}

}  // namespace estuary::fluid
