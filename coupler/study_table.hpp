// The tables of a study: study.csv for programs, study.md for a README.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "study_result.hpp"

namespace estuary::coupler {

/// One row per cell: what was varied, status, values, references, errors, times, work. RFC 4180; what is not
/// there is empty.
std::string study_csv(const StudyScene& study, const StudyResults& all);

/// The same for people, in Markdown: errors and times; the cheapest settings that keep below each limit.
std::string study_markdown(const StudyScene& study, const StudyResults& all);

/// For each of the study's limits the cheapest cell whose error is below it and stays there on the finer
/// steps of its line: errors change their sign somewhere and look small there. Null where there is none.
std::vector<const StudyResult*> cheapest_cells(const StudyScene& study, const StudyResults& all);

/// Rows of a CSV file with a line of names, each as name -> text. Throws std::runtime_error when it cannot be
/// read.
std::vector<std::map<std::string, std::string>> read_csv_rows(const std::filesystem::path& file);

/// Cells that were carried to their end in the earlier study.csv `before` and are not now, or whose error of
/// a quantity grew by more than `allowed` (relative), one line each.
std::vector<std::string> what_grew_worse(const StudyScene& study, const StudyResults& all,
                                         const std::filesystem::path& before, double allowed);

/// A row of a table in Markdown.
std::string markdown_row(const std::vector<std::string>& entries);

/// An entry of a CSV file, quoted where it has to be.
std::string csv_entry(const std::string& text);

/// "0.42 %", "3.1e-06 %", "-" for what is not there.
std::string percent_text(double share);
/// "1.23", "-" for what is not there.
std::string seconds_text(double seconds);

}  // namespace estuary::coupler
