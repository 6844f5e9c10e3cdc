#include "study_table.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

std::string number_text(double value) {
  return std::isfinite(value) ? fmt::format("{:.10g}", value) : std::string();
}

/// Columns that tell the cells apart: label of each axis, then its keys where the label is not their value.
std::vector<std::pair<std::string, std::string>> names_of_cell(const StudyScene& study,
                                                               const StudyCell& cell) {
  std::vector<std::pair<std::string, std::string>> columns;
  for (std::size_t k = 0; k < study.axes.size(); ++k) {
    const StudyAxis& axis = study.axes[k];
    columns.emplace_back(axis.name, cell.labels[k]);
    if (axis.keys.size() == 1 && axis.keys.front() == axis.name) continue;
    for (std::size_t key = 0; key < axis.keys.size(); ++key)
      columns.emplace_back(axis.keys[key], unquoted(axis.values[cell.steps[k]][key]));
  }
  if (study.bisection) columns.emplace_back(study.bisection->key, number_text(cell.bisected.value_or(NAN)));
  return columns;
}

std::vector<std::pair<std::string, std::string>> figures_of(const StudyResults& all,
                                                            const StudyResult& result) {
  std::vector<std::pair<std::string, std::string>> columns{{"status", result.status}};
  columns.insert(columns.end(), result.judged.begin(), result.judged.end());
  for (std::size_t q = 0; q < all.quantities.size(); ++q) {
    const auto& quantity = result.quantities.empty() ? QuantityResult{} : result.quantities[q];
    columns.emplace_back(all.quantities[q].name, number_text(quantity.value));
    columns.emplace_back(all.quantities[q].name + " reference", number_text(quantity.reference));
    columns.emplace_back(all.quantities[q].name + " error", number_text(quantity.error));
  }
  columns.insert(columns.end(), {{"error", number_text(result.error)},
                                 {"on_front", result.on_front ? "1" : "0"},
                                 {"wall_s", number_text(result.wall_s)},
                                 {"wall_min_s", number_text(result.wall_min_s)},
                                 {"wall_max_s", number_text(result.wall_max_s)},
                                 {"processor_s", number_text(result.processor_s)},
                                 {"runs", fmt::format("{}", result.runs)},
                                 {"load", number_text(result.load)},
                                 {"beside", fmt::format("{}", result.beside)},
                                 {"windows", number_text(result.windows)},
                                 {"iterations", number_text(result.iterations)},
                                 {"iterations_per_window", number_text(result.iterations_per_window)},
                                 {"steps", number_text(result.steps)},
                                 {"updates", number_text(result.updates)},
                                 {"compute_s", number_text(result.compute_s)},
                                 {"peak_rss_bytes", number_text(result.peak_rss_bytes)},
                                 {"message", result.message}});
  return columns;
}

std::string csv_line(const std::vector<std::string>& entries) {
  std::string line;
  for (std::size_t k = 0; k < entries.size(); ++k) line += (k == 0 ? "" : ",") + csv_entry(entries[k]);
  return line + "\n";
}

std::string wall_text(const StudyResult& result) {
  if (result.runs < 2) return seconds_text(result.wall_s);
  return fmt::format("{} ({} to {})", seconds_text(result.wall_s), seconds_text(result.wall_min_s),
                     seconds_text(result.wall_max_s));
}

double number_of_entry(const std::map<std::string, std::string>& row, const std::string& name) {
  const auto found = row.find(name);
  double value = NAN;
  if (found != row.end())
    std::from_chars(found->second.data(), found->second.data() + found->second.size(), value);
  return value;
}

}  // namespace

std::string csv_entry(const std::string& text) {
  if (text.find_first_of(",\"\n\r") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"') quoted += c;
    quoted += c;
  }
  return quoted + '"';
}

std::string markdown_row(const std::vector<std::string>& entries) {
  std::string row = "|";
  for (auto entry : entries) {
    std::replace(entry.begin(), entry.end(), '|', '/');
    std::replace(entry.begin(), entry.end(), '\n', ' ');
    row += " " + entry + " |";
  }
  return row + "\n";
}

std::string percent_text(double share) {
  if (!std::isfinite(share)) return "-";
  const double percent = 100 * share;
  return percent != 0 && percent < 0.001 ? fmt::format("{:.1e} %", percent)
                                         : fmt::format("{:.2g} %", percent);
}

std::string seconds_text(double seconds) {
  if (!std::isfinite(seconds)) return "-";
  return seconds >= 100 ? fmt::format("{:.0f}", seconds) : fmt::format("{:.3g}", seconds);
}

std::string study_csv(const StudyScene& study, const StudyResults& all) {
  std::string text;
  for (const auto& result : all.results) {
    auto columns = names_of_cell(study, result.cell);
    const auto figures = figures_of(all, result);
    columns.insert(columns.end(), figures.begin(), figures.end());
    std::vector<std::string> names;
    std::vector<std::string> entries;
    for (const auto& [name, entry] : columns) {
      names.push_back(name);
      entries.push_back(entry);
    }
    if (text.empty()) text = csv_line(names);
    text += csv_line(entries);
  }
  return text;
}

std::vector<const StudyResult*> cheapest_cells(const StudyScene& study, const StudyResults& all) {
  std::vector<const StudyResult*> cheapest;
  for (const double limit : study.limits) {
    const StudyResult* best = nullptr;
    for (const auto& series : all.series) {
      // From the finest step back, as long as every error is below the limit.
      for (auto k = series.results.rbegin(); k != series.results.rend(); ++k) {
        const StudyResult& result = all.results[*k];
        if (!std::isfinite(result.error) && k == series.results.rbegin() && result.finished) continue;
        if (!(result.error <= limit)) break;
        if (best == nullptr || result.cost_s < best->cost_s) best = &result;
      }
    }
    cheapest.push_back(best);
  }
  return cheapest;
}

std::string study_markdown(const StudyScene& study, const StudyResults& all) {
  std::vector<std::string> names;
  for (const auto& axis : study.axes) names.push_back(axis.name);
  for (const auto& quantity : all.quantities) {
    names.push_back(quantity.name);
    names.emplace_back("error");
  }
  for (const auto* name : {"wall time [s]", "processor time [s]", "updates", "iterations per window"})
    names.emplace_back(name);
  std::string text = markdown_row(names) + markdown_row(std::vector<std::string>(names.size(), "---"));
  for (const auto& result : all.results) {
    std::vector<std::string> row = result.cell.labels;
    if (result.finished) {
      for (const auto& quantity : result.quantities) {
        row.push_back(std::isfinite(quantity.value) ? fmt::format("{:.5g}", quantity.value) : "missing");
        row.push_back(percent_text(quantity.error));
      }
    } else {
      row.push_back(result.status);
      row.resize(row.size() + 2 * all.quantities.size() - std::min<std::size_t>(1, all.quantities.size()));
    }
    row.push_back(wall_text(result));
    row.push_back(seconds_text(result.processor_s));
    row.push_back(result.updates > 0 ? fmt::format("{:.3g}", result.updates) : "-");
    row.push_back(result.iterations_per_window > 0 ? fmt::format("{:.3g}", result.iterations_per_window)
                                                   : "-");
    text += markdown_row(row);
  }
  std::string orders;
  for (const auto& series : all.series) {
    for (std::size_t q = 0; q < series.orders.size(); ++q) {
      if (!series.orders[q]) continue;
      orders += fmt::format("{}{}{} {:.1f}", orders.empty() ? "" : ", ", all.quantities[q].name,
                            series.name.empty() ? "" : " (" + series.name + ")", *series.orders[q]);
    }
  }
  if (!orders.empty()) text += fmt::format("\nObserved order: {}.\n", orders);
  const auto cheapest = cheapest_cells(study, all);
  std::string costs;
  for (std::size_t k = 0; k < cheapest.size(); ++k) {
    if (cheapest[k] == nullptr) continue;
    costs += fmt::format("{}{:g} %: {}, {} s", costs.empty() ? "" : "; ", 100 * study.limits[k],
                         cheapest[k]->cell.name(), seconds_text(cheapest[k]->cost_s));
  }
  if (!costs.empty()) text += fmt::format("\nCheapest below {}.\n", costs);
  for (const auto& note : all.notes) text += fmt::format("\n{}\n", note);
  return text;
}

std::vector<std::map<std::string, std::string>> read_csv_rows(const std::filesystem::path& file) {
  const std::string text = read_whole(file);
  if (text.empty()) throw std::runtime_error(fmt::format("{} cannot be read", file.string()));
  std::vector<std::vector<std::string>> lines(1, {""});
  bool quoted = false;
  for (std::size_t k = 0; k < text.size(); ++k) {
    const char c = text[k];
    if (quoted && c == '"' && k + 1 < text.size() && text[k + 1] == '"') {
      lines.back().back() += text[++k];
    } else if (c == '"') {
      quoted = !quoted;
    } else if (!quoted && c == ',') {
      lines.back().emplace_back();
    } else if (!quoted && c == '\n') {
      lines.push_back({""});
    } else if (quoted || c != '\r') {
      lines.back().back() += c;
    }
  }
  std::vector<std::map<std::string, std::string>> rows;
  for (std::size_t k = 1; k < lines.size(); ++k) {
    if (lines[k].size() != lines.front().size()) continue;
    auto& row = rows.emplace_back();
    for (std::size_t column = 0; column < lines[k].size(); ++column)
      row[lines.front()[column]] = lines[k][column];
  }
  return rows;
}

std::vector<std::string> what_grew_worse(const StudyScene& study, const StudyResults& all,
                                         const std::filesystem::path& before, double allowed) {
  constexpr double round_off = 1e-9;  // errors below are those of the machine's arithmetic
  const auto rows = read_csv_rows(before);
  std::vector<std::string> worse;
  for (const auto& result : all.results) {
    const auto names = names_of_cell(study, result.cell);
    const auto same = std::find_if(rows.begin(), rows.end(), [&](const auto& row) {
      return std::all_of(names.begin(), names.end(), [&](const auto& column) {
        const auto entry = row.find(column.first);
        return entry != row.end() && entry->second == column.second;
      });
    });
    if (same == rows.end() || result.status == "not run") continue;
    const auto status = same->find("status");
    const bool finished =
        status != same->end() && (status->second == "done" || status->second == "check failed");
    if (!finished) continue;
    if (!result.finished) {
      worse.push_back(fmt::format("{}: {} now, {} before: {}", result.cell.name(), result.status,
                                  status->second, result.message));
      continue;
    }
    for (std::size_t q = 0; q < all.quantities.size(); ++q) {
      const double old_error = number_of_entry(*same, all.quantities[q].name + " error");
      const double error = result.quantities[q].error;
      if (!std::isfinite(old_error)) continue;
      if (!(error <= old_error * (1 + allowed) + round_off)) {
        worse.push_back(fmt::format("{}: the error of {} was {} and is {}", result.cell.name(),
                                    all.quantities[q].name, percent_text(old_error), percent_text(error)));
      }
    }
  }
  return worse;
}

}  // namespace estuary::coupler
