#include "study_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <stdexcept>

#include "study_expression.hpp"

namespace estuary::coupler {
namespace {

/// Size of a step without an expression of its own: the first number among its values where these fall from
/// step to step (a spacing), its inverse where they rise (a count).
std::optional<double> size_of(const StudyAxis& axis, std::size_t step) {
  for (std::size_t key = 0; key < axis.keys.size(); ++key) {
    if (axis.keys[key].starts_with("let.")) continue;
    std::vector<double> values;
    for (const auto& entries : axis.values) {
      if (const auto value = number_of(entries[key]); value && *value > 0) values.push_back(*value);
    }
    if (values.size() != axis.values.size() || values.size() < 2) continue;
    const bool falls = std::is_sorted(values.rbegin(), values.rend());
    const bool rises = std::is_sorted(values.begin(), values.end());
    if (falls == rises || std::adjacent_find(values.begin(), values.end()) != values.end()) continue;
    return falls ? values[step] : 1.0 / values[step];
  }
  return std::nullopt;
}

void derive(const StudyScene& study, StudyCell& cell) {
  try {
    for (const auto& [key, expression] : study.derived) {
      const double value = evaluate_expression(expression, cell.variables);
      // Whole numbers as such: counts are refused when they come with a point.
      const bool whole = value == std::round(value) && std::abs(value) < 1e15;
      if (!key.starts_with("let."))
        cell.settings.push_back(whole ? fmt::format("{}={:.0f}", key, value)
                                      : fmt::format("{}={:.17g}", key, value));
      cell.variables[variable_name(key)] = value;
    }
    if (!study.axes.empty() && study.axes.front().size)
      cell.size = evaluate_expression(*study.axes.front().size, cell.variables);
  } catch (const std::invalid_argument& error) {
    cell.problem = error.what();
  }
}

}  // namespace

std::string StudyCell::series() const {
  std::string text;
  for (std::size_t k = 1; k < labels.size(); ++k) text += (k == 1 ? "" : ", ") + labels[k];
  return text;
}

std::string StudyCell::name() const {
  std::string text = fmt::format("{}", fmt::join(labels, "; "));
  if (bisected) text += fmt::format("{}{:.6g}", text.empty() ? "" : "; ", *bisected);
  return text;
}

std::string unquoted(const std::string& toml) {
  const bool quoted =
      toml.size() > 1 && (toml.front() == '"' || toml.front() == '\'') && toml.back() == toml.front();
  return quoted ? toml.substr(1, toml.size() - 2) : toml;
}

std::optional<double> number_of(const std::string& toml) {
  std::string text;
  std::copy_if(toml.begin(), toml.end(), std::back_inserter(text), [](char c) { return c != '_'; });
  if (text.starts_with('+')) text.erase(0, 1);
  double value = 0;
  const auto* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  return error == std::errc{} && stop == end && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

StudyCell study_cell(const StudyScene& study, std::vector<std::size_t> steps,
                     std::optional<double> bisected) {
  StudyCell cell;
  cell.steps = std::move(steps);
  cell.bisected = bisected;
  cell.settings = study.fixed;
  for (const auto& setting : study.fixed) {
    const auto equals = setting.find('=');
    if (const auto value = number_of(setting.substr(equals + 1)))
      cell.variables[variable_name(setting.substr(0, equals))] = *value;
  }
  for (std::size_t k = 0; k < study.axes.size(); ++k) {
    const StudyAxis& axis = study.axes[k];
    cell.labels.push_back(axis.labels[cell.steps[k]]);
    for (std::size_t key = 0; key < axis.keys.size(); ++key) {
      const auto& text = axis.values[cell.steps[k]][key];
      if (const auto value = number_of(text)) cell.variables[variable_name(axis.keys[key])] = *value;
      if (text == "''" || text == "\"\"") continue;  // as in the scene
      if (!axis.keys[key].starts_with("let."))
        cell.settings.push_back(fmt::format("{}={}", axis.keys[key], text));
    }
  }
  if (!study.axes.empty()) cell.size = size_of(study.axes.front(), cell.steps.front());
  if (study.bisection && bisected) {
    cell.variables[variable_name(study.bisection->key)] = *bisected;
    if (!study.bisection->key.starts_with("let."))
      cell.settings.push_back(fmt::format("{}={:.17g}", study.bisection->key, *bisected));
  }
  derive(study, cell);
  return cell;
}

std::vector<StudyCell> study_cells(const StudyScene& study) {
  std::vector<StudyCell> cells;
  std::vector<std::size_t> steps(study.axes.size(), 0);
  while (true) {
    cells.push_back(study_cell(study, steps));
    std::size_t axis = 0;
    while (axis < steps.size() && ++steps[axis] == study.axes[axis].values.size()) steps[axis++] = 0;
    if (axis == steps.size()) return cells;
  }
}

}  // namespace estuary::coupler
