// A sum over particles whose result does not depend on the number of threads.
#pragma once

#include <array>
#include <cstddef>

#include "on_team.hpp"

namespace estuary::solid {

/// sum of term(i) for i in [0, n): fixed blocks, each summed in order, then the blocks in order.
template <class Term>
double ordered_sum(std::size_t n, Term&& term) {
  constexpr std::size_t kBlocks = 64;
  std::array<double, kBlocks> partial{};
  on_team(n > 4096, [&] {
#pragma omp for schedule(static) nowait
    for (std::size_t b = 0; b < kBlocks; ++b) {
      double sum = 0;
      for (std::size_t i = b * n / kBlocks; i < (b + 1) * n / kBlocks; ++i) sum += term(i);
      partial[b] = sum;
    }
  });
  double total = 0;
  for (const double p : partial) total += p;
  return total;
}

}  // namespace estuary::solid
