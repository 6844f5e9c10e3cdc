// summary.json: what was measured in a run, for people and programs.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "checks.hpp"
#include "participants.hpp"
#include "plan.hpp"
#include "run_record.hpp"

namespace estuary::coupler {

struct RunEnd {
  std::string
      status;  // "done", "check failed", "diverged or not converged", "participant lost", "interrupted"
  std::string message;   // the line a person was told; empty when done
  double wall_s = 0;     // with that of the runs it goes on from
  double coupler_s = 0;  // spent by the coupler itself between the messages of the windows
  std::uint64_t total_iterations = 0;
  std::optional<std::uint64_t> resumed_from = {};  // window
  std::uint64_t relaunches = 0;
  double recovery_s = 0;  // from a loss until everyone was back
  std::uint64_t checkpoints = 0;
  double checkpoint_s = 0;
};

/// `participants` may be null when none could be launched. Throws std::runtime_error when it cannot be
/// written.
void write_summary(const std::filesystem::path& folder, const CheckedScene& scene,
                   const Participants* participants, const RecordedRun& record,
                   const std::vector<CheckResult>& checks, const RunEnd& end);

/// Phase times, updates per second and memory of each participant, for the end of the run.
std::string timing_table(const Participants& participants, const RunEnd& end);

}  // namespace estuary::coupler
