// study.html: one self-contained page of a study.
#pragma once

#include <filesystem>

#include "report_page.hpp"
#include "study_result.hpp"

namespace estuary::coupler {

/// Writes study.csv, study.md, study.svg, study.png and study.html into `folder`. Without gnuplot, or with no
/// error to draw, the page says so instead of its pictures. Throws std::runtime_error when a file cannot be
/// written.
void write_study(const StudyScene& study, const StudyResults& all, const std::filesystem::path& folder);

/// What every page of a study ends with: the machine, the study and its scene; writes it to study.html.
/// Throws std::runtime_error when it cannot be written.
void finish_study_page(ReportPage& page, const StudyScene& study, const std::filesystem::path& folder);

}  // namespace estuary::coupler
