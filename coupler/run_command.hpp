// `coupler run`: a scene from its text to its summary.
#pragma once

#include <atomic>
#include <filesystem>

#include "failure.hpp"
#include "plan.hpp"

namespace estuary::coupler {

/// Runs a checked scene and leaves everything in `folder` (made when missing). Prints the checks and times.
/// `resume`: goes on from the newest checkpoint there, from the beginning when there is none. `interrupts`
/// counts signals: the first lets the window under way be finished and saved when that takes no longer than
/// two seconds. `report`: makes the page of the run at its end. Never throws for what a run may meet: the
/// exit status says how it ended.
ExitStatus run_scene(const CheckedScene& scene, const std::filesystem::path& folder, bool resume,
                     const std::atomic<int>& interrupts, bool report = true);

}  // namespace estuary::coupler
