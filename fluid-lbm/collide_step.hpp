// The one text of the step, for every lattice and option. Included by the files that compile variants of it.
#pragma once

#include <algorithm>

#include "blocks.hpp"
#include "collision_operators.hpp"
#include "row_shares.hpp"

namespace estuary::fluid::step {

// Which nodes of a vector are read and written: all of them,
struct AllLanes {
  template <class Real>
  [[gnu::always_inline]] typename Lanes<Real>::Vector read(const Real* from) const {
    return load(from);
  }
  template <class Real>
  [[gnu::always_inline]] void write(Real* to, const typename Lanes<Real>::Vector& value) const {
    store(to, value);
  }
};

// or those whose bit is set.
struct SomeLanes {
  unsigned bits;
  template <class Real>
  [[gnu::always_inline]] typename Lanes<Real>::Vector read(const Real* from) const {
    return load_lanes(from, bits);
  }
  template <class Real>
  [[gnu::always_inline]] void write(Real* to, const typename Lanes<Real>::Vector& value) const {
    store_lanes(to, bits, value);
  }
};

// Nodes of a run: populations read at `place[i] + x`.
template <class Lattice, class Real_, class Part>
struct InRun {
  using Real = Real_;
  const std::array<Real*, Lattice::count>& place;
  std::ptrdiff_t x;
  Part part;
  template <std::size_t i>
  [[gnu::always_inline]] typename Lanes<Real>::Vector read() const {
    return part.read(place[i] + x);
  }
  template <std::size_t i>
  [[gnu::always_inline]] void write(const typename Lanes<Real>::Vector& value) const {
    part.write(place[i] + x, value);
  }
};

// As many nodes as a vector has lanes. The value that leaves along i goes where the one that came along the
// opposite of i was read, after either kind of step.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Nodes>
[[gnu::always_inline]] inline void update(const Nodes& nodes, const CollisionParameters& parameters) {
  using Real = typename Nodes::Real;
  using Value = typename Lanes<Real>::Vector;
  std::array<Value, Lattice::count> f;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    f[i] = nodes.template read<i>();
  });
  MomentsOf<Value> m = moments_of<Lattice>(f);
  const Value inverse = Equilibrium::inverse_density(m.excess);
  Vector<Value> force;
  if constexpr (Force::any) {
    const Value density = Equilibrium::density(m.excess);
    force = {density * static_cast<Real>(parameters.acceleration[0]),
             density * static_cast<Real>(parameters.acceleration[1]),
             density * static_cast<Real>(parameters.acceleration[2])};
    if constexpr (Force::second_order) {
      m.momentum_x += Real(0.5) * force.x;
      m.momentum_y += Real(0.5) * force.y;
      m.momentum_z += Real(0.5) * force.z;
    }
  }
  if constexpr (Viscosity::varies) {
    Collision::template relax<Lattice, Force>(
        f, m, force, inverse, local_rates<Lattice, Viscosity>(f, m, force, inverse, parameters));
  } else {
    Collision::template relax<Lattice, Force>(
        f, m, force, inverse,
        RatesOf<Real>{static_cast<Real>(parameters.rates.even), static_cast<Real>(parameters.rates.odd)});
  }
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    nodes.template write<static_cast<std::size_t>(Lattice::opposite[i])>(f[i]);
  });
}

// Where the values that reach the nodes of a run are read, and put back: these places are all that
// distinguishes the two kinds of step.
template <class Lattice, class Real>
class ReadingPlaces {
public:
  using Pointers = std::array<Real*, Lattice::count>;
  ReadingPlaces(Populations& populations, Parity parity) {
    const bool even = parity == Parity::even;
    for (int i = 0; i < Lattice::count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const int plane = even ? Lattice::opposite[k] : i;
      plane_[k] = populations.data<Real>() + plane * populations.plane();
      step_[k] = even ? populations.step(i) : 0;
    }
  }
  /// Of a row's node 0.
  [[gnu::always_inline]] Pointers of(std::ptrdiff_t node) const {
    Pointers place;
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(index());
      place[i] = plane_[i] + (node - step_[i]);
    });
    return place;
  }

private:
  Pointers plane_;
  std::array<std::ptrdiff_t, Lattice::count> step_;
};

// The start of each population.
template <class Lattice, class Real>
using Planes = std::array<Real*, Lattice::count>;

// Reading places of an open block after an even step.
template <class Lattice, class Real>
[[gnu::always_inline]] inline Planes<Lattice, Real> open_block(const Planes<Lattice, Real>& planes,
                                                               const std::int32_t* rows) {
  Planes<Lattice, Real> place;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    constexpr auto c = Lattice::velocity[i];
    constexpr int row = Lattice::dimension == 3 ? 3 * (1 - c[2]) + 1 - c[1] : 1 - c[1];
    place[i] = planes[static_cast<std::size_t>(Lattice::opposite[i])] + (rows[row] - c[0]);
  });
  return place;
}

// Nodes of any other block, from one of its lanes on: what comes from a node is read there, what comes from a
// wall at the node itself.
template <class Lattice, class Real_>
struct BesideWalls {
  using Real = Real_;
  const Planes<Lattice, Real>& planes;
  const std::int32_t* place;
  const Blocks::Senders* senders;
  int lane;

  template <std::size_t i>
  [[gnu::always_inline]] SpreadLanes lanes() const {
    return {senders[i].nodes, senders[i].first, senders[i].walls};
  }
  template <std::size_t i>
  [[gnu::always_inline]] Real* sent() const {
    return planes[static_cast<std::size_t>(Lattice::opposite[i])] + place[i];
  }
  template <std::size_t i>
  [[gnu::always_inline]] typename Lanes<Real>::Vector read() const {
    return load_spread(sent<i>(), planes[i] + place[0], lanes<i>(), lane);
  }
  template <std::size_t i>
  [[gnu::always_inline]] void write(const typename Lanes<Real>::Vector& value) const {
    store_spread(sent<i>(), planes[i] + place[0], lanes<i>(), lane, value);
  }
};

// The parameters are copied: what is stored could else be one of them, and they would be read for each
// vector.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
[[gnu::noinline]] void pass_over_rows(Populations& populations, Parity parity, const FluidNodes& nodes,
                                      const CollisionParameters& parameters) {
  constexpr int lanes = Lanes<Real>::count;
  const CollisionParameters own = parameters;
  const ReadingPlaces<Lattice, Real> places(populations, parity);
  const RowShare share = row_share(populations.first_row(), populations.past_row());
  for (int row = share.begin; row < share.end; ++row) {
    const auto place = places.of(populations.row_start(row));
    for (const Span span : nodes.rows[static_cast<std::size_t>(row)]) {
      int x = span.begin;
      for (; x + lanes <= span.end; x += lanes)
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(
            InRun<Lattice, Real, AllLanes>{place, x, {}}, own);
      if (x == span.end) continue;
      const SomeLanes left{(1U << (span.end - x)) - 1U};
      update<Lattice, Collision, Equilibrium, Force, Viscosity>(
          InRun<Lattice, Real, SomeLanes>{place, x, left}, own);
    }
  }
}

// After an odd step, in which every population came to its node.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
[[gnu::noinline]] void pass_over_stretches(const Planes<Lattice, Real>& planes, const Blocks& blocks,
                                           const CollisionParameters& parameters) {
  constexpr int lanes = Lanes<Real>::count;
  constexpr unsigned all = (1U << lanes) - 1U;
  const CollisionParameters own = parameters;
  const RowShare share = row_share(static_cast<int>(blocks.group_count()));
  for (auto group = static_cast<std::size_t>(share.begin); group < static_cast<std::size_t>(share.end);
       ++group) {
    for (std::size_t n = blocks.before(group).stretches_end; n < blocks.group(group).stretches_end; ++n) {
      const Blocks::Stretch stretch = blocks.stretch(n);
      const auto some = [&](int x, unsigned bits) __attribute__((always_inline)) {
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(
            InRun<Lattice, Real, SomeLanes>{planes, x, {bits}}, own);
      };
      // From one whole vector of memory to the next.
      const int last = stretch.end / lanes * lanes;
      const unsigned after = (1U << (stretch.end - last)) - 1U;
      int x = stretch.begin / lanes * lanes;
      if (const int before = stretch.begin - x; before > 0) {
        const unsigned bits = all << before & all;
        some(x, x == last ? bits & after : bits);
        if (x == last) continue;
        x += lanes;
      }
      for (; x < last; x += lanes)
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(
            InRun<Lattice, Real, AllLanes>{planes, x, {}}, own);
      if (after != 0) some(last, after);
    }
  }
}

template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
[[gnu::noinline]] void pass_over_blocks(const Planes<Lattice, Real>& planes, const Blocks& blocks,
                                        const CollisionParameters& parameters) {
  constexpr int lanes = Lanes<Real>::count;
  static_assert(Blocks::lanes % lanes == 0);
  // What comes after short runs the processor does not foresee. In the plane as many as a group has, 18 kB:
  // from memory 1.2 to 1.5 times as fast as with twelve. In space the distance changes nothing that is
  // measured.
  constexpr std::size_t blocks_ahead = 288 / Lattice::count;
  const CollisionParameters own = parameters;
  const std::size_t last_open = blocks.open_count() - 1;
  const std::size_t last_walled = blocks.walled_count() - 1;
  const RowShare share = row_share(static_cast<int>(blocks.group_count()));
  for (auto group = static_cast<std::size_t>(share.begin); group < static_cast<std::size_t>(share.end);
       ++group) {
    for (std::size_t n = blocks.before(group).open_end; n < blocks.group(group).open_end; ++n) {
      const auto ahead = open_block<Lattice>(planes, blocks.open(std::min(n + blocks_ahead, last_open)));
      unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
        __builtin_prefetch(ahead[static_cast<std::size_t>(index())], 1);
      });
      const auto place = open_block<Lattice>(planes, blocks.open(n));
      for (int lane = 0; lane < Blocks::lanes; lane += lanes)
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(
            InRun<Lattice, Real, AllLanes>{place, lane, {}}, own);
    }
    for (std::size_t n = blocks.before(group).walled_end; n < blocks.group(group).walled_end; ++n) {
      const std::int32_t* const ahead = blocks.walled(std::min(n + blocks_ahead, last_walled));
      unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
        constexpr auto i = static_cast<std::size_t>(index());
        __builtin_prefetch(planes[static_cast<std::size_t>(Lattice::opposite[i])] + ahead[i], 1);
      });
      for (int lane = 0; lane < Blocks::lanes; lane += lanes)
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(
            BesideWalls<Lattice, Real>{planes, blocks.walled(n), blocks.senders(n), lane}, own);
    }
  }
}

template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
void pass(Populations& populations, Parity parity, const FluidNodes& nodes,
          const CollisionParameters& parameters) {
  if (nodes.blocks != nullptr) {
    Planes<Lattice, Real> planes;
    for (std::size_t i = 0; i < planes.size(); ++i)
      planes[i] = populations.data<Real>() + static_cast<std::ptrdiff_t>(i) * populations.plane();
    if (parity == Parity::odd) {
      pass_over_stretches<Lattice, Collision, Equilibrium, Force, Viscosity>(planes, *nodes.blocks,
                                                                             parameters);
    } else {
      pass_over_blocks<Lattice, Collision, Equilibrium, Force, Viscosity>(planes, *nodes.blocks, parameters);
    }
  } else {
    pass_over_rows<Lattice, Collision, Equilibrium, Force, Viscosity, Real>(populations, parity, nodes,
                                                                            parameters);
  }
#pragma omp barrier
}

/// The variant of one lattice, or null.
template <class Lattice, class Viscosity, class Force, class Stored = double>
CollideAndStream variant(const StepChoice& choice) {
  const bool compressible = choice.equilibrium == EquilibriumModel::compressible;
  switch (choice.collision) {
    case CollisionModel::trt:
      return compressible ? &pass<Lattice, Trt, Compressible, Force, Viscosity, Stored>
                          : &pass<Lattice, Trt, Incompressible, Force, Viscosity, Stored>;
    case CollisionModel::bgk:
      return compressible ? &pass<Lattice, Bgk, Compressible, Force, Viscosity, Stored>
                          : &pass<Lattice, Bgk, Incompressible, Force, Viscosity, Stored>;
    case CollisionModel::recursive_regularised:
    case CollisionModel::central_moment:
      break;
  }
  if constexpr (!Force::any || Force::second_order) {
    if (!compressible) return nullptr;
    return choice.collision == CollisionModel::central_moment
               ? &pass<Lattice, CentralMoments<true>, Compressible, Force, Viscosity, Stored>
               : &pass<Lattice, CentralMoments<false>, Compressible, Force, Viscosity, Stored>;
  }
  return nullptr;
}

// Each in a file of its own.
CollideAndStream plane_without_force(const StepChoice& choice);
CollideAndStream plane_with_force(const StepChoice& choice);
CollideAndStream plane_with_varying_viscosity(const StepChoice& choice);
CollideAndStream space_without_force(const StepChoice& choice);
CollideAndStream space_with_force(const StepChoice& choice);
CollideAndStream space_with_varying_viscosity(const StepChoice& choice);
CollideAndStream in_single_precision(const StepChoice& choice);

}  // namespace estuary::fluid::step
