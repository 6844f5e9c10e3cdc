#include "csv_file.hpp"

#include <algorithm>
#include <charconv>
#include <fstream>
#include <limits>

namespace estuary::coupler {
namespace {

std::vector<std::string> split(const std::string& line) {
  std::vector<std::string> entries;
  for (std::size_t begin = 0;;) {
    const std::size_t comma = line.find(',', begin);
    entries.push_back(line.substr(begin, comma == std::string::npos ? comma : comma - begin));
    if (comma == std::string::npos) return entries;
    begin = comma + 1;
  }
}

double number(const std::string& text) {
  double value = 0;
  const auto* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc{} && stop == end ? value : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace

const std::vector<double>* CsvFile::column(std::string_view name) const {
  const auto place = std::find(names.begin(), names.end(), name);
  return place == names.end() ? nullptr : &columns[static_cast<std::size_t>(place - names.begin())];
}

std::optional<CsvFile> read_csv(const std::filesystem::path& file) {
  std::ifstream stream(file);
  std::string line;
  if (!std::getline(stream, line) || line.empty()) return std::nullopt;
  CsvFile result;
  result.names = split(line);
  result.columns.resize(result.names.size());
  while (std::getline(stream, line)) {
    const auto entries = split(line);
    if (entries.size() != result.names.size()) continue;
    for (std::size_t i = 0; i < entries.size(); ++i) result.columns[i].push_back(number(entries[i]));
  }
  return result;
}

}  // namespace estuary::coupler
