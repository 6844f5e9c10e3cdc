// Pictures of a map of stability.
#pragma once

#include <filesystem>

#include "gnuplot.hpp"
#include "stability_search.hpp"

namespace estuary::coupler {

/// Without bisection: a coloured field for each cell of the grid. With one axis and bisection: every run over
/// axis and bisected key, and the limit between. With two: the limit as a heat map. Writes `stem`.svg and
/// `stem`.png. Throws std::runtime_error when gnuplot fails or nothing was run.
void draw_stability(const StudyScene& study, const StabilityMap& map, const std::filesystem::path& stem,
                    const Gnuplot& gnuplot);

/// Colour of a class, "#rrggbb".
const char* class_colour(StabilityClass kind, bool lie);

}  // namespace estuary::coupler
