#include "sides.hpp"

#include <algorithm>

#include "side_frame.hpp"

namespace estuary::fluid {
namespace {

// Nodes of a line that a thread copies at a time.
constexpr int line_piece = 128;

// Copies one line of values that lie in steps of `stride`.
template <class Stored>
void copy_line(Stored* to, const Stored* from, std::ptrdiff_t stride, int count) {
  if (stride == 1) {
#pragma omp simd
    for (int k = 0; k < count; ++k) to[k] = from[k];
    return;
  }
  for (int k = 0; k < count; ++k) to[k * stride] = from[k * stride];
}

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
  int first_v = -beyond_v;
  int last_v = counts[static_cast<std::size_t>(v)] - 1 + beyond_v;
  int first_u = -beyond_u;
  int last_u = counts[static_cast<std::size_t>(u)] - 1 + beyond_u;
  if (const OwnLayers own(p); own.part) {
    (own.axis == u ? first_u : first_v) = own.first;
    (own.axis == u ? last_u : last_v) = own.past - 1;
  }
  const int across = last_u - first_u + 1;
  const int lines = last_v - first_v + 1;
  const auto place = [&](int at, int at_u, int at_v) {
    std::array<int, 3> node{};
    node[static_cast<std::size_t>(axis)] = at;
    node[static_cast<std::size_t>(u)] = at_u;
    node[static_cast<std::size_t>(v)] = at_v;
    return p.node(node[0], node[1], node[2]);
  };
  // Lines along x are whole in memory; others have equal distances unless memory is packed.
  const bool regular = u == 0 || !p.packed();
  const std::ptrdiff_t along = place(0, 1, 0) - place(0, 0, 0);
  const int piece = lines > 1 ? across : line_piece;
  const int pieces = (across + piece - 1) / piece;
  for (int i = 1; i < lattice.count; ++i) {
    if (lattice.velocity[i][static_cast<std::size_t>(axis)] != towards) continue;
    const int plane = even ? lattice.opposite[i] : i;
#pragma omp for schedule(static) nowait
    for (int job = 0; job < lines * pieces; ++job) {
      const int line = first_v + job / pieces;
      const int begin = job % pieces * piece;
      const int begin_u = first_u + begin;
      const int length = std::min(piece, across - begin);
      p.visit([&](auto* const f) {
        if (regular) {
          copy_line(f + p.slot(plane, place(to, begin_u, line)),
                    f + p.slot(plane, place(from, begin_u, line)), along, length);
          return;
        }
        for (int k = begin_u; k < begin_u + length; ++k)
          f[p.slot(plane, place(to, k, line))] = f[p.slot(plane, place(from, k, line))];
      });
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

// What the two nodes, or lines of nodes, of a wall's rim get back, where another side begins.
void reflect_at_rim(Populations& p, Parity parity, const Sides& sides, const SideFrame& frame, int name,
                    int i, int k) {
  const LatticeTable& lattice = p.lattice();
  const auto& c = lattice.velocity[i];
  const std::array<int, 3> at = frame.node(k);
  if (belongs_to_later_wall(sides, frame.counts, name, at, c, lattice.dimension)) return;
  double along_wall = 0;
  for (int axis = 0; axis < lattice.dimension; ++axis) {
    const auto a = static_cast<std::size_t>(axis);
    if (c[a] != 0) along_wall += c[a] * velocity_at_rim(sides, name, at, c, axis, frame.counts);
  }
  const std::ptrdiff_t node = p.node(at[0], at[1], at[2]);
  p[p.incoming(parity, lattice.opposite[i], node)] =
      p[p.post_collision(parity, i, node)] - 6.0 * lattice.weight[i] * along_wall;
}

void reflect_at_wall(Populations& p, Parity parity, const Sides& sides, int name) {
  const Side& side = sides[static_cast<std::size_t>(name)];
  const LatticeTable& lattice = p.lattice();
  const SideFrame frame(name, {p.nx(), p.ny(), p.nz() > 0 ? p.nz() : 1});
  const auto normal = static_cast<std::size_t>(frame.axis);
  const bool moving = !side.velocity_x.empty();
  const bool plane = lattice.dimension == 2;
  const OwnNodes own(p, frame);
  if (own.empty()) return;
  // Nodes of a side lie in rows of equal distances.
  const auto place = [&](int k) {
    const std::array<int, 3> at = frame.node(k);
    return p.node(at[0], at[1], at[2]);
  };
  const std::ptrdiff_t along = frame.along_u() > 1 ? place(1) - place(0) : 0;
  const bool regular = frame.u == 0 || !p.packed();
  const int from_u = std::max(1, own.first_u);
  const int inner = std::max(std::min(frame.along_u() - 1, own.past_u) - from_u, 0);  // of a line
  // Lines are shared out in pieces, so that several threads have something to do in the plane.
  const int pieces = plane ? (inner + line_piece - 1) / line_piece : 1;
  const int first_line = plane ? 0 : std::max(1, own.first_v);
  const int lines = plane ? 1 : std::max(std::min(frame.along_v() - 1, own.past_v) - first_line, 0);
  for (int i = 1; i < lattice.count; ++i) {
    const auto& c = lattice.velocity[i];
    if (c[normal] != frame.outward) continue;
    const double weight = 6.0 * lattice.weight[i];
#pragma omp for schedule(static) nowait
    for (int job = 0; job < lines * pieces; ++job) {
      const int line = first_line + job / pieces;
      const int from = from_u + job % pieces * line_piece;
      const int count = plane ? std::min(line_piece, inner + from_u - from) : inner;
      const int first = line * frame.along_u() + from;
      const std::ptrdiff_t leaving = p.post_collision(parity, i, place(first));
      const std::ptrdiff_t back = p.incoming(parity, lattice.opposite[i], place(first));
      if (!moving && regular) {
        p.visit([&](auto* const f) { copy_line(f + back, f + leaving, along, count); });
        continue;
      }
      for (int k = 0; k < count; ++k) {
        double along_wall = 0;
        if (moving) {
          const std::size_t hit = frame.wall_point(first + k, c);
          along_wall = c[0] * side.velocity_x[hit] + c[1] * side.velocity_y[hit];
          if (!side.velocity_z.empty()) along_wall += c[2] * side.velocity_z[hit];
        }
        if (regular) {
          p[back + k * along] = p[leaving + k * along] - weight * along_wall;
          continue;
        }
        const std::ptrdiff_t node = place(first + k);
        p[p.incoming(parity, lattice.opposite[i], node)] =
            p[p.post_collision(parity, i, node)] - weight * along_wall;
      }
    }
#pragma omp for schedule(static) nowait
    for (int line = own.first_v; line < own.past_v; ++line) {
      const bool whole = !plane && (line == 0 || line == frame.along_v() - 1);
      const int step = whole ? 1 : std::max(frame.along_u() - 1, 1);
      for (int k = 0; k < frame.along_u(); k += step)
        if (k >= own.first_u && k < own.past_u)
          reflect_at_rim(p, parity, sides, frame, name, i, line * frame.along_u() + k);
    }
  }
}

}  // namespace

void exchange_and_reflect(Populations& populations, Parity parity, const Sides& sides,
                          const SlabExchange& slab) {
  const int dimension = populations.lattice().dimension;
  // Into ghosts x comes first, out of ghosts last: corners then pass through the ghosts of the right row.
  for (int n = 0; n < dimension; ++n) {
    const int axis = parity == Parity::even ? n : dimension - 1 - n;
    if (slab.halo != nullptr && axis == dimension - 1) {
#pragma omp master
      slab.halo->exchange(populations, parity, slab.everything);
#pragma omp barrier
      continue;
    }
    if (sides[2 * static_cast<std::size_t>(axis)].kind != SideKind::periodic) continue;
    copy_across(populations, parity, axis, 1);
    copy_across(populations, parity, axis, -1);
#pragma omp barrier
  }
  if (slab.halo != nullptr && slab.everything) {
#pragma omp master
    slab.halo->give_everything(populations);
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
