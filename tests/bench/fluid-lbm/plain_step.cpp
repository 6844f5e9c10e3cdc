#include "plain_step.hpp"

#include "collision_operators.hpp"
#include "row_shares.hpp"

namespace estuary::fluid {
namespace {

using Vectors = Lanes<double>;
using Places = std::array<double*, D2Q9::count>;

template <bool tail>
[[gnu::always_inline]] inline void update(const Places& place, std::ptrdiff_t x,
                                          const step::RatesOf<double>& rates, unsigned lanes) {
  std::array<Vectors::Vector, D2Q9::count> f;
  unrolled<D2Q9::count>([&](auto i) __attribute__((always_inline)) {
    f[i()] = tail ? load_lanes(place[i()] + x, lanes) : load(place[i()] + x);
  });
  const auto m = moments_of<D2Q9>(f);
  step::Trt::relax<D2Q9, step::NoForce>(f, m, step::Vector<Vectors::Vector>{}, Vectors::Vector{} + 1, rates);
  unrolled<D2Q9::count>([&](auto index) __attribute__((always_inline)) {
    constexpr auto i = static_cast<std::size_t>(index());
    double* const to = place[static_cast<std::size_t>(D2Q9::opposite[i])] + x;
    if constexpr (tail) {
      store_lanes(to, lanes, f[i]);
    } else {
      store(to, f[i]);
    }
  });
}

}  // namespace

void plain_step(Populations& populations, Parity parity, const std::vector<std::vector<Span>>& rows,
                Rates given) {
  const step::RatesOf<double> rates{given.even, given.odd};
  const bool even = parity == Parity::even;
  std::array<std::ptrdiff_t, D2Q9::count> distance;
  for (int i = 0; i < D2Q9::count; ++i) {
    const auto k = static_cast<std::size_t>(i);
    distance[k] =
        even ? D2Q9::opposite[k] * populations.plane() - populations.step(i) : i * populations.plane();
  }
  const RowShare share = row_share(populations.rows());
  for (int row = share.begin; row < share.end; ++row) {
    Places place;
    double* const first = populations.data<double>() + populations.row_start(row);
    for (std::size_t i = 0; i < place.size(); ++i) place[i] = first + distance[i];
    for (const Span span : rows[static_cast<std::size_t>(row)]) {
      int x = span.begin;
      for (; x + Vectors::count <= span.end; x += Vectors::count) update<false>(place, x, rates, 0);
      if (x < span.end) update<true>(place, x, rates, (1U << (span.end - x)) - 1U);
    }
  }
#pragma omp barrier
}

}  // namespace estuary::fluid
