// Reads the tables a run leaves: a line of names, then lines of numbers.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace estuary::coupler {

struct CsvFile {
  std::vector<std::string> names;
  std::vector<std::vector<double>> columns;  // what is not a number is not-a-number
  /// The column of that name; null when there is none.
  [[nodiscard]] const std::vector<double>* column(std::string_view name) const;
  [[nodiscard]] std::size_t rows() const { return columns.empty() ? 0 : columns.front().size(); }
};

/// Nothing when the file is missing or empty. A line with another number of entries than there are names is
/// left out: it is the one that was being written when the run ended.
std::optional<CsvFile> read_csv(const std::filesystem::path& file);

}  // namespace estuary::coupler
