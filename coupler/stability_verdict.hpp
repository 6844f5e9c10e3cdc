// What a run at the edge of stability came to.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "study_result.hpp"

namespace estuary::coupler {

enum class StabilityClass {
  stable,      // carried to its end, every quantity within its tolerance and bounds
  inaccurate,  // carried to its end, some quantity beyond; without a warning this is a lie
  stalled,     // said that it does not converge, or found no end in the time allowed
  diverged,    // said that its solution grows beyond all bounds or is not finite
  lost,        // a process broke
  refused,     // not begun: the scene was found wrong
  not_run
};

const char* class_name(StabilityClass kind);

struct StabilityVerdict {
  StabilityClass kind = StabilityClass::not_run;
  bool lie =
      false;  // wrong beyond what the study allows, or not finite, and yet carried to its end with no warning
  std::string symptom;                  // the line a person was told, or the quantity that is off
  std::optional<std::uint64_t> window;  // in which a failure was noticed
  std::optional<double> time;           // its end [s], in transient mode
};

StabilityVerdict stability_verdict(const std::vector<StudyQuantity>& quantities, const StudyResult& result,
                                   const CouplingScene& scene);

}  // namespace estuary::coupler
