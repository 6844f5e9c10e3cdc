// Particle-steps per second of the dense flow down an incline, 10 000 moving discs, with the laws that cost
// most; processor time, so that a busy machine does not change the figures much.
#include <benchmark/benchmark.h>
#include <omp.h>

#include "incline_flow.hpp"

namespace estuary::grains::bench {
namespace {

void flow_down(benchmark::State& state) {
  const auto rolling = static_cast<RollingLaw>(state.range(0));
  omp_set_num_threads(static_cast<int>(state.range(1)));
  const InitialGrains<2> grains = incline_grains(10000, 158);
  Dynamics<2> dynamics(incline_settings(158, rolling, 0.1), grains, {});
  dynamics.advance(2, 20000);  // until the rows have collapsed into a flowing layer
  for (auto unused : state) {
    (void)unused;
    dynamics.advance(100 * kStep, 100);
  }
  state.counters["particle_steps"] =
      benchmark::Counter(1e4 * 100 * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
  state.counters["pairs_per_grain"] = static_cast<double>(dynamics.state().partner.size()) / 10158;
}
BENCHMARK(flow_down)
    ->ArgNames({"rolling", "threads"})
    ->Args({0, 1})
    ->Args({2, 1})
    ->Args({0, 2})
    ->Unit(benchmark::kMillisecond)
    ->UseRealTime();

}  // namespace
}  // namespace estuary::grains::bench
