// Completion of the nodes that lie on open sides.
#include <algorithm>
#include <cmath>

#include "side_frame.hpp"
#include "sides.hpp"

namespace estuary::fluid {
namespace {

template <class Lattice>
using Values = std::array<double, Lattice::count>;

// Places of a node's populations, counted from the node: the same for all nodes unless memory is packed.
template <class Lattice>
struct Places {
  Places() = default;
  Places(const Populations& p, Parity parity, std::ptrdiff_t node) {
    // Neighbours in a row are neighbours in memory, which is kept for all nodes near open sides.
    std::array<std::ptrdiff_t, 9> row;
    constexpr int beside = Lattice::dimension == 3 ? 1 : 0;
    const auto number = [](int y, int z) {
      const int entry = 3 * (z + beside) + y + 1;
      return static_cast<std::size_t>(entry);
    };
    for (int z = -beside; z <= beside; ++z) {
      for (int y = -1; y <= 1; ++y) row[number(y, z)] = p.place(node + z * p.layer() + y * p.pitch()) - node;
    }
    const auto slot = [&](int plane, int x, int y, int z) {
      return plane * p.plane() + row[number(y, z)] + x;
    };
    for (std::size_t i = 0; i < Lattice::count; ++i) {
      const auto& c = Lattice::velocity[i];
      const int own = static_cast<int>(i);
      const int opposite = Lattice::opposite[i];
      const bool even = parity == Parity::even;
      incoming[i] = even ? slot(opposite, -c[0], -c[1], -c[2]) : slot(own, 0, 0, 0);
      leaving[i] = even ? slot(opposite, 0, 0, 0) : slot(own, c[0], c[1], c[2]);
    }
  }
  std::array<std::ptrdiff_t, Lattice::count> incoming;
  std::array<std::ptrdiff_t, Lattice::count> leaving;
};

// The places of one node; `own` has room for them.
template <class Lattice>
const Places<Lattice>& places_of(const Populations& p, Parity parity, std::ptrdiff_t node,
                                 const Places<Lattice>& usual, Places<Lattice>& own) {
  if (!p.packed()) return usual;
  own = Places<Lattice>(p, parity, node);
  return own;
}

template <class Lattice>
Values<Lattice> read(const Populations& p, const std::array<std::ptrdiff_t, Lattice::count>& places,
                     std::ptrdiff_t node) {
  Values<Lattice> f;
  for (std::size_t i = 0; i < Lattice::count; ++i) f[i] = p[places[i] + node];
  return f;
}

double component(const Moments& m, int axis) {
  return axis == 0 ? m.momentum_x : (axis == 1 ? m.momentum_y : m.momentum_z);
}

struct Context {
  const Side& side;
  bool compressible;
  const std::array<double, 3>& acceleration;
  bool meets_others = false;  // a second open side, in a corner or an edge
};

double inverse_of(const Context& context, double excess) {
  return context.compressible ? Compressible::inverse_density(excess) : 1.0;
}

// Equilibrium with the moments given and the non-equilibrium part of the neighbour's populations.
template <class Lattice>
void impose(Populations& p, const Places<Lattice>& places, std::ptrdiff_t node, const Moments& wanted,
            const Values<Lattice>& f, const Moments& m, const Context& context) {
  const double inverse = inverse_of(context, m.excess);
  const double wanted_inverse = inverse_of(context, wanted.excess);
  unrolled<Lattice::count>([&](auto index) {
    constexpr auto i = static_cast<std::size_t>(index());
    p[places.incoming[i] + node] = equilibrium<Lattice>(index(), wanted, wanted_inverse) + f[i] -
                                   equilibrium<Lattice>(index(), m, inverse);
  });
}

// The neighbour's velocity across the side and none along it, at another density.
Moments with_velocity_of(const Moments& m, double excess, int axis, const Context& context) {
  const double density = context.compressible ? 1 + excess : 1.0;
  const double momentum = density * inverse_of(context, m.excess) * component(m, axis);
  return {excess, axis == 0 ? momentum : 0.0, axis == 1 ? momentum : 0.0, axis == 2 ? momentum : 0.0};
}

// Density and velocity one step on, from the waves that leave and the one that the wanted pressure sends in.
// Read from what left the node and its inner neighbour at the last step.
template <class Lattice>
Moments let_out(const Values<Lattice>& f, const Values<Lattice>& f_inner, double excess,
                const SideFrame& frame, const Context& context) {
  const Moments here = moments_of<Lattice>(f);
  const Moments there = moments_of<Lattice>(f_inner);
  const double inverse = inverse_of(context, here.excess);
  const double density = 1 / inverse;
  const double there_inverse = inverse_of(context, there.excess);
  constexpr double sound = 0.57735026918962576;
  // Everything along the outward normal.
  const double velocity = frame.outward * component(here, frame.axis) * inverse;
  const double velocity_change = velocity - frame.outward * component(there, frame.axis) * there_inverse;
  const double pressure_change = Lattice::sound_speed_squared * (here.excess - there.excess);
  const double leaving = (velocity + sound) * (pressure_change + density * sound * velocity_change);
  const double entering = context.side.relaxation * Lattice::sound_speed_squared * (here.excess - excess);
  const double next_excess = here.excess - 0.5 * (leaving + entering) / Lattice::sound_speed_squared;
  const double next_velocity = velocity - 0.5 * (leaving - entering) / (density * sound);
  const double scale = context.compressible ? 1 + next_excess : 1.0;
  std::array<double, 3> next{};
  for (int axis = 0; axis < Lattice::dimension; ++axis) {
    if (axis == frame.axis) {
      next[static_cast<std::size_t>(axis)] = scale * frame.outward * next_velocity;
      continue;
    }
    // Carried out by the flow; nothing is known of what would come in.
    const double own = component(here, axis) * inverse;
    const double change = own - component(there, axis) * there_inverse;
    next[static_cast<std::size_t>(axis)] = scale * (own - std::max(velocity, 0.0) * change);
  }
  return {next_excess, next[0], next[1], next[2]};
}

// All populations from the moments and the stress of the known ones and of the unknown ones bounced back.
template <class Lattice>
void regularise(Populations& p, const Places<Lattice>& places, std::ptrdiff_t node, const Moments& m,
                double inverse) {
  std::array<double, 6> stress{};
  Values<Lattice> difference;
  for (int i = 0; i < Lattice::count; ++i) {
    difference[static_cast<std::size_t>(i)] =
        p[places.incoming[static_cast<std::size_t>(i)] + node] - equilibrium<Lattice>(i, m, inverse);
  }
  constexpr std::array<std::array<std::size_t, 2>, 6> pairs{{{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};
  for (std::size_t i = 1; i < Lattice::count; ++i) {
    const auto& c = Lattice::velocity[i];
    for (std::size_t k = 0; k < 6; ++k) stress[k] += c[pairs[k][0]] * c[pairs[k][1]] * difference[i];
  }
  for (std::size_t i = 0; i < Lattice::count; ++i) {
    const auto& c = Lattice::velocity[i];
    double sum = 0;
    for (std::size_t k = 0; k < 6; ++k) {
      const bool diagonal = k < 3;
      if (diagonal && k >= Lattice::dimension) continue;
      const double hermite = c[pairs[k][0]] * c[pairs[k][1]] - (diagonal ? 1.0 / 3.0 : 0.0);
      sum += (diagonal ? 1.0 : 2.0) * hermite * stress[k];
    }
    p[places.incoming[i] + node] =
        equilibrium<Lattice>(static_cast<int>(i), m, inverse) + 4.5 * Lattice::weight[i] * sum;
  }
}

// Which side, as a compile-time constant: every step passes here, and in a small channel this is what costs.
template <int normal_axis, int outward_sign>
struct Facing {
  static constexpr std::size_t axis = normal_axis;
  static constexpr int outward = outward_sign;
};

template <class Lattice, class Chosen>
void complete_node(Populations& p, const Places<Lattice>& places, std::ptrdiff_t node, std::size_t entry,
                   const Context& context) {
  constexpr std::size_t normal = Chosen::axis;
  constexpr int outward = Chosen::outward;
  const Side& side = context.side;
  const auto f = read<Lattice>(p, places.incoming, node);
  double known = 0;
  double leaving = 0;
  std::array<double, 3> in_plane{};  // momentum along the side of what moves along it
  unrolled<Lattice::count>([&](auto index) {
    constexpr auto i = static_cast<std::size_t>(index());
    constexpr auto c = Lattice::velocity[i];
    if constexpr (c[normal] == 0) {
      known += f[i];
      for (std::size_t axis = 0; axis < 3; ++axis) in_plane[axis] += c[axis] * f[i];
    } else if constexpr (c[normal] == outward) {
      leaving += f[i];
    }
  });
  std::array<double, 3> momentum{};  // wanted sum of c_i f_i
  double excess = 0;
  if (side.kind == SideKind::pressure || side.kind == SideKind::outflow) {
    excess = side.excess[entry];
    momentum[normal] = -outward * (excess - known - 2 * leaving);
  } else {
    const std::array<double, 3> velocity{side.velocity_x[entry], side.velocity_y[entry],
                                         side.velocity_z.empty() ? 0.0 : side.velocity_z[entry]};
    // The velocity holds half the body force, the populations do not.
    const double half_force = 0.5 * context.acceleration[normal];
    const double inward = -outward * (velocity[normal] - half_force);
    const double density = context.compressible ? (1 + known + 2 * leaving) / (1 - inward) : 1.0;
    for (std::size_t axis = 0; axis < 3; ++axis)
      momentum[axis] = density * (velocity[axis] - 0.5 * context.acceleration[axis]);
    excess = known + 2 * leaving + density * inward;
  }
  unrolled<Lattice::count>([&](auto index) {
    constexpr auto i = static_cast<std::size_t>(index());
    constexpr auto c = Lattice::velocity[i];
    if constexpr (c[normal] == -outward) {
      double value = f[static_cast<std::size_t>(Lattice::opposite[i])] +
                     6.0 * Lattice::weight[i] * along<Lattice, i>(momentum[0], momentum[1], momentum[2]);
      for (std::size_t axis = 0; axis < 3; ++axis) {
        if (axis == normal || c[axis] == 0) continue;
        value -= c[axis] * (0.5 * in_plane[axis] - momentum[axis] / 3.0);
      }
      p[places.incoming[i] + node] = value;
    }
  });
  if (side.kind == SideKind::regularised_velocity) {
    regularise<Lattice>(p, places, node, {excess, momentum[0], momentum[1], momentum[2]},
                        inverse_of(context, excess));
  }
}

// The open sides that a node lies on, in the order left to front.
struct SidesAt {
  SidesAt(const Sides& sides, const std::array<int, 3>& counts, int dimension, const std::array<int, 3>& at) {
    for (int name = 0; name < side_count(dimension); ++name) {
      const auto axis = static_cast<std::size_t>(name / 2);
      if (at[axis] != (name % 2 == 0 ? 0 : counts[axis] - 1)) continue;
      if (is_open(sides[static_cast<std::size_t>(name)].kind))
        names[static_cast<std::size_t>(count++)] = name;
    }
  }
  std::array<int, 3> names{};
  int count = 0;
};

// A corner or an edge of several open sides. Too few populations are known there for the sides' own rules, so
// the node takes the non-equilibrium part of the neighbour that is inner to all its sides, as the rule of
// Guo, Zheng, Shi does for one, with the mean of the velocities that velocity sides give and the pressure of
// the first pressure side; what none gives is the neighbour's.
template <class Lattice>
void complete_corner(Populations& p, Parity parity, const Places<Lattice>& usual, const Cells& cells,
                     const Sides& sides, const std::array<int, 3>& counts, const std::array<int, 3>& at,
                     const SidesAt& here, const Context& context) {
  std::array<int, 3> inner = at;
  std::array<double, 3> velocity{};
  int velocities = 0;
  const double* excess = nullptr;
  for (int n = 0; n < here.count; ++n) {
    const int name = here.names[static_cast<std::size_t>(n)];
    const SideFrame frame(name, counts);
    inner = frame.inner(inner);
    const Side& side = sides[static_cast<std::size_t>(name)];
    const auto entry = static_cast<std::size_t>(frame.number(at));
    if (side.kind == SideKind::outflow) continue;
    if (side.kind == SideKind::pressure) {
      if (excess == nullptr) excess = &side.excess[entry];
      continue;
    }
    ++velocities;
    velocity[0] += side.velocity_x[entry];
    velocity[1] += side.velocity_y[entry];
    if (!side.velocity_z.empty()) velocity[2] += side.velocity_z[entry];
  }
  // Where an obstacle covers that neighbour, one that is inner to one of two sides only.
  for (int n = 0; n < here.count && here.count == 2 && !cells.fluid(inner[0], inner[1], inner[2]); ++n)
    inner = SideFrame(here.names[static_cast<std::size_t>(n)], counts).inner(at);
  if (!cells.fluid(inner[0], inner[1], inner[2])) inner = at;
  const std::ptrdiff_t node = p.node(at[0], at[1], at[2]);
  const std::ptrdiff_t there = p.node(inner[0], inner[1], inner[2]);
  Places<Lattice> own;
  const auto f = read<Lattice>(p, places_of(p, parity, there, usual, own).incoming, there);
  const Moments m = moments_of<Lattice>(f);
  Moments wanted = m;
  if (excess != nullptr) wanted.excess = *excess;
  const double density = context.compressible ? 1 + wanted.excess : 1.0;
  const double scale = density * inverse_of(context, m.excess);
  const std::array<double, 3> known{scale * m.momentum_x, scale * m.momentum_y, scale * m.momentum_z};
  const auto momentum = [&](std::size_t axis) {
    if (velocities == 0) return known[axis];
    return density * (velocity[axis] / velocities - 0.5 * context.acceleration[axis]);
  };
  wanted.momentum_x = momentum(0);
  wanted.momentum_y = momentum(1);
  if (Lattice::dimension == 3) wanted.momentum_z = momentum(2);
  Places<Lattice> own_here;
  impose<Lattice>(p, places_of(p, parity, node, usual, own_here), node, wanted, f, m, context);
}

// Nodes of a side exchange populations with each other and with the same inner nodes, so that all are looked
// at before any is changed, on this side or another.
template <class Lattice>
void let_all_out(Populations& p, Parity parity, const Cells& cells, int name, Side& side,
                 const Context& context) {
  const SideFrame frame(name, {p.nx(), p.ny(), p.nz() > 0 ? p.nz() : 1});
  const Places<Lattice> usual(p, parity, p.node(0, 0, 0));
#pragma omp single
  side.next.resize(static_cast<std::size_t>(frame.size()));
  const OwnNodes own_nodes(p, frame);
#pragma omp for schedule(static)
  for (int k = own_nodes.first(); k < own_nodes.past(); ++k) {
    const std::array<int, 3> at = frame.node(k);
    const std::array<int, 3> inner = frame.inner(at);
    if (!cells.fluid(at[0], at[1], at[2]) || !cells.fluid(inner[0], inner[1], inner[2])) continue;
    const auto entry = static_cast<std::size_t>(k);
    const std::ptrdiff_t here = p.node(at[0], at[1], at[2]);
    const std::ptrdiff_t there = p.node(inner[0], inner[1], inner[2]);
    const auto leaving = [&](std::ptrdiff_t node) {
      Places<Lattice> own;
      return read<Lattice>(p, places_of(p, parity, node, usual, own).leaving, node);
    };
    side.next[entry] = let_out<Lattice>(leaving(here), leaving(there), side.excess[entry], frame, context);
  }
}

template <class Lattice, class Chosen>
void complete(Populations& p, Parity parity, const Cells& cells, int name, Sides& sides,
              const Context& context) {
  Side& side = sides[static_cast<std::size_t>(name)];
  const SideFrame frame(name, {p.nx(), p.ny(), p.nz() > 0 ? p.nz() : 1});
  const Places<Lattice> usual(p, parity, p.node(0, 0, 0));
  const bool from_inside = side.kind == SideKind::pressure || side.kind == SideKind::outflow;
  const OwnNodes own_nodes(p, frame);
#pragma omp for schedule(static) nowait
  for (int k = own_nodes.first(); k < own_nodes.past(); ++k) {
    const std::array<int, 3> at = frame.node(k);
    if (!cells.fluid(at[0], at[1], at[2])) continue;
    if (context.meets_others && frame.on_rim(k, Lattice::dimension) &&
        SidesAt(sides, frame.counts, Lattice::dimension, at).count > 1) {
      continue;
    }
    const std::ptrdiff_t node = p.node(at[0], at[1], at[2]);
    const std::array<int, 3> inner = frame.inner(at);
    const auto entry = static_cast<std::size_t>(k);
    Places<Lattice> own;
    const Places<Lattice>& places = places_of(p, parity, node, usual, own);
    if (from_inside && cells.fluid(inner[0], inner[1], inner[2])) {
      const std::ptrdiff_t there = p.node(inner[0], inner[1], inner[2]);
      Places<Lattice> own_there;
      const auto f = read<Lattice>(p, places_of(p, parity, there, usual, own_there).incoming, there);
      const Moments m = moments_of<Lattice>(f);
      const Moments wanted = side.kind == SideKind::outflow
                                 ? side.next[entry]
                                 : with_velocity_of(m, side.excess[entry], frame.axis, context);
      impose<Lattice>(p, places, node, wanted, f, m, context);
    } else {
      complete_node<Lattice, Chosen>(p, places, node, entry, context);
    }
  }
}

// After the sides, whose nodes may be the inner neighbours. Each node once: at the first of its sides.
template <class Lattice>
void complete_corners(Populations& p, Parity parity, const Cells& cells, const Sides& sides,
                      const Context& context) {
  const Places<Lattice> usual(p, parity, p.node(0, 0, 0));
  for (int name = 0; name < side_count(Lattice::dimension); ++name) {
    if (!is_open(sides[static_cast<std::size_t>(name)].kind)) continue;
    const SideFrame frame(name, {p.nx(), p.ny(), p.nz() > 0 ? p.nz() : 1});
    const OwnNodes own_nodes(p, frame);
#pragma omp for schedule(static) nowait
    for (int k = own_nodes.first(); k < own_nodes.past(); ++k) {
      if (!frame.on_rim(k, Lattice::dimension)) continue;
      const std::array<int, 3> at = frame.node(k);
      if (!cells.fluid(at[0], at[1], at[2])) continue;
      const SidesAt here(sides, frame.counts, Lattice::dimension, at);
      if (here.count < 2 || here.names[0] != name) continue;
      complete_corner<Lattice>(p, parity, usual, cells, sides, frame.counts, at, here, context);
    }
  }
}

// Whether sides of different axes are open.
bool open_sides_meet(const Sides& sides, int dimension) {
  int axes = 0;
  for (std::size_t axis = 0; axis < static_cast<std::size_t>(dimension); ++axis)
    axes += is_open(sides[2 * axis].kind) || is_open(sides[2 * axis + 1].kind) ? 1 : 0;
  return axes > 1;
}

}  // namespace

void complete_open_sides(Populations& populations, Parity parity, const Cells& cells, Sides& sides,
                         EquilibriumModel equilibrium, const std::array<double, 3>& acceleration,
                         bool again) {
  const int dimension = populations.lattice().dimension;
  const bool compressible = equilibrium == EquilibriumModel::compressible;
  bool any = false;
  const bool meet = open_sides_meet(sides, dimension);
  for (int name = 0; name < side_count(dimension) && !again; ++name) {
    Side& side = sides[static_cast<std::size_t>(name)];
    if (side.kind != SideKind::outflow) continue;
    const Context context{side, compressible, acceleration, meet};
    if (dimension == 3) {
      let_all_out<D3Q19>(populations, parity, cells, name, side, context);
    } else {
      let_all_out<D2Q9>(populations, parity, cells, name, side, context);
    }
  }
  for (int name = 0; name < side_count(dimension); ++name) {
    Side& side = sides[static_cast<std::size_t>(name)];
    if (!is_open(side.kind) || (again && side.kind == SideKind::outflow)) continue;
    any = true;
    const Context context{side, compressible, acceleration, meet};
    const auto facing = [&](auto side_facing) {
      using Chosen = decltype(side_facing);
      if (dimension == 3) {
        complete<D3Q19, Chosen>(populations, parity, cells, name, sides, context);
      } else if constexpr (Chosen::axis < 2) {
        complete<D2Q9, Chosen>(populations, parity, cells, name, sides, context);
      }
    };
    switch (name) {
      case left:
        facing(Facing<0, -1>{});
        break;
      case right:
        facing(Facing<0, 1>{});
        break;
      case bottom:
        facing(Facing<1, -1>{});
        break;
      case top:
        facing(Facing<1, 1>{});
        break;
      case back:
        facing(Facing<2, -1>{});
        break;
      default:
        facing(Facing<2, 1>{});
        break;
    }
  }
  if (!any) return;
#pragma omp barrier
  if (!meet) return;
  const Context context{sides.front(), compressible, acceleration};
  if (dimension == 3) {
    complete_corners<D3Q19>(populations, parity, cells, sides, context);
  } else {
    complete_corners<D2Q9>(populations, parity, cells, sides, context);
  }
#pragma omp barrier
}

}  // namespace estuary::fluid
