#include "collide.hpp"

namespace estuary::fluid {
namespace {

// c_i . j without the products with zero and one, which strict arithmetic may not drop.
template <class Lattice, std::size_t i>
[[gnu::always_inline]] inline double momentum_along(const Moments& m) {
  constexpr auto c = Lattice::velocity[i];
  if constexpr (c[1] == 0) return c[0] > 0 ? m.momentum_x : -m.momentum_x;
  if constexpr (c[0] == 0) return c[1] > 0 ? m.momentum_y : -m.momentum_y;
  if constexpr (c[0] > 0) return c[1] > 0 ? m.momentum_x + m.momentum_y : m.momentum_x - m.momentum_y;
  return c[1] > 0 ? m.momentum_y - m.momentum_x : -(m.momentum_x + m.momentum_y);
}

// Written for few operations: in cache the step is limited by arithmetic. Constants are gathered outside the
// loop over nodes.
struct Trt {
  static constexpr const char* name = "trt";
  template <class Lattice>
  [[gnu::always_inline]] static void relax(std::array<double, Lattice::count>& f, const Moments& m,
                                           double inverse, const Rates& rates) {
    const double half_even = 0.5 * rates.even;
    const double half_odd = 0.5 * rates.odd;
    const double kept = 1.0 - half_even - half_odd;  // of a population
    const double exchanged = half_odd - half_even;   // of its opposite
    const double square = m.momentum_x * m.momentum_x + m.momentum_y * m.momentum_y;
    const double isotropic = rates.even * (m.excess - inverse * (1.5 * square));
    f[0] = (1.0 - rates.even) * f[0] + Lattice::weight[0] * isotropic;
    unrolled<static_cast<int>(Lattice::half.size())>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(Lattice::half[static_cast<std::size_t>(index())]);
      constexpr auto o = static_cast<std::size_t>(Lattice::opposite[i]);
      const double along = momentum_along<Lattice, i>(m);
      const double even = Lattice::weight[i] * isotropic +
                          (4.5 * Lattice::weight[i] * rates.even) * inverse * (along * along);
      const double odd = (3.0 * Lattice::weight[i] * rates.odd) * along;
      const double one = f[i];
      const double other = f[o];
      f[i] = kept * one + exchanged * other + (even + odd);
      f[o] = kept * other + exchanged * one + (even - odd);
    });
  }
};

struct Bgk {
  static constexpr const char* name = "bgk";
  template <class Lattice>
  [[gnu::always_inline]] static void relax(std::array<double, Lattice::count>& f, const Moments& m,
                                           double inverse, const Rates& rates) {
    unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
      constexpr auto i = static_cast<std::size_t>(index());
      f[i] -= rates.even * (f[i] - equilibrium<Lattice>(index(), m, inverse));
    });
  }
};

// One node, its nine values read at `place[i] + x`. Kept apart from the loop: what is declared inside the
// body of a simd loop is given an array per vector lane, and the loop is not vectorised.
template <class Lattice, class Collision, class Equilibrium>
[[gnu::always_inline]] inline void update(const std::array<double*, Lattice::count>& place, std::ptrdiff_t x,
                                          const Rates& rates) {
  std::array<double, Lattice::count> f;
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    f[i] = place[i][x];
  });
  const Moments m = moments_of<Lattice>(f);
  Collision::template relax<Lattice>(f, m, Equilibrium::inverse_density(m.excess), rates);
  unrolled<Lattice::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    place[static_cast<std::size_t>(Lattice::opposite[i])][x] = f[i];
  });
}

// The value that leaves along i goes where the one that came along the opposite of i was read, after either
// kind of step: reading places are all that distinguishes the two kinds.
template <class Lattice, class Collision, class Equilibrium>
void pass(Populations& populations, Parity parity, const Cells& cells, Rates rates) {
#pragma omp for schedule(static)
  for (int y = 0; y < populations.ny(); ++y) {
    std::array<double*, Lattice::count> place;
    for (int i = 0; i < Lattice::count; ++i) {
      place[static_cast<std::size_t>(i)] =
          populations.data() + populations.incoming(parity, i, populations.node(0, y));
    }
    for (const Span span : cells.row(y)) {
#pragma omp simd
      for (int x = span.begin; x < span.end; ++x) update<Lattice, Collision, Equilibrium>(place, x, rates);
    }
  }
}

}  // namespace

CollideAndStream collide_and_stream(CollisionModel collision, EquilibriumModel equilibrium) {
  if (collision == CollisionModel::trt) {
    return equilibrium == EquilibriumModel::incompressible ? &pass<D2Q9, Trt, Incompressible>
                                                           : &pass<D2Q9, Trt, Compressible>;
  }
  return equilibrium == EquilibriumModel::incompressible ? &pass<D2Q9, Bgk, Incompressible>
                                                         : &pass<D2Q9, Bgk, Compressible>;
}

std::string variant_name(CollisionModel collision, EquilibriumModel equilibrium) {
  return std::string(D2Q9::name) + "-" + (collision == CollisionModel::trt ? Trt::name : Bgk::name) + "-" +
         (equilibrium == EquilibriumModel::incompressible ? Incompressible::name : Compressible::name);
}

Rates relaxation_rates(double viscosity, double magic_parameter) {
  const double even = 3.0 * viscosity;  // tau+ - 1/2
  return {1.0 / (even + 0.5), 1.0 / (magic_parameter / even + 0.5)};
}

}  // namespace estuary::fluid
