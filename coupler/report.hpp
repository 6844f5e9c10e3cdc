// `coupler report DIR`: one self-contained HTML page of a run.
#pragma once

#include <filesystem>

namespace estuary::coupler {

/// Reads what the run left in `run_folder` and writes report.html and the pictures in report/ there. What is
/// missing (frames, the plotting program) is said in the page. Throws std::runtime_error when there is no
/// summary or the page cannot be written.
void write_report(const std::filesystem::path& run_folder);

}  // namespace estuary::coupler
