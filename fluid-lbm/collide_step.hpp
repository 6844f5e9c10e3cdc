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

// As many nodes as a vector has lanes, from x on, their values read at `place[i] + x`.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real,
          class Part>
[[gnu::always_inline]] inline void update(const std::array<Real*, Lattice::count>& place, std::ptrdiff_t x,
                                          const Part part, const CollisionParameters& parameters) {
  using Value = typename Lanes<Real>::Vector;
  std::array<Value, Lattice::count> f;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    f[i] = part.read(place[i] + x);
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
    part.write(place[static_cast<std::size_t>(Lattice::opposite[i])] + x, f[i]);
  });
}

// Where the values that reach the nodes of a run or a block are read, and put back: the value that leaves
// along i goes where the one that came along the opposite of i was read, after either kind of step, so that
// these places are all that distinguishes the two kinds.
template <class Lattice, class Real>
class ReadingPlaces {
public:
  using Pointers = std::array<Real*, Lattice::count>;
  ReadingPlaces(Populations& populations, Parity parity) : even_(parity == Parity::even) {
    for (int i = 0; i < Lattice::count; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const int plane = even_ ? Lattice::opposite[k] : i;
      plane_[k] =
          populations.data<Real>() + plane * populations.plane() - (even_ ? Lattice::velocity[k][0] : 0);
      step_[k] = even_ ? populations.step(i) - Lattice::velocity[k][0] : 0;
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
  /// Of a block's lane 0.
  [[gnu::always_inline]] Pointers of(const std::int32_t* rows) const {
    Pointers place;
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(index());
      constexpr auto c = Lattice::velocity[i];
      constexpr int sender = Lattice::dimension == 3 ? 3 * (1 - c[2]) + 1 - c[1] : 1 - c[1];
      place[i] = plane_[i] + (even_ ? rows[sender] : rows[own_row]);
    });
    return place;
  }

private:
  static constexpr std::size_t own_row = Lattice::dimension == 3 ? 4 : 1;
  bool even_;
  Pointers plane_;
  std::array<std::ptrdiff_t, Lattice::count> step_;
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
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(place, x, AllLanes{}, own);
      if (x == span.end) continue;
      const SomeLanes left{(1U << (span.end - x)) - 1U};
      update<Lattice, Collision, Equilibrium, Force, Viscosity>(place, x, left, own);
    }
  }
}

template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
[[gnu::noinline]] void pass_over_blocks(Populations& populations, Parity parity, const Blocks& blocks,
                                        const CollisionParameters& parameters) {
  constexpr int lanes = Lanes<Real>::count;
  static_assert(Blocks::lanes % lanes == 0);
  // Runs are too short for the processor to foresee what comes after them: without this half the speed from
  // memory.
  constexpr std::size_t blocks_ahead = 12;
  const CollisionParameters own = parameters;
  const ReadingPlaces<Lattice, Real> places(populations, parity);
  const std::size_t last = blocks.count() - 1;
  const auto fetch_ahead = [&](std::size_t n) __attribute__((always_inline)) {
    const auto place = places.of(blocks.places(std::min(n + blocks_ahead, last)));
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      __builtin_prefetch(place[static_cast<std::size_t>(index())], 1);
    });
  };
  Real* const f = populations.data<Real>();
  const StillLinks* const links = parity == Parity::even ? blocks.links() : nullptr;
  const RowShare share = row_share(static_cast<int>(blocks.groups().size()));
  for (int number = share.begin; number < share.end; ++number) {
    const Blocks::Group group = blocks.groups()[static_cast<std::size_t>(number)];
    if (links != nullptr) links->put_beyond(f, group.links_begin, group.links_end);
    for (std::size_t n = group.begin; n < group.full; ++n) {
      fetch_ahead(n);
      const auto place = places.of(blocks.places(n));
      for (int lane = 0; lane < Blocks::lanes; lane += lanes)
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(place, lane, AllLanes{}, own);
    }
    for (std::size_t n = group.full; n < group.end; ++n) {
      fetch_ahead(n);
      const auto place = places.of(blocks.places(n));
      for (int lane = 0; lane < Blocks::lanes; lane += lanes) {
        const SomeLanes fluid{(blocks.fluid(n) >> lane) & ((1U << lanes) - 1U)};
        update<Lattice, Collision, Equilibrium, Force, Viscosity>(place, lane, fluid, own);
      }
    }
    if (links != nullptr) links->take_back(f, group.links_begin, group.links_end);
  }
}

template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
void pass(Populations& populations, Parity parity, const FluidNodes& nodes,
          const CollisionParameters& parameters) {
  if (nodes.blocks != nullptr) {
    pass_over_blocks<Lattice, Collision, Equilibrium, Force, Viscosity, Real>(populations, parity,
                                                                              *nodes.blocks, parameters);
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
