// What a study keeps of each of its cells, so that nothing is run twice: a folder per cell, named by a
// fingerprint of everything its result depends on, with cell.json and what the last run left.
#pragma once

#include <filesystem>
#include <map>
#include <mutex>
#include <string>
#include <vector>

#include "plan.hpp"
#include "study_grid.hpp"

namespace estuary::coupler {

/// One run that came to an end.
struct StudyRun {
  int exit_status = 0;     // of `coupler run`; -1 when it was stopped at the study's time limit
  std::string status;      // as in summary.json, or "refused", "time limit", "ended without a summary"
  std::string message;     // the line a person was told; empty when done
  double wall_s = 0;       // of the run, as the coupler measured it
  double processor_s = 0;  // of all its processes
  double load = 0;         // of the machine (one minute's mean) when it began
  int beside = 1;          // runs of this study at the same time

  /// It was carried to its end: done, or done with a check of the scene that does not hold.
  [[nodiscard]] bool finished() const { return exit_status == 0 || exit_status == 1; }
};

/// A cell that has been looked at: what would be launched, or why it is refused.
struct PreparedCell {
  StudyCell cell;
  CheckedScene scene;
  std::string fingerprint;
  std::string refused;  // all problems in one line; empty when it can be run
  std::vector<StudyRun> runs;
};

class StudyStore {
public:
  /// `folder` is the study's; made when absent. Throws std::runtime_error when it cannot be.
  StudyStore(const std::filesystem::path& folder, const StudyScene& study);

  /// Checks the scene with the cell's settings and finds the runs it has already. The fingerprint holds the
  /// scene as it would be run and the programs that would run it, byte by byte.
  [[nodiscard]] PreparedCell prepare(StudyCell cell) const;
  /// Keeps a run that has just ended, its files being in `running(cell)`.
  void keep(PreparedCell& cell, StudyRun run) const;

  [[nodiscard]] std::filesystem::path folder_of(const PreparedCell& cell) const;
  /// Where the next run of the cell writes.
  [[nodiscard]] std::filesystem::path running(const PreparedCell& cell) const;
  /// What the last finished run of the cell left.
  [[nodiscard]] std::filesystem::path finished(const PreparedCell& cell) const;

private:
  /// Of a program's content; each is read once.
  const std::string& program_print(const std::filesystem::path& program) const;
  [[nodiscard]] std::string fingerprint_of(const CheckedScene& scene) const;

  std::filesystem::path cells_;
  std::filesystem::path scene_;
  std::string scene_text_;
  mutable std::mutex mutex_;
  mutable std::map<std::string, std::string> program_prints_;
};

}  // namespace estuary::coupler
