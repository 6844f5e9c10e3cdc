// Drives one participant through its whole life, as the contract describes it and a little beside it, and
// says what holds. For whoever writes a solver, and for the solvers of this house.
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "failure.hpp"
#include "plan.hpp"

namespace estuary::coupler {

struct ConformTarget {
  std::string endpoint;              // of a running participant, or
  std::vector<std::string> command;  // launches one
  std::string role;                  // empty: only what can be asked without a scene
  double timeout = 60;               // longest wait for an answer [s]
  double pressure = 1.0;             // loads a solid [Pa]
  std::filesystem::path folder;      // for what participants write
};

enum class Conforms { yes, no, unsupported, not_asked };

struct Finding {
  std::string what;
  Conforms conforms = Conforms::yes;
  std::string detail;
};

struct Examination {
  std::string participant;  // name, version, address
  std::vector<Finding> findings;
  bool lost = false;  // it stopped answering; what came after was not asked
};

/// `scene` is null when the role is empty. Throws RunFailure when the participant, or another one whose
/// surface or grains it needs, cannot be started.
Examination examine(const CheckedScene* scene, const ConformTarget& target,
                    const std::atomic<int>& interrupt);

/// The table.
std::string text_of(const Examination& examination);
/// done, check_failed, or participant_lost.
ExitStatus status_of(const Examination& examination);

}  // namespace estuary::coupler
