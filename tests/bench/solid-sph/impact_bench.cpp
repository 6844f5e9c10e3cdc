// Bodies that meet, as their scenes in configs/ have them: particle-steps per second of a fluid and of a row
// of a shell, and what part of the time finding and solving contacts takes. Arguments: spacing in
// micrometres, windows in microseconds, threads. Compare with memory_bandwidth of the same run; medians of
// seven:
//     bench_solid_sph --benchmark_filter='^impact|memory' --benchmark_repetitions=7
//         --benchmark_enable_random_interleaving=true --benchmark_report_aggregates_only=true
#include <benchmark/benchmark.h>
#include <fmt/format.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <vector>

#include "solid.hpp"

namespace {

using namespace estuary;

class Run {
public:
  Run(const char* name, std::int64_t micrometres, double window, std::int64_t threads) : window_(window) {
    const std::filesystem::path path = std::filesystem::path(ESTUARY_CONFIGS) / name;
    std::ifstream file(path);
    const std::string text(std::istreambuf_iterator<char>(file), {});
    const std::vector<std::string> overrides{
        fmt::format("solid.spacing={}", 1e-6 * static_cast<double>(micrometres)),
        fmt::format("solid.threads={}", threads)};
    Scene scene = Scene::parse(text, path.string(), overrides);
    solid_.configure(scene, "solid");
    if (!scene.problems().empty()) throw std::runtime_error("cannot use " + path.string());
    folder_ = std::filesystem::temp_directory_path() / ("impact-bench-" + std::to_string(::getpid()));
    solid_.start({}, folder_);
  }
  Run(const Run&) = delete;
  Run& operator=(const Run&) = delete;
  ~Run() { std::filesystem::remove_all(folder_); }

  void advance() {
    ++count_;
    work_ = solid_
                .advance({.number = count_,
                          .iteration = 1,
                          .mode = Mode::transient,
                          .time = window_ * static_cast<double>(count_ - 1),
                          .duration = window_},
                         {}, board_)
                .work;
    solid_.accept();
  }
  [[nodiscard]] const Work& work() const { return work_; }

private:
  solid::Solid solid_;
  ProgressBoard board_;
  Work work_;
  double window_;
  std::uint64_t count_ = 0;
  std::filesystem::path folder_;
};

// A fixed stretch of the scene, so that every repetition computes the same.
void run(benchmark::State& bench, const char* scene, double span) {
  const double window = 1e-6 * static_cast<double>(bench.range(1));
  double updates = 0, contact = 0, all = 0;
  for (auto _ : bench) {
    bench.PauseTiming();
    Run run(scene, bench.range(0), window, bench.range(2));
    bench.ResumeTiming();
    for (double time = 0; time < span; time += window) run.advance();
    updates += static_cast<double>(run.work().updates);
    for (const auto& [phase, seconds] : run.work().phase_seconds) {
      if (phase == "contact") contact += seconds;
      if (phase != "transfer") all += seconds;
    }
  }
  bench.counters["particle-steps/s"] = benchmark::Counter(updates, benchmark::Counter::kIsRate);
  bench.counters["contact's share"] = contact / all;
}

void impact_column(benchmark::State& bench) {
  run(bench, "impact/column-on-rigid.toml", 5e-5);
}
void impact_tank_open(benchmark::State& bench) {
  run(bench, "impact/tank-open.toml", 5e-5);
}
void impact_shell_row(benchmark::State& bench) {
  run(bench, "solid/shell-shock.toml", 2e-5);
}
BENCHMARK(impact_column)
    ->Args({1250, 1, 1})
    ->Args({1250, 10, 1})
    ->Args({1250, 10, 2})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(impact_tank_open)
    ->Args({2000, 1, 1})
    ->Args({1000, 1, 1})
    ->Args({1000, 1, 2})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(impact_shell_row)
    ->Args({250, 1, 1})
    ->Args({250, 1, 2})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
