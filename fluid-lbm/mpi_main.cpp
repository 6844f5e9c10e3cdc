// fluid-lbm-mpi: the fluid with its lattice shared among the ranks that mpirun starts.
#include <spdlog/spdlog.h>
#include <sys/prctl.h>

#include <algorithm>
#include <csignal>
#include <string_view>

#include <omp.h>

#include "fluid.hpp"
#include "mpi_ranks.hpp"
#include "serve.hpp"
#include "shared_participant.hpp"

namespace {

bool has_option(int argc, char** argv, std::string_view name) {
  return std::any_of(argv + 1, argv + argc, [name](const char* word) { return word == name; });
}

}  // namespace

int main(int argc, char** argv) {
  using namespace estuary;
  // What only asks about a scene or the program needs no other rank.
  if (has_option(argc, argv, "--check") || has_option(argc, argv, "--version") ||
      has_option(argc, argv, "--help"))
    return serve(argc, argv, std::make_unique<fluid::Fluid>());
  fluid::MpiRanks ranks(argc, argv);
  const fluid::EndAll end_all = [&](const std::string& why) { ranks.end_all(why); };
  // Ranks of one machine share its processors, unless the scene says how many threads each has.
  omp_set_num_threads(std::max(1, omp_get_num_procs() / ranks.count_here()));
  auto own = std::make_unique<fluid::Fluid>(ranks);
  if (ranks.rank() == 0) {
    const int status =
        serve(argc, argv, std::make_unique<fluid::SharedParticipant>(std::move(own), ranks, end_all));
    return status;
  }
  // The first rank hears of an end by a signal and tells.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
  spdlog::set_level(spdlog::level::off);
  for (int n = 1; n + 1 < argc; ++n)
    if (std::string_view(argv[n]) == "--threads") omp_set_num_threads(std::max(1, std::atoi(argv[n + 1])));
  fluid::follow_first_rank(*own, ranks, end_all);
  return 0;
}
