#include "study_command.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <mutex>
#include <utility>

#include "folder_lock.hpp"
#include "slurm_array.hpp"
#include "stability_page.hpp"
#include "study_page.hpp"
#include "study_runner.hpp"
#include "study_table.hpp"

namespace estuary::coupler {
namespace {

void say(const std::string& line) {
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

/// Prints every problem; nothing when the study cannot be used.
std::optional<StudyScene> usable_study(const std::filesystem::path& file) {
  auto reading = read_study(file);
  for (const auto& problem : reading.problems) fmt::print(stderr, "{}\n", describe(file.string(), problem));
  if (reading.problems.empty()) return std::move(reading.study);
  fmt::print(stderr, "{} problem{} in {}; nothing was launched\n", reading.problems.size(),
             reading.problems.size() == 1 ? "" : "s", file.string());
  return std::nullopt;
}

/// What the study looks at, by the first cell that can be run; nothing, with every reason printed, when there
/// is none or it has no such quantities.
std::optional<std::vector<StudyQuantity>> usable_quantities(const StudyScene& study,
                                                            const std::vector<PreparedCell>& cells) {
  const auto good =
      std::find_if(cells.begin(), cells.end(), [](const auto& cell) { return cell.refused.empty(); });
  if (good == cells.end()) {
    for (const auto& cell : cells)
      fmt::print(stderr, "{}: {}: {}\n", study.scene.string(), cell.cell.name(), cell.refused);
    fmt::print(stderr, "every setting of {} is refused; nothing was launched\n", study.file.string());
    return std::nullopt;
  }
  for (const auto& cell : cells) {
    if (!cell.refused.empty())
      fmt::print(stderr, "{} is refused and left out: {}\n", cell.cell.name(), cell.refused);
  }
  std::vector<std::string> problems;
  auto quantities = resolved_quantities(study, good->scene.coupling, problems);
  for (const auto& problem : problems) fmt::print(stderr, "{}: {}\n", study.file.string(), problem);
  if (!problems.empty()) return std::nullopt;
  return quantities;
}

ExitStatus submit(const StudyScene& study, const StudyOptions& options, std::size_t tasks) {
  const SlurmArray array{.coupler = std::filesystem::read_symlink("/proc/self/exe"),
                         .folder = std::filesystem::absolute(options.folder),
                         .tasks = tasks,
                         .at_once = options.jobs > 1 ? options.jobs : 0};
  say(submit_slurm_array(study, array));
  return ExitStatus::done;
}

ExitStatus compared(const StudyOptions& options, const std::vector<std::string>& worse) {
  for (const auto& line : worse) fmt::print(stderr, "worse than {}: {}\n", options.against.string(), line);
  return worse.empty() ? ExitStatus::done : ExitStatus::check_failed;
}

ExitStatus ladder(const StudyScene& study, const StudyOptions& options, const StudyStore& store,
                  const StudyRunner& runner, const std::atomic<int>& interrupt) {
  auto grid = study_cells(study);
  if (options.cell) {
    std::vector<PreparedCell> one;
    one.push_back(store.prepare(grid.at(*options.cell)));
    if (!one.front().refused.empty()) say(one.front().refused);
    runner.run_all(one, study.repeats);
    return interrupt ? ExitStatus::interrupted : ExitStatus::done;
  }
  std::vector<PreparedCell> cells;
  cells.reserve(grid.size());
  for (auto& cell : grid) cells.push_back(store.prepare(std::move(cell)));
  if (!usable_quantities(study, cells)) return ExitStatus::wrong_scene;
  if (options.slurm) return submit(study, options, cells.size());
  if (!options.collect) {
    const auto known =
        std::count_if(cells.begin(), cells.end(), [](const auto& cell) { return !cell.runs.empty(); });
    if (known > 0) say(fmt::format("{} of {} settings have been run before", known, cells.size()));
    std::vector<std::vector<StudyRun>> earlier(cells.size());
    if (options.retime) {
      for (std::size_t k = 0; k < cells.size(); ++k) earlier[k] = std::exchange(cells[k].runs, {});
    }
    runner.run_all(cells, study.repeats);
    // An interrupt leaves the times that were known.
    for (std::size_t k = 0; k < cells.size(); ++k) {
      if (cells[k].runs.empty()) cells[k].runs = std::move(earlier[k]);
    }
  }
  const auto all = study_results(study, store, cells);
  write_study(study, all, options.folder);
  fmt::print("\n{}\n\n{}", study.title, study_markdown(study, all));
  fmt::print("\npage: {}\n", (options.folder / "study.html").string());
  if (interrupt) return ExitStatus::interrupted;
  if (options.against.empty()) return ExitStatus::done;
  return compared(options, what_grew_worse(study, all, options.against, options.allowed_growth));
}

ExitStatus stability(const StudyScene& study, const StudyOptions& options, const StudyStore& store,
                     const StudyRunner& runner, const std::atomic<int>& interrupt) {
  StudyScene grid_only = study;
  grid_only.bisection.reset();
  grid_only.derived.clear();  // may hold the bisected key
  auto grid = study_cells(grid_only);
  if (options.cell) {
    const auto wanted = grid.at(*options.cell);
    grid.assign(1, wanted);
  }
  std::vector<PreparedCell> first;
  first.reserve(grid.size());
  const std::optional<double> from =
      study.bisection ? std::optional<double>(study.bisection->from) : std::nullopt;
  for (const auto& cell : grid) first.push_back(store.prepare(study_cell(study, cell.steps, from)));
  const auto quantities = usable_quantities(study, first);
  if (!quantities) return ExitStatus::wrong_scene;
  if (options.slurm) return submit(study, options, grid.size());
  std::mutex mutex;
  std::size_t number = 0;
  const auto obtain = [&](PreparedCell& cell) {
    if (options.collect || !runner.run(cell)) return;
    const std::scoped_lock lock(mutex);
    const StudyRun& last = cell.runs.back();
    say(fmt::format("{} {}: {}, {:.3g} s{}", ++number, cell.cell.name(), last.status, last.wall_s,
                    last.message.empty() ? "" : ": " + last.message));
  };
  std::vector<StabilityMap> maps(grid.size());
  runner.for_each(grid.size(), [&](std::size_t k) {
    maps[k] = search_cell(study, store, grid[k].steps, *quantities, obtain);
  });
  if (options.cell) return interrupt ? ExitStatus::interrupted : ExitStatus::done;
  StabilityMap all{.quantities = *quantities, .runs = {}, .limits = {}};
  for (auto& map : maps) {
    std::move(map.runs.begin(), map.runs.end(), std::back_inserter(all.runs));
    std::move(map.limits.begin(), map.limits.end(), std::back_inserter(all.limits));
  }
  write_stability(study, all, options.folder);
  fmt::print("\n{}\n\n{}", study.title, stability_markdown(study, all));
  fmt::print("\npage: {}\n", (options.folder / "study.html").string());
  if (interrupt) return ExitStatus::interrupted;
  const auto lie = [](const StabilityRun& run) { return run.verdict.lie; };
  const bool lies = std::any_of(all.runs.begin(), all.runs.end(), lie);
  const auto status =
      options.against.empty()
          ? ExitStatus::done
          : compared(options, what_holds_less(study, all, options.against, options.allowed_growth));
  return lies ? ExitStatus::check_failed : status;
}

}  // namespace

ExitStatus run_study(const StudyOptions& given, const std::atomic<int>& interrupt) {
  const auto study = usable_study(given.study);
  if (!study) return ExitStatus::wrong_scene;
  StudyOptions options = given;
  if (options.folder.empty()) options.folder = std::filesystem::path("runs") / options.study.stem();
  std::filesystem::create_directories(options.folder);
  // Tasks of a job array begin while the one that submits them still stands.
  const bool beside = options.cell || options.slurm || options.collect;
  const FolderLock lock(options.folder, beside ? FolderLock::Kind::together : FolderLock::Kind::alone,
                        "study");
  const StudyStore store(options.folder, *study);
  const StudyRunner runner(store, {.jobs = options.jobs, .timeout_s = study->timeout_s}, interrupt, say);
  std::size_t tasks = 1;
  for (const auto& axis : study->axes) tasks *= axis.values.size();
  if (options.cell && *options.cell >= tasks) {
    fmt::print(stderr, "{}: there is no cell {}; it has {}, counted from 0\n", study->file.string(),
               *options.cell, tasks);
    return ExitStatus::wrong_scene;
  }
  if (options.retime && study->mode == StudyMode::stability) {
    fmt::print(stderr, "{}: --retime is for studies of errors; a map of stability has no times to compare\n",
               study->file.string());
    return ExitStatus::wrong_scene;
  }
  return study->mode == StudyMode::error ? ladder(*study, options, store, runner, interrupt)
                                         : stability(*study, options, store, runner, interrupt);
}

}  // namespace estuary::coupler
