// The ways a run can end other than well, each with the exit status of the command.
#pragma once

#include <stdexcept>
#include <string>
#include <utility>

namespace estuary::coupler {

enum class ExitStatus : int {
  done = 0,
  check_failed = 1,
  wrong_scene = 2,  // scene or command line; nothing was launched
  no_solution = 3,  // diverged or did not converge
  participant_lost = 4,
  interrupted = 130
};

/// One line says who, when and what; `advice` what to try. `curable`: everyone is well and the same window
/// may succeed with smaller steps. `lost`: a process is gone or of no use any more, and another in its place
/// may do.
struct RunFailure : std::runtime_error {
  RunFailure(ExitStatus exit_status, const std::string& line, std::string advice_text = {},
             bool can_be_cured = false)
      : std::runtime_error(line),
        status(exit_status),
        advice(std::move(advice_text)),
        curable(can_be_cured) {}
  ExitStatus status;
  std::string advice;
  bool curable;
  bool lost = false;
};

/// A participant that died, hangs or sends nonsense.
inline RunFailure loss(const std::string& line, std::string advice_text = {}) {
  RunFailure failure(ExitStatus::participant_lost, line, std::move(advice_text));
  failure.lost = true;
  return failure;
}

}  // namespace estuary::coupler
