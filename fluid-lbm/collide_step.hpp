// The one text of the step, for every lattice and option. Included by the files that compile variants of it.
#pragma once

#include "collision_operators.hpp"
#include "row_shares.hpp"
#include "still_links.hpp"
#include "stretches.hpp"

namespace estuary::fluid::step {

// As many nodes as a vector has lanes, from x on, their values read at `place[i] + x`; with `tail` those that
// `mask` says, the others being left as they are.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, bool tail,
          class Real>
[[gnu::always_inline]] inline void update(const std::array<Real*, Lattice::count>& place, std::ptrdiff_t x,
                                          const CollisionParameters& parameters,
                                          const typename Lanes<Real>::Mask& mask) {
  using Value = typename Lanes<Real>::Vector;
  std::array<Value, Lattice::count> f;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    f[i] = load(place[i] + x);
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
    Real* const to = place[static_cast<std::size_t>(Lattice::opposite[i])] + x;
    if constexpr (tail) {
      const Value before = load(to);
      store(to, mask ? f[i] : before);
    } else {
      store(to, f[i]);
    }
  });
}

// Where the values that reach the nodes of a stretch are read, and put back: the value that leaves along i
// goes where the one that came along the opposite of i was read, after either kind of step, so that these
// places are all that distinguishes the two kinds.
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
  /// In packed memory, of a stretch's first node.
  [[gnu::always_inline]] Pointers of(const Stretches::Stretch& stretch) const {
    Pointers place;
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(index());
      constexpr auto c = Lattice::velocity[i];
      constexpr int sender = 3 * (1 - c[2]) + 1 - c[1];
      place[i] = plane_[i] + (even_ ? stretch.at[sender] : stretch.at[4]);
    });
    return place;
  }

private:
  bool even_;
  Pointers plane_;
  std::array<std::ptrdiff_t, Lattice::count> step_;
};

// Nodes first <= x < end of a run.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
[[gnu::always_inline]] inline void update_run(
    const std::array<Real*, Lattice::count>& place, int x, int end, const CollisionParameters& parameters,
    const std::array<typename Lanes<Real>::Mask, static_cast<std::size_t>(Lanes<Real>::count)>& masks) {
  constexpr int lanes = Lanes<Real>::count;
  for (; x + lanes <= end; x += lanes) {
    update<Lattice, Collision, Equilibrium, Force, Viscosity, false>(place, x, parameters, masks[0]);
  }
  if (x < end) {
    const auto left = static_cast<std::size_t>(end - x);
    update<Lattice, Collision, Equilibrium, Force, Viscosity, true>(place, x, parameters, masks[left]);
  }
}

template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
void pass(Populations& populations, Parity parity, const FluidNodes& nodes,
          const CollisionParameters& parameters) {
  const CollisionParameters own = parameters;
  const ReadingPlaces<Lattice, Real> places(populations, parity);
  std::array<typename Lanes<Real>::Mask, static_cast<std::size_t>(Lanes<Real>::count)> masks;
  for (std::size_t k = 0; k < masks.size(); ++k) masks[k] = first_lanes<Real>(static_cast<int>(k));
  const RowShare share = row_share(populations.first_row(), populations.past_row());
  const bool packed = populations.packed();
  for (int row = share.begin; row < share.end; ++row) {
    if (nodes.links != nullptr) nodes.links->reflect_behind(populations, parity, share, row);
    if (packed) {
      const Stretches::Stretch* const last = nodes.stretches->end(row);
      for (const auto* stretch = nodes.stretches->begin(row); stretch != last; ++stretch) {
        update_run<Lattice, Collision, Equilibrium, Force, Viscosity, Real>(places.of(*stretch), 0,
                                                                            stretch->length, own, masks);
      }
      continue;
    }
    const auto place = places.of(populations.row_start(row));
    for (const Span span : nodes.rows[static_cast<std::size_t>(row)]) {
      update_run<Lattice, Collision, Equilibrium, Force, Viscosity, Real>(place, span.begin, span.end, own,
                                                                          masks);
    }
  }
  if (nodes.links != nullptr) {
#pragma omp barrier
    nodes.links->reflect_rest(populations, parity, share);
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
