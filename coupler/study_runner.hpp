// Runs the cells of a study, each as a process of its own: a run that breaks takes nobody along.
#pragma once

#include <atomic>
#include <functional>
#include <string>
#include <vector>

#include "study_store.hpp"

namespace estuary::coupler {

struct RunnerSettings {
  int jobs = 1;  // runs at the same time; more than one spoils the times
  double timeout_s = 3600;
};

class StudyRunner {
public:
  /// `say` is called with a line for a person after each run, from one thread at a time.
  StudyRunner(const StudyStore& store, RunnerSettings settings, const std::atomic<int>& interrupt,
              std::function<void(const std::string&)> say);

  /// Brings every cell to `repeats` runs: once round all cells, then once more, so that a machine that grows
  /// busy does not favour the first. Refused cells stay as they are, and what did not end well is not
  /// repeated. Returns early when interrupted; a run that is under way is then stopped and not kept.
  void run_all(std::vector<PreparedCell>& cells, int repeats) const;

  /// Calls `task` for 0 to `count` - 1 on as many threads as there are jobs.
  void for_each(std::size_t count, const std::function<void(std::size_t)>& task) const;

  /// Runs one cell once and keeps the run. False when interrupted.
  bool run(PreparedCell& cell) const;

private:
  const StudyStore& store_;
  RunnerSettings settings_;
  const std::atomic<int>& interrupt_;
  std::function<void(const std::string&)> say_;
};

}  // namespace estuary::coupler
