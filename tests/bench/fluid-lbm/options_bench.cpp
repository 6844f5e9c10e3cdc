// What an option costs a scene that does not use it: a channel stepped by the program, which has every option
// and has them off, and by a loop and a step in which there is none (plain_step.hpp). Both must give the same
// bits. Short slices of both in turn, and the median of the ratios of neighbours, so that a machine with
// other work disturbs both alike.
//
//   fluid_options_bench [--slices 300] [--threads 2]
//
// Exit status 1 when a scene is slower by more than 2 %, or the bits differ.
#include <omp.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "plain_step.hpp"
#include "speed_cases.hpp"

namespace {

using namespace estuary::fluid;

constexpr double largest_loss = 0.02;

/// `flow` without anything of Flow but its populations, its two open sides and its walls.
void run_plain(Flow& flow, int steps) {
  const FlowSettings& s = flow.settings();
  Populations& populations = flow.populations();
  Sides& sides = flow.sides();
  const Parity start = populations.parity();
  const Parity other = start == Parity::even ? Parity::odd : Parity::even;
#pragma omp parallel
  for (int n = 0; n < steps; ++n) {
    const Parity parity = n % 2 == 0 ? start : other;
    exchange_and_reflect(populations, parity, sides);
    complete_open_sides(populations, parity, flow.cells(), sides, s.equilibrium, {}, false);
    plain_step(populations, parity, flow.cells().rows(), s.rates);
  }
  populations.set_parity(steps % 2 == 0 ? start : other);
}

bool same_bits(const Flow& one, const Flow& other) {
  std::vector<double> a;
  std::vector<double> b;
  one.populations().copy_to(a);
  other.populations().copy_to(b);
  return a == b;
}

double processor_seconds() {
  timespec time{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

double median(std::vector<double> values) {
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2),
                   values.end());
  return values[values.size() / 2];
}

/// Whether both give the same bits.
bool agree(int nx, int ny) {
  Flow with(speed::channel(nx, ny));
  Flow without(speed::channel(nx, ny));
  with.run(10);
  run_plain(without, 10);
  return same_bits(with, without);
}

/// Prints a row; whether the options cost less than they may. Both step the same flow in turn, since two
/// flows at different places of the memory differ by more than what is looked for.
bool compare(int nx, int ny, int slices) {
  Flow flow(speed::channel(nx, ny));
  const int steps = std::max(2, static_cast<int>(4e6 / (1.0 * nx * ny)) / 2 * 2);
  std::vector<double> by_clock;
  std::vector<double> by_processor;
  for (int slice = -2; slice < slices; ++slice) {
    double clock[2];
    double processor[2];
    // Which of the two comes first changes from slice to slice.
    for (const int turn : {0, 1}) {
      const int which = (slice & 1) ^ turn;
      const double clock_begin = omp_get_wtime();
      const double processor_begin = processor_seconds();
      if (which == 0) {
        flow.run(static_cast<std::size_t>(steps));
      } else {
        run_plain(flow, steps);
      }
      clock[which] = omp_get_wtime() - clock_begin;
      processor[which] = processor_seconds() - processor_begin;
    }
    if (slice < 0) continue;  // the caches are cold
    by_clock.push_back(clock[1] / clock[0]);
    by_processor.push_back(processor[1] / processor[0]);
  }
  const bool same = agree(nx, ny);
  const double clock = median(by_clock);
  const double processor = median(by_processor);
  const bool good = same && std::max(clock, processor) >= 1 - largest_loss;
  std::printf(
      "channel %4d x %4d, %d thread%s: speed over that without options %.3f by the clock, %.3f by the "
      "processors; %s bits%s\n",
      nx, ny, omp_get_max_threads(), omp_get_max_threads() == 1 ? "" : "s", clock, processor,
      same ? "the same" : "OTHER", good ? "" : "  FAILS");
  return good;
}

}  // namespace

int main(int count, char** arguments) {
  int slices = 300;
  int threads = 2;
  for (int n = 1; n + 1 < count; n += 2) {
    const std::string key = arguments[n];
    if (key == "--slices") slices = std::max(1, std::atoi(arguments[n + 1]));
    if (key == "--threads") threads = std::max(1, std::atoi(arguments[n + 1]));
  }
  bool good = true;
  for (int team = 1; team <= threads; ++team) {
    omp_set_num_threads(team);
    good = compare(1000, 200, slices) && good;       // in cache
    good = compare(1000, 1000, slices / 3) && good;  // from memory
  }
  return good ? 0 : 1;
}
