// Pictures of a study: error against its cost (wall time, or processor time on a busy machine), and against
// resolution.
#pragma once

#include <filesystem>
#include <optional>

#include "gnuplot.hpp"
#include "study_result.hpp"

namespace estuary::coupler {

enum class StudyAbscissa { cost, size };

/// Log-log, a line for each series with its observed order, bars from the shortest to the longest run; over
/// cost the front of cells that no other beats in both is ringed. Of one quantity, or of the largest
/// error when `quantity` is absent. Writes `stem`.svg and `stem`.png. Throws std::runtime_error when there is
/// nothing to draw or gnuplot fails.
void draw_study(const StudyResults& all, std::optional<std::size_t> quantity, StudyAbscissa abscissa,
                const std::filesystem::path& stem, const Gnuplot& gnuplot);

/// Both pictures of one script.
void draw_svg_and_png(const std::string& script, unsigned width, unsigned height,
                      const std::filesystem::path& stem, const Gnuplot& gnuplot);

}  // namespace estuary::coupler
