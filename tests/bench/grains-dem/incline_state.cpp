// usage: bench_incline_state settle FILE              makes a flowing state
//        bench_incline_state export FILE DATA         writes it as a LAMMPS data file
//        bench_incline_state run FILE STEPS THREADS ROLLING   prints million particle-steps per second:
//        processor time, wall time
#include <omp.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <fstream>
#include <string>

#include "incline_flow.hpp"

using estuary::grains::Dynamics;
using estuary::grains::InitialGrains;
using estuary::grains::RollingLaw;
namespace bench = estuary::grains::bench;

namespace {

void read_state(const char* name, InitialGrains<2>& grains) {
  std::ifstream file(name, std::ios::binary);
  for (auto* values : {&grains.position, &grains.velocity, &grains.spin})
    file.read(reinterpret_cast<char*>(values->data()),
              static_cast<std::streamsize>(values->size() * sizeof(double)));
  if (!file) std::exit(2);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 3) return 2;
  const std::string what = argv[1];
  InitialGrains<2> grains = bench::incline_grains(10000, 158);
  if (what == "settle") {
    Dynamics<2> dynamics(bench::incline_settings(158, RollingLaw::none, 0.1), grains, {});
    dynamics.advance(6, 60000);
    const auto& state = dynamics.state();
    for (std::size_t i = 0; i < state.size(); ++i) {
      const std::size_t k = state.identity[i];
      for (std::size_t c = 0; c < 2; ++c) {
        grains.position[2 * k + c] = state.position[2 * i + c];
        grains.velocity[2 * k + c] = state.velocity[2 * i + c];
      }
      grains.spin[k] = state.spin[i];
    }
    std::ofstream file(argv[2], std::ios::binary);
    for (const auto* values : {&grains.position, &grains.velocity, &grains.spin})
      file.write(reinterpret_cast<const char*>(values->data()),
                 static_cast<std::streamsize>(values->size() * sizeof(double)));
    return file ? 0 : 2;
  }
  read_state(argv[2], grains);
  if (what == "export" && argc > 3) {
    std::FILE* file = std::fopen(argv[3], "w");
    if (!file) return 2;
    std::fprintf(file,
                 "incline\n\n%zu atoms\n2 atom types\n\n0 158 xlo xhi\n-2 120 ylo yhi\n-0.5 0.5 zlo zhi\n\n",
                 grains.size());
    std::fprintf(file, "Atoms # sphere\n\n");
    for (std::size_t i = 0; i < grains.size(); ++i) {
      // The density that gives a sphere of this radius the disc's mass.
      const double r = grains.radius[i], density = grains.mass[i] / (4.0 / 3 * std::numbers::pi * r * r * r);
      std::fprintf(file, "%zu %d %.17g %.17g %.17g %.17g 0\n", i + 1, grains.held[i] ? 2 : 1, 2 * r, density,
                   grains.position[2 * i], grains.position[2 * i + 1]);
    }
    std::fprintf(file, "\nVelocities\n\n");
    for (std::size_t i = 0; i < grains.size(); ++i)
      std::fprintf(file, "%zu %.17g %.17g 0 0 0 %.17g\n", i + 1, grains.velocity[2 * i],
                   grains.velocity[2 * i + 1], grains.spin[i]);
    return std::fclose(file) == 0 ? 0 : 2;
  }
  if (what != "run" || argc < 6) return 2;
  omp_set_num_threads(std::atoi(argv[4]));
  const auto rolling = std::atoi(argv[5]) != 0 ? RollingLaw::spring : RollingLaw::none;
  Dynamics<2> dynamics(bench::incline_settings(158, rolling, 0.1), grains, {});
  const auto steps = static_cast<std::uint64_t>(std::atoll(argv[3]));
  dynamics.advance(200 * bench::kStep, 200);
  const auto wall = std::chrono::steady_clock::now();
  const std::clock_t processor = std::clock();
  dynamics.advance(static_cast<double>(steps) * bench::kStep, steps);
  const double work = 1e-2 * static_cast<double>(steps);
  std::printf("%.2f %.2f\n", work / (static_cast<double>(std::clock() - processor) / CLOCKS_PER_SEC),
              work / std::chrono::duration<double>(std::chrono::steady_clock::now() - wall).count());
  return 0;
}
