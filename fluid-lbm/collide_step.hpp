// The one text of the step, for every lattice and option. Included by the files that compile variants of it.
#pragma once

#include "collision_operators.hpp"

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

// The value that leaves along i goes where the one that came along the opposite of i was read, after either
// kind of step: reading places are all that distinguishes the two kinds.
template <class Lattice, class Collision, class Equilibrium, class Force, class Viscosity, class Real>
void pass(Populations& populations, Parity parity, const std::vector<std::vector<Span>>& rows,
          const CollisionParameters& parameters) {
  const CollisionParameters own = parameters;
  constexpr int lanes = Lanes<Real>::count;
  std::array<typename Lanes<Real>::Mask, lanes> masks;
  for (int k = 0; k < lanes; ++k) masks[static_cast<std::size_t>(k)] = first_lanes<Real>(k);
#pragma omp for schedule(static)
  for (int row = 0; row < populations.rows(); ++row) {
    std::array<Real*, Lattice::count> place;
    for (int i = 0; i < Lattice::count; ++i) {
      place[static_cast<std::size_t>(i)] =
          populations.data<Real>() + populations.incoming(parity, i, populations.row_start(row));
    }
    for (const Span span : rows[static_cast<std::size_t>(row)]) {
      int x = span.begin;
      for (; x + lanes <= span.end; x += lanes) {
        update<Lattice, Collision, Equilibrium, Force, Viscosity, false>(place, x, own, masks[0]);
      }
      if (x < span.end) {
        const auto left = static_cast<std::size_t>(span.end - x);
        update<Lattice, Collision, Equilibrium, Force, Viscosity, true>(place, x, own, masks[left]);
      }
    }
  }
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
