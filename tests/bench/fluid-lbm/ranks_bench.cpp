// Strong and weak scaling of the fluid over ranks, and a model of what more ranks would do.
//
//   mpirun -n 2 --bind-to core fluid_ranks_bench [--seconds 0.5]
//
// Measured, with the ranks it is started with: steps of lattices of a given size (strong) and of a given size
// per rank (weak), and what telling the neighbours costs, for messages of two sizes. The model: a rank's
// nodes take the time per node measured here with all ranks at work, and each step takes one exchange with
// two neighbours, of the same latency and bandwidth as here. It knows of no network and no rank that is late:
// figures from it are upper bounds.
#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include <omp.h>

#include "flow.hpp"
#include "mpi_ranks.hpp"

namespace {

using namespace estuary::fluid;

double now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

struct Speed {
  double nodes = 0;          // of all ranks
  double layer_nodes = 0;    // of one layer
  double step = 0;           // [s]
  double exchange = 0;       // [s], of one step
  double message_bytes = 0;  // to one neighbour
};

FlowSettings cavity(const Grid& grid, MpiRanks& ranks) {
  FlowSettings settings;
  settings.grid = grid;
  settings.rates = relaxation_rates(0.05, settings.magic_parameter);
  if (ranks.count() > 1) {
    settings.ranks = &ranks;
    settings.grid.ranks = ranks.count();
    settings.grid.rank = ranks.rank();
  }
  return settings;
}

// Median of several batches, which end at the same time on all ranks.
template <class Batch>
double time_of(MpiRanks& ranks, double seconds, const Batch& batch) {
  std::vector<double> times;
  batch();
  const double begin = now();
  bool more = true;
  while (more) {
    (void)ranks.any(false);
    const double start = now();
    batch();
    (void)ranks.any(false);
    times.push_back(now() - start);
    more = as_first_rank(&ranks, now() - begin < seconds || times.size() < 5);
  }
  std::sort(times.begin(), times.end());
  return times[times.size() / 2];
}

Speed measure(const Grid& grid, MpiRanks& ranks, double seconds) {
  Flow flow(cavity(grid, ranks));
  Speed speed;
  speed.nodes = static_cast<double>(grid.size());
  speed.layer_nodes = speed.nodes / grid.slab_layers();
  const int steps = std::max(2, static_cast<int>(4e6 * ranks.count() / speed.nodes) / 2 * 2);
  speed.step = time_of(ranks, seconds, [&] { flow.run(static_cast<std::size_t>(steps)); }) / steps;
  if (ranks.count() == 1) return speed;
  Halo halo(ranks, flow.grid());
  Populations& populations = flow.populations();
  constexpr int exchanges = 200;
  speed.exchange = time_of(ranks, seconds,
                           [&] {
                             for (int n = 0; n < exchanges; ++n) {
                               const Parity parity = n % 2 == 0 ? Parity::even : Parity::odd;
                               halo.stepped(parity);
                               halo.exchange(populations, parity, false);
                             }
                           }) /
                   exchanges;
  const int crossing = grid.nz > 0 ? 5 : 3;
  speed.message_bytes = crossing * static_cast<double>(populations.layer_size()) * sizeof(double);
  return speed;
}

void print(const char* name, const Speed& speed, int ranks) {
  std::printf("| %-28s | %d | %8.1f | %9.1f | ", name, ranks, 1e-6 * speed.nodes / speed.step,
              1e6 * speed.step);
  if (speed.exchange > 0) {
    std::printf("%7.1f | %6.0f | %5.2f |\n", 1e6 * speed.exchange, speed.message_bytes / 1e3,
                1e-9 * speed.message_bytes / speed.exchange);
  } else {
    std::printf("        |        |       |\n");
  }
}

}  // namespace

int main(int argc, char** argv) {
  MpiRanks ranks(argc, argv);
  double seconds = 0.5;
  for (int n = 1; n + 1 < argc; ++n)
    if (std::strcmp(argv[n], "--seconds") == 0) seconds = std::atof(argv[n + 1]);
  omp_set_num_threads(1);
  const int count = ranks.count();
  const bool speaks = ranks.rank() == 0;
  if (speaks) std::printf("| lattice | ranks | M updates/s | us a step | us an exchange | kB | GB/s |\n");
  struct Case {
    const char* name;
    Grid grid;
    bool weak;
  };
  Grid small_space{96, 96};
  small_space.nz = 96;
  Grid slab{96, 96};
  slab.nz = 48 * count;
  const std::vector<Case> cases{{"1000 x 1000", Grid{1000, 1000}, false},
                                {"200 x 200", Grid{200, 200}, false},
                                {"96 x 96 x 96", small_space, false},
                                {"1000 x 500 a rank", Grid{1000, 500 * count}, true},
                                {"96 x 96 x 48 a rank", slab, true}};
  std::vector<Speed> speeds;
  for (const Case& one : cases) {
    speeds.push_back(measure(one.grid, ranks, seconds));
    if (speaks) print(one.name, speeds.back(), count);
  }
  if (!speaks || count == 1) return 0;
  // An exchange takes latency + bytes / bandwidth: from the smallest and the largest message.
  const auto by_bytes = [](const Speed& a, const Speed& b) { return a.message_bytes < b.message_bytes; };
  const auto [least, most] = std::minmax_element(speeds.begin(), speeds.end(), by_bytes);
  const double per_byte =
      std::max(0.0, (most->exchange - least->exchange) / (most->message_bytes - least->message_bytes));
  const double latency = std::max(0.0, least->exchange - per_byte * least->message_bytes);
  std::printf("\nmodel: an exchange takes %.1f us and %.2f GB/s with one neighbour\n", 1e6 * latency,
              per_byte > 0 ? 1e-9 / per_byte : 0.0);
  std::printf("| lattice, model | ranks | M updates/s | of the ideal |\n");
  for (std::size_t n = 0; n < cases.size(); ++n) {
    const Speed& speed = speeds[n];
    const double per_node = (speed.step - speed.exchange) * count / speed.nodes;
    for (const int more : {4, 16, 64, 256}) {
      const double nodes = cases[n].weak ? speed.nodes / count * more : speed.nodes;
      if (nodes / speed.layer_nodes < 4.0 * more) continue;
      const double step = per_node * nodes / more + latency + 2 * per_byte * speed.message_bytes;
      std::printf("| %-28s | %d | %8.0f | %3.0f %% |\n", cases[n].name, more, 1e-6 * nodes / step,
                  100 * per_node * nodes / more / step);
    }
  }
  return 0;
}
