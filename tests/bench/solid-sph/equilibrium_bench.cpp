// Cost of one equilibrium of a slender fin bent by three quarters of its length: Newton's method from rest
// and from a state two per cent away, and dynamic relaxation. Argument: particles across.
#include <benchmark/benchmark.h>
#include <omp.h>

#include "newton.hpp"
#include "surface_transfer.hpp"

namespace {

using namespace estuary::solid;

struct Fin {
  Body body;
  std::unique_ptr<Solver> solver;
  Loading loading;
  std::vector<double> displacement;

  explicit Fin(std::int64_t across) {
    Box box;
    box.to = {0.025, 0.25};
    box.spacing = 0.025 / static_cast<double>(across);
    box.clamped[static_cast<std::size_t>(Side::bottom)] = true;
    body = fill(box, 920, 0.95, true);
    SolverOptions options;
    options.materials.push_back({.constants = ElasticConstants::from(8e3, 0.3, Plane::strain),
                                 .plane = Plane::strain,
                                 .viscosity = {},
                                 .plasticity = {}});
    options.order = Order::linear;
    options.stabilisation = 0.02;
    solver = make_solver(LawName::saint_venant_kirchhoff, body, options);
    const Side left = Side::left;
    const ContourLine line = contour_line(body, {&left, 1});
    const Transfer transfer = contour_transfer(body, line);
    ParticleLoad load;
    load.particle = transfer.touched;
    spread(transfer, uniform_traction(line, 1.5, 0), load.end);
    load.start = load.end;
    loading.loads.push_back(std::move(load));
    displacement.assign(2 * body.size(), 0.0);
  }
};

void nothing(double, const std::string&) {}

void newton_from_rest(benchmark::State& bench) {
  omp_set_num_threads(1);
  Fin fin(bench.range(0));
  NewtonSolver newton(*fin.solver);
  EquilibriumReport report;
  for (auto _ : bench) {
    std::vector<double> u = fin.displacement;
    report = newton.solve(u, fin.loading, 0, {.tolerance = 1e-6, .maximum_steps = 500}, nothing);
    if (!report.converged) bench.SkipWithError("no equilibrium");
  }
  bench.counters["linear_solves"] = static_cast<double>(report.steps);
}
BENCHMARK(newton_from_rest)->Arg(5)->Arg(10)->Arg(20)->Unit(benchmark::kMillisecond);

void newton_from_nearby(benchmark::State& bench) {
  omp_set_num_threads(1);
  Fin fin(bench.range(0));
  NewtonSolver newton(*fin.solver);
  newton.solve(fin.displacement, fin.loading, 0, {.tolerance = 1e-6, .maximum_steps = 500}, nothing);
  for (double& f : fin.loading.loads[0].end) f *= 1.02;
  EquilibriumReport report;
  for (auto _ : bench) {
    std::vector<double> u = fin.displacement;
    report = newton.solve(u, fin.loading, 0, {.tolerance = 1e-6, .maximum_steps = 500}, nothing);
    if (!report.converged) bench.SkipWithError("no equilibrium");
  }
  bench.counters["linear_solves"] = static_cast<double>(report.steps);
}
BENCHMARK(newton_from_nearby)->Arg(5)->Arg(10)->Arg(20)->Unit(benchmark::kMillisecond);

void relaxation_from_rest(benchmark::State& bench) {
  omp_set_num_threads(1);
  Fin fin(bench.range(0));
  EquilibriumReport report;
  for (auto _ : bench) {
    std::vector<double> u = fin.displacement;
    report = fin.solver->relax(u, fin.loading, 0, {.tolerance = 1e-6, .maximum_steps = 2'000'000}, nothing);
    if (!report.converged) bench.SkipWithError("no equilibrium");
  }
  bench.counters["steps"] = static_cast<double>(report.steps);
}
BENCHMARK(relaxation_from_rest)->Arg(5)->Arg(10)->Iterations(1)->Unit(benchmark::kMillisecond);

}  // namespace
