// fluid-lbm-mpi: the fluid with its lattice shared among the ranks that mpirun starts.
#include <omp.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "fluid.hpp"
#include "mpi_ranks.hpp"
#include "serve.hpp"
#include "shared_participant.hpp"

namespace {

bool has_option(int argc, char** argv, std::string_view name) {
  return std::any_of(argv + 1, argv + argc, [name](const char* word) { return word == name; });
}

// What follows an option, as `--name value` or `--name=value`; `serve` reads them all on the first rank.
std::string value_of(int argc, char** argv, std::string_view name, std::string value) {
  for (int n = 1; n < argc; ++n) {
    const std::string_view word(argv[n]);
    if (word == name && n + 1 < argc) value = argv[n + 1];
    if (word.starts_with(name) && word.substr(name.size()).starts_with('='))
      value = word.substr(name.size() + 1);
  }
  return value;
}

// As `serve` has it: a scene that comes over the network names files of the working folder only.
std::optional<std::filesystem::path> files_below(int argc, char** argv) {
  if (value_of(argc, argv, "--bind", "").starts_with("ipc://")) return std::nullopt;
  return std::filesystem::absolute(value_of(argc, argv, "--folder", "."));
}

}  // namespace

int main(int argc, char** argv) {
  using namespace estuary;
  // What only asks about a scene or the program needs no other rank.
  if (has_option(argc, argv, "--check") || has_option(argc, argv, "--version") ||
      has_option(argc, argv, "--help"))
    return serve(argc, argv, std::make_unique<fluid::Fluid>());
  fluid::MpiRanks ranks(argc, argv);
  // A lattice that one process holds has no neighbours: this is fluid-lbm.
  if (ranks.count() == 1) return serve(argc, argv, std::make_unique<fluid::Fluid>());
  const fluid::EndAll end_all = [&](const std::string& why) { ranks.end_all(why); };
  // Ranks of one machine share its processors, unless the scene says how many threads each has.
  omp_set_num_threads(std::max(1, omp_get_num_procs() / ranks.count_here()));
  auto own = std::make_unique<fluid::Fluid>(ranks);
  if (ranks.rank() == 0) {
    return serve(
        argc, argv,
        std::make_unique<fluid::SharedParticipant>(std::move(own), ranks, end_all, files_below(argc, argv)));
  }
  // The first rank hears of an end by a signal and tells.
  std::signal(SIGINT, SIG_IGN);
  std::signal(SIGTERM, SIG_IGN);
  spdlog::set_level(spdlog::level::off);
  const int threads = std::atoi(value_of(argc, argv, "--threads", "0").c_str());
  if (threads > 0) omp_set_num_threads(threads);
  fluid::follow_first_rank(*own, ranks, end_all);
  return 0;
}
