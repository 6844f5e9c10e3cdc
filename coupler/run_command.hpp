// `coupler run`: a scene from its text to its summary.
#pragma once

#include <atomic>
#include <filesystem>

#include "failure.hpp"
#include "plan.hpp"

namespace estuary::coupler {

/// Runs a checked scene and leaves everything in `folder` (made when missing). Prints the checks and times.
/// `interrupt` is set by a signal. Never throws for what a run may meet: the exit status says how it ended.
ExitStatus run_scene(const CheckedScene& scene, const std::filesystem::path& folder,
                     const std::atomic<bool>& interrupt);

}  // namespace estuary::coupler
