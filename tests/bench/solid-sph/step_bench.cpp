// Particle-steps per second of the explicit step, against the machine's own memory bandwidth in the same run.
// Arguments: columns (148: 22 201 particles), smoothing ratio in hundredths (95: 8 neighbours, 130: 20),
// threads.
//
// With hourglass control, medians of seven, interleaved:
//     bench_solid_sph --benchmark_filter=^stabilised/148/ --benchmark_repetitions=7
//         --benchmark_enable_random_interleaving=true --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>
#include <omp.h>

#include <cmath>
#include <map>
#include <tuple>
#include <vector>

#include "solver.hpp"

namespace {

using namespace estuary::solid;

struct Plate {
  Body body;
  std::unique_ptr<Solver> solver;
  State state;

  Plate(std::int64_t columns, double ratio, Order order, double stabilisation, double viscosity,
        LawName law) {
    Box box;
    box.to = {1.0, 1.0};
    box.spacing = 1.0 / static_cast<double>(columns);
    body = fill(box, 1000, ratio, order == Order::quadratic);
    SolverOptions options;
    Material material{.constants = ElasticConstants::from(1e6, 0.3, Plane::strain),
                      .plane = Plane::strain,
                      .viscosity = {},
                      .plasticity = {}};
    material.plasticity.yield = {2e3, 3e3};
    material.plasticity.strain = {0, 1};
    options.order = order;
    options.stabilisation = stabilisation;
    material.viscosity = {.linear = viscosity,
                          .quadratic = 2 * viscosity,
                          .sound_speed = std::sqrt(material.constants.wave_modulus() / 1000),
                          .smoothing_length = body.smoothing_length,
                          .density = 1000};
    options.materials.push_back(std::move(material));
    solver = make_solver(law, body, options);
    state = at_rest(body);
    state.history = solver->history();
    for (std::size_t i = 0; i < body.size();
         ++i)  // a spin and a stretch, so that every operation has work to do
      for (std::size_t c = 0; c < 2; ++c)
        state.velocity[2 * i + c] = (c == 0 ? 1 : -0.5) * (body.position[2 * i + 1 - c] - 0.5);
  }
};

// Made once: neighbourhoods take longer to build than a repetition to run.
Plate& plate_of(std::int64_t columns, std::int64_t ratio, Order order, double stabilisation, double viscosity,
                LawName law) {
  static std::map<std::tuple<std::int64_t, std::int64_t, Order, double, double, LawName>,
                  std::unique_ptr<Plate>>
      plates;
  auto& plate = plates[{columns, ratio, order, stabilisation, viscosity, law}];
  if (!plate)
    plate = std::make_unique<Plate>(columns, 0.01 * static_cast<double>(ratio), order, stabilisation,
                                    viscosity, law);
  return *plate;
}

void steps(benchmark::State& bench, Order order, double stabilisation, double viscosity,
           LawName law = LawName::saint_venant_kirchhoff) {
  omp_set_num_threads(static_cast<int>(bench.range(2)));
  Plate& plate = plate_of(bench.range(0), bench.range(1), order, stabilisation, viscosity, law);
  State state = plate.state;
  const double dt = 0.3 * plate.solver->reference_stable_step();
  constexpr std::uint64_t kSteps = 20;
  for (auto _ : bench)
    plate.solver->advance(state, {}, kSteps * dt, kSteps, 0.0, [](double, const std::string&) {});
  const double updates = static_cast<double>(bench.iterations()) * static_cast<double>(kSteps + 1) *
                         static_cast<double>(plate.body.size());
  bench.counters["particle-steps/s"] = benchmark::Counter(updates, benchmark::Counter::kIsRate);
  bench.counters["neighbours"] =
      static_cast<double>(plate.solver->pairs().pairs()) / static_cast<double>(plate.body.size());
}

void linear(benchmark::State& bench) {
  steps(bench, Order::linear, 0, 0);
}
void stabilised(benchmark::State& bench) {
  steps(bench, Order::linear, 0.02, 0);
}
void stabilised_plastic(benchmark::State& bench) {
  steps(bench, Order::linear, 0.02, 0, LawName::j2_plasticity);
}
void linear_viscous(benchmark::State& bench) {
  steps(bench, Order::linear, 0, 0.2);
}

void arguments(benchmark::internal::Benchmark* bench) {
  for (const std::int64_t threads : {1, 2})
    for (const std::int64_t ratio : {95, 130})
      for (const std::int64_t columns : {80, 148}) bench->Args({columns, ratio, threads});
  bench->UseRealTime()->Unit(benchmark::kMillisecond);
}
BENCHMARK(linear)->Apply(arguments);
BENCHMARK(stabilised)->Apply(arguments);
BENCHMARK(stabilised_plastic)->Apply(arguments);
BENCHMARK(linear_viscous)->Apply(arguments);

// What the memory of this machine gives: y = y + a x, 24 bytes per element.
void memory_bandwidth(benchmark::State& bench) {
  omp_set_num_threads(static_cast<int>(bench.range(0)));
  const std::int64_t n = 20'000'000;
  std::vector<double> x(static_cast<std::size_t>(n), 1.0), y(static_cast<std::size_t>(n), 2.0);
  double *px = x.data(), *py = y.data();
  for (auto _ : bench) {
#pragma omp parallel for schedule(static)
    for (std::int64_t i = 0; i < n; ++i) py[i] += 0.5 * px[i];
    benchmark::ClobberMemory();
  }
  bench.SetBytesProcessed(bench.iterations() * n * 24);
}
BENCHMARK(memory_bandwidth)->Arg(1)->Arg(2)->UseRealTime()->Unit(benchmark::kMillisecond);

}  // namespace
