// The tables and the page of a map of stability.
#pragma once

#include <filesystem>

#include "stability_search.hpp"

namespace estuary::coupler {

/// Writes study.csv (every run), limits.csv (with [bisect]), study.md, study.svg, study.png and study.html.
/// Throws std::runtime_error when a file cannot be written.
void write_stability(const StudyScene& study, const StabilityMap& map, const std::filesystem::path& folder);

/// Cells that were stable in the earlier study.csv and are not now, or, with [bisect], limits that came
/// nearer to where the bisection begins than in the earlier limits.csv by more than `allowed` (relative), one
/// line each.
std::vector<std::string> what_holds_less(const StudyScene& study, const StabilityMap& map,
                                         const std::filesystem::path& before, double allowed);

/// Limits, or classes, in Markdown.
std::string stability_markdown(const StudyScene& study, const StabilityMap& map);

}  // namespace estuary::coupler
