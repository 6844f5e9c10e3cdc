// Updates per second of the step with its walls and sides, against what the memory of this machine gives in
// the same run.
//
// In the AA pattern a node update reads and writes nine doubles in place: 144 bytes. The memory's limit is
// measured with an in-place update of an array of 512 MiB. A grid that fits into the last-level cache may
// exceed that limit.
#include <benchmark/benchmark.h>
#include <omp.h>

#include <cmath>
#include <ctime>
#include <map>
#include <memory>

#include "flow.hpp"

namespace {

using namespace estuary::fluid;

constexpr double bytes_per_update = 2.0 * D2Q9::count * sizeof(double);

// Bytes per second by number of threads, as measured by `in_place_bandwidth`, which runs first.
std::map<int, double>& bandwidth() {
  static std::map<int, double> measured;
  return measured;
}

void in_place_bandwidth(benchmark::State& state) {
  const int threads = static_cast<int>(state.range(0));
  omp_set_num_threads(threads);
  constexpr std::ptrdiff_t size = (std::ptrdiff_t{512} << 20) / static_cast<std::ptrdiff_t>(sizeof(double));
  const std::unique_ptr<double[]> array(new double[size]);
  double* const values = array.get();
#pragma omp parallel for simd schedule(static)
  for (std::ptrdiff_t n = 0; n < size; ++n) values[n] = 1.0;
  for (auto _ : state) {
    const double begin = omp_get_wtime();
#pragma omp parallel for simd schedule(static)
    for (std::ptrdiff_t n = 0; n < size; ++n) values[n] = 0.5 * values[n] + 0.5;
    const double seconds = omp_get_wtime() - begin;
    state.SetIterationTime(seconds);
    double& best = bandwidth()[threads];
    best = std::max(best, 2.0 * sizeof(double) * static_cast<double>(size) / seconds);
  }
  state.counters["GB/s (best)"] = bandwidth()[threads] * 1e-9;
}

FlowSettings settings_of(int nx, int ny, bool channel) {
  FlowSettings settings;
  settings.grid = {nx, ny, 1.0, 0.0, 0.0, false, false};
  settings.rates = relaxation_rates(0.02, 3.0 / 16.0);
  Sides& sides = settings.sides;
  if (channel) {
    sides[left].kind = SideKind::velocity;
    sides[left].velocity_x.assign(static_cast<std::size_t>(ny), 0.05);
    sides[left].velocity_y.assign(static_cast<std::size_t>(ny), 0.0);
    sides[right].kind = SideKind::pressure;
    sides[right].excess.assign(static_cast<std::size_t>(ny), 0.0);
  } else {
    sides[top].velocity_x.assign(static_cast<std::size_t>(2 * nx + 1), 0.05);
    sides[top].velocity_y.assign(static_cast<std::size_t>(2 * nx + 1), 0.0);
  }
  return settings;
}

void measure(benchmark::State& state, const FlowSettings& settings, bool body) {
  const int threads = static_cast<int>(state.range(0));
  omp_set_num_threads(threads);
  Flow flow(settings);
  if (body) {
    constexpr std::uint32_t count = 200;
    std::vector<double> points;
    std::vector<std::uint32_t> connectivity;
    for (std::uint32_t n = 0; n < count; ++n) {
      const double angle = -2 * M_PI * n / count;
      points.insert(points.end(), {300.3 + 25.2 * std::cos(angle), 100.2 + 25.2 * std::sin(angle)});
      connectivity.insert(connectivity.end(), {n, (n + 1) % count});
    }
    flow.set_wet_surface(count, connectivity);
    flow.move_wet_surface(points, std::vector<double>(2 * count, 0.0), 1.0);
  }
  constexpr std::size_t steps = 20;
  flow.run(steps);
  const double nodes = static_cast<double>(flow.cells().fluid_count());
  double best = 0;
  double best_of_processor = 0;
  for (auto _ : state) {
    const double begin = omp_get_wtime();
    const std::clock_t processor_begin = std::clock();
    flow.run(steps);
    const double processor_seconds = static_cast<double>(std::clock() - processor_begin) / CLOCKS_PER_SEC;
    best_of_processor = std::max(best_of_processor, nodes * steps / processor_seconds);
    const double seconds = omp_get_wtime() - begin;
    state.SetIterationTime(seconds);
    best = std::max(best, nodes * steps / seconds);
  }
  state.counters["M updates/s"] =
      benchmark::Counter(nodes * steps * 1e-6, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["M updates/s (best)"] = best * 1e-6;
  // On a machine that others use too the processor's time tells more than the clock; meaningful with one
  // thread.
  if (threads == 1) state.counters["M updates per processor second (best)"] = best_of_processor * 1e-6;
  state.counters["% of memory limit (best)"] = 100 * best * bytes_per_update / bandwidth()[threads];
}

void cavity(benchmark::State& state) {
  measure(state, settings_of(1000, 1000, false), false);
}
void channel(benchmark::State& state) {
  measure(state, settings_of(1000, 200, true), false);
}
void channel_with_body(benchmark::State& state) {
  measure(state, settings_of(1000, 200, true), true);
}
void small_channel(benchmark::State& state) {
  measure(state, settings_of(300, 50, true), false);
}

// A body that moves every step: geometry, links and refill on top of the step.
void channel_with_moving_body(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  Flow flow(settings_of(1000, 200, true));
  constexpr std::uint32_t count = 200;
  std::vector<double> points;
  std::vector<double> velocities;
  std::vector<std::uint32_t> connectivity;
  for (std::uint32_t n = 0; n < count; ++n) {
    const double angle = -2 * M_PI * n / count;
    points.insert(points.end(), {300.3 + 25.2 * std::cos(angle), 100.2 + 25.2 * std::sin(angle)});
    velocities.insert(velocities.end(), {0.02, 0.0});
    connectivity.insert(connectivity.end(), {n, (n + 1) % count});
  }
  flow.set_wet_surface(count, connectivity);
  flow.move_wet_surface(points, velocities, 1.0);
  for (auto _ : state) {
    const double begin = omp_get_wtime();
    for (int step = 0; step < 20; ++step) {
      flow.run(1);
      for (std::uint32_t n = 0; n < count; ++n) points[2 * n] += 0.02;
      flow.move_wet_surface(points, velocities, 1.0);
    }
    state.SetIterationTime(omp_get_wtime() - begin);
  }
  state.counters["M updates/s"] =
      benchmark::Counter(20 * static_cast<double>(flow.cells().fluid_count()) * 1e-6,
                         benchmark::Counter::kIsIterationInvariantRate);
}

BENCHMARK(in_place_bandwidth)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->Iterations(12);
BENCHMARK(cavity)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);
BENCHMARK(channel)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);
BENCHMARK(channel_with_body)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);
BENCHMARK(channel_with_moving_body)
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->MinTime(1.0);
BENCHMARK(small_channel)->Arg(1)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(0.5);

}  // namespace

BENCHMARK_MAIN();
