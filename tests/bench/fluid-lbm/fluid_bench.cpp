// Updates per second of the step with its walls and sides, against what the memory of this machine gives in
// the same run.
//
// Medians of interleaved runs: --benchmark_repetitions=5 --benchmark_enable_random_interleaving=true.
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
  state.counters["% of memory limit (best)"] = 100 * best * flow.bytes_per_update() / bandwidth()[threads];
  state.counters["bytes per update"] = flow.bytes_per_update();
}

// A box of n^3 nodes with a sliding lid.
FlowSettings cube_of(int n) {
  FlowSettings settings = settings_of(n, n, false);
  settings.grid.nz = n;
  const auto points = static_cast<std::size_t>((2 * n + 1) * (2 * n + 1));
  settings.sides[top].velocity_x.assign(points, 0.05);
  settings.sides[top].velocity_y.assign(points, 0.0);
  settings.sides[top].velocity_z.assign(points, 0.0);
  return settings;
}
void cube_cavity(benchmark::State& state) {
  measure(state, cube_of(128), false);
}

// The same cavity with other operators, and with options that cost something.
void variant(benchmark::State& state, const StepChoice& choice) {
  FlowSettings settings = settings_of(1000, 200, false);
  settings.collision = choice.collision;
  settings.equilibrium = choice.equilibrium;
  settings.force = choice.force;
  settings.viscosity = choice.viscosity;
  settings.law.base_viscosity = 0.02;
  settings.law.smagorinsky_constant = 0.1;
  settings.law.consistency = 0.02;
  settings.law.index = 0.7;
  settings.law.largest = 1;
  measure(state, settings, false);
}

// Solid nodes at random, walls half-way between: porosity 0.4. Updates of fluid nodes are counted.
void porous(benchmark::State& state) {
  const int threads = static_cast<int>(state.range(0));
  omp_set_num_threads(threads);
  Flow flow(settings_of(1000, 1000, false));
  std::vector<std::uint16_t> solid(flow.grid().size(), 0);
  // Discs of radius 12, as many as it takes.
  std::uint64_t seed = 1;
  std::size_t covered = 0;
  while (covered < solid.size() * 6 / 10) {
    seed = seed * 6364136223846793005ULL + 1442695040888963407ULL;
    const auto x0 = static_cast<int>(seed >> 40) % 1000;
    const auto y0 = static_cast<int>(seed >> 20 & 0xfffff) % 1000;
    for (int y = std::max(0, y0 - 12); y < std::min(1000, y0 + 13); ++y) {
      for (int x = std::max(0, x0 - 12); x < std::min(1000, x0 + 13); ++x) {
        if ((x - x0) * (x - x0) + (y - y0) * (y - y0) > 144) continue;
        std::uint16_t& node = solid[flow.grid().index(x, y)];
        covered += node == 0 ? 1 : 0;
        node = 1;
      }
    }
  }
  flow.set_solid_nodes(solid);
  const double nodes = static_cast<double>(flow.cells().fluid_count());
  double best = 0;
  for (auto _ : state) {
    const double begin = omp_get_wtime();
    flow.run(20);
    const double seconds = omp_get_wtime() - begin;
    state.SetIterationTime(seconds);
    best = std::max(best, nodes * 20 / seconds);
  }
  state.counters["porosity"] = nodes / static_cast<double>(solid.size());
  state.counters["M updates/s"] =
      benchmark::Counter(nodes * 20 * 1e-6, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["M updates/s (best)"] = best * 1e-6;
}

// Discs as partially saturated cells, moving every step: a third of the domain.
void moving_grains(benchmark::State& state) {
  omp_set_num_threads(static_cast<int>(state.range(0)));
  FlowSettings settings = settings_of(500, 500, false);
  Flow flow(settings);
  Grains grains;
  for (int n = 0; n < 1000; ++n) {
    grains.centre.insert(grains.centre.end(), {10.0 + 15.4 * (n % 32), 10.0 + 15.4 * (n / 32)});
    grains.radius.push_back(5.2);
    grains.velocity.insert(grains.velocity.end(), {0.002, 0.001});
    grains.spin.push_back(0);
  }
  for (auto _ : state) {
    const double begin = omp_get_wtime();
    for (int step = 0; step < 20; ++step) {
      flow.place_grains(grains);
      flow.run(1);
      for (std::size_t k = 0; k < grains.centre.size(); ++k) grains.centre[k] += grains.velocity[k];
    }
    state.SetIterationTime(omp_get_wtime() - begin);
  }
  state.counters["M updates/s"] =
      benchmark::Counter(20 * static_cast<double>(flow.cells().fluid_count()) * 1e-6,
                         benchmark::Counter::kIsIterationInvariantRate);
}

void cavity(benchmark::State& state) {
  measure(state, settings_of(1000, 1000, false), false);
}
void cavity_in_single_precision(benchmark::State& state) {
  FlowSettings settings = settings_of(1000, 1000, false);
  settings.storage = Storage::single_precision;
  measure(state, settings, false);
}
void cube_in_single_precision(benchmark::State& state) {
  FlowSettings settings = cube_of(128);
  settings.storage = Storage::single_precision;
  measure(state, settings, false);
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
BENCHMARK(cavity_in_single_precision)
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->MinTime(1.0);
BENCHMARK(cube_in_single_precision)
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->MinTime(1.0);
BENCHMARK(channel)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);
BENCHMARK(channel_with_body)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);
BENCHMARK(channel_with_moving_body)
    ->Arg(1)
    ->Arg(2)
    ->UseManualTime()
    ->Unit(benchmark::kMillisecond)
    ->MinTime(1.0);
BENCHMARK(cube_cavity)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);
BENCHMARK(porous)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);
BENCHMARK(moving_grains)->Arg(1)->Arg(2)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(1.0);

#define ESTUARY_VARIANT(name, ...)                             \
  BENCHMARK_CAPTURE(variant, name, StepChoice{2, __VA_ARGS__}) \
      ->Arg(1)                                                 \
      ->UseManualTime()                                        \
      ->Unit(benchmark::kMillisecond)                          \
      ->MinTime(0.5)
ESTUARY_VARIANT(trt, CollisionModel::trt, EquilibriumModel::incompressible);
ESTUARY_VARIANT(trt_with_force, CollisionModel::trt, EquilibriumModel::incompressible, ForceModel::guo);
ESTUARY_VARIANT(bgk, CollisionModel::bgk, EquilibriumModel::incompressible);
ESTUARY_VARIANT(recursive_regularised, CollisionModel::recursive_regularised, EquilibriumModel::compressible);
ESTUARY_VARIANT(central_moment, CollisionModel::central_moment, EquilibriumModel::compressible);
ESTUARY_VARIANT(smagorinsky, CollisionModel::trt, EquilibriumModel::incompressible, ForceModel::none,
                ViscosityModel::smagorinsky);
ESTUARY_VARIANT(power_law, CollisionModel::trt, EquilibriumModel::incompressible, ForceModel::none,
                ViscosityModel::generalised_newtonian);
BENCHMARK(small_channel)->Arg(1)->UseManualTime()->Unit(benchmark::kMillisecond)->MinTime(0.5);

}  // namespace

BENCHMARK_MAIN();
