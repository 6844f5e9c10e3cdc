// The picture of a flow: speed with streamlines, and pressure, of a frame, with the solid and its wet
// surface on top.
#pragma once

#include <filesystem>
#include <string>

#include "gnuplot.hpp"

namespace estuary::coupler {

struct Picture {
  std::filesystem::path file;
  std::string caption;
};

enum class WhichFrame { first, last };

/// Reads the first or last frames of fluid and solid below `run_folder` and draws `picture` (PNG). Files it
/// needs meanwhile go to `work_folder`. In a `steady` run the time of a frame is an iteration. Throws
/// std::runtime_error with a sentence for the reader when there is nothing to draw.
Picture draw_flow(const std::filesystem::path& run_folder, const std::filesystem::path& picture,
                  const std::filesystem::path& work_folder, bool steady, const Gnuplot& gnuplot,
                  WhichFrame which = WhichFrame::last);

}  // namespace estuary::coupler
