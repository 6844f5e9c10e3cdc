#include "sides.hpp"

#include "side_frame.hpp"

namespace estuary::fluid {
namespace {

// After an even step ghost nodes need what the opposite edge sends out; after an odd one the opposite edge
// needs what was put into ghost nodes. `towards` is the component along `axis` of the directions that cross
// the side.
void copy_across(Populations& p, Parity parity, int axis, int towards) {
  const bool even = parity == Parity::even;
  const LatticeTable& lattice = p.lattice();
  const std::array<int, 3> counts{p.nx(), p.ny(), p.nz() > 0 ? p.nz() : 1};
  const int count = counts[static_cast<std::size_t>(axis)];
  // Moving to + (towards = 1): even: ghost -1 <- count-1; odd: 0 <- ghost count. Moving to -: mirrored.
  const int to = even ? (towards > 0 ? -1 : count) : (towards > 0 ? 0 : count - 1);
  const int from = even ? (towards > 0 ? count - 1 : 0) : (towards > 0 ? count : -1);
  // Ghosts of axes before this one take part, so that edges and corners come round in several copies.
  const int u = axis == 0 ? 1 : 0;
  const int v = axis == 2 ? 1 : 2;
  const int beyond_u = axis > u ? 1 : 0;
  const int beyond_v = axis > v ? 1 : 0;
  const int first_v = -beyond_v;
  const int last_v = counts[static_cast<std::size_t>(v)] - 1 + beyond_v;
  const int first_u = -beyond_u;
  const int last_u = counts[static_cast<std::size_t>(u)] - 1 + beyond_u;
  const int across = last_u - first_u + 1;
  const int total = across * (last_v - first_v + 1);
  for (int i = 1; i < lattice.count; ++i) {
    if (lattice.velocity[i][static_cast<std::size_t>(axis)] != towards) continue;
    const int plane = even ? lattice.opposite[i] : i;
#pragma omp for schedule(static) nowait
    for (int k = 0; k < total; ++k) {
      std::array<int, 3> node{};
      node[static_cast<std::size_t>(u)] = first_u + k % across;
      node[static_cast<std::size_t>(v)] = first_v + k / across;
      node[static_cast<std::size_t>(axis)] = to;
      const std::ptrdiff_t target = p.slot(plane, p.node(node[0], node[1], node[2]));
      node[static_cast<std::size_t>(axis)] = from;
      p[target] = p[p.slot(plane, p.node(node[0], node[1], node[2]))];
    }
  }
}

// Whether a later wall takes the population that leaves `node` along `c`.
bool belongs_to_later_wall(const Sides& sides, const std::array<int, 3>& counts, int side,
                           const std::array<int, 3>& node, const std::array<int, 3>& c, int dimension) {
  for (int later = side / 2 * 2 + 2; later < side_count(dimension); ++later) {
    const auto axis = static_cast<std::size_t>(later / 2);
    const int outward = later % 2 == 0 ? -1 : 1;
    if (c[axis] == outward && sides[static_cast<std::size_t>(later)].kind == SideKind::wall &&
        node[axis] == (outward < 0 ? 0 : counts[axis] - 1)) {
      return true;
    }
  }
  return false;
}

// A component of the wall's velocity where `c` hits the side `name` at its rim. Where it hits a second wall
// at the same time, as in a corner, each wall gives the component along its own normal: a lid that slides
// along the top must not push fluid through the corner, which would make its flow first order.
double velocity_at_rim(const Sides& sides, int name, const std::array<int, 3>& node,
                       const std::array<int, 3>& c, int axis, const std::array<int, 3>& counts) {
  const auto a = static_cast<std::size_t>(axis);
  const int facing = 2 * axis + (c[a] > 0 ? 1 : 0);
  const bool hits = sides[static_cast<std::size_t>(facing)].kind == SideKind::wall &&
                    node[a] == (c[a] > 0 ? counts[a] - 1 : 0);
  const int wall = hits ? facing : name;
  const Side& side = sides[static_cast<std::size_t>(wall)];
  if (side.velocity_x.empty()) return 0;
  const SideFrame frame(wall, counts);
  const int k =
      node[static_cast<std::size_t>(frame.u)] + frame.along_u() * node[static_cast<std::size_t>(frame.v)];
  const std::size_t hit = frame.wall_point(k, c);
  if (axis == 2) return side.velocity_z.empty() ? 0.0 : side.velocity_z[hit];
  return axis == 0 ? side.velocity_x[hit] : side.velocity_y[hit];
}

void reflect_at_wall(Populations& p, Parity parity, const Sides& sides, int name) {
  const Side& side = sides[static_cast<std::size_t>(name)];
  const LatticeTable& lattice = p.lattice();
  const SideFrame frame(name, {p.nx(), p.ny(), p.nz() > 0 ? p.nz() : 1});
  const auto normal = static_cast<std::size_t>(frame.axis);
  const bool moving = !side.velocity_x.empty();
  // Nodes of a side lie in rows of equal distances.
  const auto place = [&](int k) {
    const std::array<int, 3> at = frame.node(k);
    return p.node(at[0], at[1], at[2]);
  };
  const std::ptrdiff_t origin = place(0);
  const std::ptrdiff_t along = frame.along_u() > 1 ? place(1) - origin : 0;
  const std::ptrdiff_t up = frame.along_v() > 1 ? place(frame.along_u()) - origin : 0;
  for (int i = 1; i < lattice.count; ++i) {
    const auto& c = lattice.velocity[i];
    if (c[normal] != frame.outward) continue;
    const int o = lattice.opposite[i];
#pragma omp for schedule(static) nowait
    for (int k = 0; k < frame.size(); ++k) {
      const int row = frame.row(k);
      const std::ptrdiff_t node = origin + row * up + (k - row * frame.along_u()) * along;
      double value = p[p.post_collision(parity, i, node)];
      if (frame.on_rim(k, lattice.dimension)) {
        const std::array<int, 3> at = frame.node(k);
        if (belongs_to_later_wall(sides, frame.counts, name, at, c, lattice.dimension)) continue;
        double along_wall = 0;
        for (int axis = 0; axis < lattice.dimension; ++axis) {
          const auto a = static_cast<std::size_t>(axis);
          if (c[a] != 0) along_wall += c[a] * velocity_at_rim(sides, name, at, c, axis, frame.counts);
        }
        value -= 6.0 * lattice.weight[i] * along_wall;
      } else if (moving) {
        const std::size_t hit = frame.wall_point(k, c);
        double along_wall = c[0] * side.velocity_x[hit] + c[1] * side.velocity_y[hit];
        if (!side.velocity_z.empty()) along_wall += c[2] * side.velocity_z[hit];
        value -= 6.0 * lattice.weight[i] * along_wall;
      }
      p[p.incoming(parity, o, node)] = value;
    }
  }
}

}  // namespace

void exchange_and_reflect(Populations& populations, Parity parity, const Sides& sides) {
  const int dimension = populations.lattice().dimension;
  // Into ghosts x comes first, out of ghosts last: corners then pass through the ghosts of the right row.
  for (int n = 0; n < dimension; ++n) {
    const int axis = parity == Parity::even ? n : dimension - 1 - n;
    if (sides[static_cast<std::size_t>(2 * axis)].kind != SideKind::periodic) continue;
    copy_across(populations, parity, axis, 1);
    copy_across(populations, parity, axis, -1);
#pragma omp barrier
  }
  bool walls = false;
  for (int name = 0; name < side_count(dimension); ++name) {
    if (sides[static_cast<std::size_t>(name)].kind != SideKind::wall) continue;
    reflect_at_wall(populations, parity, sides, name);
    walls = true;
  }
  if (walls) {
#pragma omp barrier
  }
}

}  // namespace estuary::fluid
