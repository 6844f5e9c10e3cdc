#include "study_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "study_expression.hpp"
#include "study_grid.hpp"
#include "toml.hpp"

namespace estuary::coupler {
namespace {

constexpr std::string_view variables_only = "let.";  // [[vary]] let.NAME: no key of the scene

void note(std::vector<SceneProblem>& problems, const toml::node& node, std::string message) {
  const auto& begin = node.source().begin;
  problems.push_back({.line = begin.line, .column = begin.column, .message = std::move(message)});
}

/// A value as an override can be given it. toml++ itself breaks long arrays into lines.
std::string one_line(const toml::node& value) {
  if (const auto* array = value.as_array()) {
    std::string text = "[";
    for (const auto& entry : *array) text += (text.size() > 1 ? ", " : "") + one_line(entry);
    return text + "]";
  }
  if (const auto* number = value.as_floating_point(); number != nullptr && std::isfinite(number->get())) {
    // The shortest text that gives the same number back, still a number with a point.
    auto text = fmt::format("{}", number->get());
    return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
  }
  std::ostringstream stream;
  value.visit([&](const auto& entry) { stream << toml::toml_formatter(entry); });
  return stream.str();
}

/// Walks a table of keys of the scene down to its values: `visit(path, value)` for each.
template <typename Visit>
void for_each_value(const toml::table& table, const std::string& path, const Visit& visit) {
  for (auto&& [key, value] : table) {
    const auto whole = path.empty() ? std::string(key.str()) : fmt::format("{}.{}", path, key.str());
    if (const auto* below = value.as_table()) {
      for_each_value(*below, whole, visit);
    } else {
      visit(whole, value);
    }
  }
}

void read_values(const toml::table& table, StudyAxis& axis, std::vector<SceneProblem>& problems) {
  for_each_value(table, "", [&](const std::string& path, const toml::node& value) {
    if (path == "name" || path == "labels" || path == "size") return;
    const auto* entries = value.as_array();
    if (entries == nullptr) {
      note(problems, value, fmt::format("'{}' needs a list of the values to run with, [a, b, ...]", path));
    } else if (entries->empty()) {
      note(problems, value, fmt::format("the list of '{}' is empty: there would be nothing to run", path));
    } else if (!axis.keys.empty() && entries->size() != axis.values.size()) {
      note(problems, value,
           fmt::format("'{}' has {} values and '{}' has {}; what is varied together needs as many", path,
                       entries->size(), axis.keys.front(), axis.values.size()));
    } else {
      axis.values.resize(entries->size());
      for (std::size_t step = 0; step < entries->size(); ++step)
        axis.values[step].push_back(one_line((*entries)[step]));
      axis.keys.push_back(path);
    }
  });
}

std::string label_of(const std::string& toml) {
  const auto number = number_of(toml);
  return number ? fmt::format("{:.6g}", *number) : unquoted(toml);
}

StudyAxis read_axis(SceneTable& table, const toml::table& varied, std::vector<SceneProblem>& problems) {
  for (const auto& key : table.keys()) table.leave_to_others({key});  // its other keys are the scene's
  StudyAxis axis;
  axis.name = table.text_or("name", "");
  axis.labels = table.texts_or_empty("labels");
  if (table.has("size")) axis.size = table.expression("size");
  const std::size_t before = problems.size();
  read_values(varied, axis, problems);
  if (axis.keys.empty()) {
    if (problems.size() > before) return axis;  // there was one, and what is wrong with it has been said
    table.problem("",
                  "a [[vary]] needs a key of the scene with the list of its values, fluid.spacing = [...]");
    return axis;
  }
  if (axis.name.empty()) axis.name = axis.keys.front();
  if (!axis.labels.empty() && axis.labels.size() != axis.values.size()) {
    table.problem("labels",
                  fmt::format("there are {} labels for {} values", axis.labels.size(), axis.values.size()));
  }
  if (axis.labels.size() != axis.values.size()) {
    axis.labels.clear();
    for (const auto& values : axis.values) {
      std::string label;
      for (const auto& value : values) label += (label.empty() ? "" : ", ") + label_of(value);
      axis.labels.push_back(label);
    }
  }
  for (std::size_t k = 0; k < axis.labels.size(); ++k) {
    if (std::find(axis.labels.begin(), axis.labels.begin() + static_cast<std::ptrdiff_t>(k),
                  axis.labels[k]) != axis.labels.begin() + static_cast<std::ptrdiff_t>(k)) {
      table.problem("labels", fmt::format("'{}' is there twice", axis.labels[k]));
    }
  }
  return axis;
}

void read_reference(SceneTable& table, StudyQuantity& quantity) {
  const int sources = int{table.has("reference")} + int{table.has("other")} + int{table.has("exact")} +
                      int{table.has("finest")};
  if (sources > 1)
    table.problem("", "one of `reference`, `other`, `exact` and `finest` is the reference, not several");
  if (table.has("reference")) quantity.reference = table.number("reference");
  if (table.has("other")) quantity.other = table.text("other");
  if (table.has("exact")) quantity.exact = table.expression("exact");
  quantity.finest = table.boolean_or("finest", false);
  if (table.has("order")) {
    quantity.order = table.number("order", Range::positive());
    if (!quantity.finest)
      table.problem("order", "belongs to `finest = true`, whose limit it extrapolates to");
  }
  if (table.has("scale")) quantity.scale = table.number("scale", Range::positive());
  if (quantity.reference == 0.0 && !quantity.scale) {
    table.problem("reference",
                  "an error relative to 0 means nothing; give `scale`, what the error is to be divided by "
                  "(1 for the plain difference)");
  }
}

StudyQuantity read_quantity(SceneTable& table, StudyMode mode) {
  StudyQuantity quantity;
  quantity.name = table.text("name");
  quantity.source = table.text_or("source", "");
  read_reference(table, quantity);
  if (mode == StudyMode::stability) {
    if (table.has("at_most")) quantity.at_most = table.number("at_most");
    if (table.has("at_least")) quantity.at_least = table.number("at_least");
    quantity.tolerance = table.number_or("tolerance", 0.1, Range::positive());
    quantity.lie = table.number_or("lie", quantity.tolerance, Range::positive());
    if (quantity.finest) table.problem("finest", "a stability study has no ladder; give another reference");
    if (quantity.lie < quantity.tolerance) table.problem("lie", "is smaller than `tolerance`");
  }
  if (!quantity.name.empty() && quantity.name.find('.') == std::string::npos) {
    table.problem("name",
                  fmt::format("'{}' is not WATCH.QUANTITY, as in a [[check]] of a scene", quantity.name));
  }
  return quantity;
}

StudyBisection read_bisection(SceneTable table) {
  StudyBisection bisection;
  bisection.key = table.text("key");
  bisection.from = table.number("from");
  bisection.to = table.number("to");
  constexpr std::array<std::string_view, 2> scales = {"logarithmic", "linear"};
  bisection.logarithmic = table.choice("scale", scales) == "logarithmic";
  bisection.resolution =
      table.number_or("resolution", 0.1, {.minimum = 1e-6, .maximum = 10, .exclusive = false});
  bisection.whole = table.boolean_or("whole", false);
  if (bisection.from == bisection.to) table.problem("to", "is the same as `from`: nothing lies between");
  if (bisection.logarithmic && !(bisection.from > 0 && bisection.to > 0))
    table.problem("from", "`from` and `to` have to be positive, or set scale = \"linear\"");
  return bisection;
}

/// Expressions are tried on the first cell, so that a slip is found before anything runs.
void check_expressions(SceneTable& root, const toml::table& document, const StudyScene& study,
                       std::vector<SceneProblem>& problems) {
  const auto usable = [](const StudyAxis& axis) { return !axis.values.empty(); };
  if (!std::all_of(study.axes.begin(), study.axes.end(), usable)) return;
  StudyScene plain = study;
  plain.derived.clear();
  if (!plain.axes.empty()) plain.axes.front().size.reset();
  const std::optional<double> bisected =
      study.bisection ? std::optional<double>(study.bisection->from) : std::nullopt;
  auto variables = study_cell(plain, std::vector<std::size_t>(study.axes.size(), 0), bisected).variables;
  for (const auto& [key, expression] : study.derived) {
    try {
      variables[variable_name(key)] = evaluate_expression(expression, variables);
    } catch (const std::invalid_argument& error) {
      const auto at = document["derive"].as_table()->at_path(key);
      note(problems, at ? *at.node() : *document["derive"].node(), error.what());
    }
  }
  const auto attempt = [&](SceneTable& at, const std::string& key, const std::string& expression) {
    try {
      return evaluate_expression(expression, variables);
    } catch (const std::invalid_argument& error) {
      at.problem(key, error.what());
      return 1.0;
    }
  };
  auto axes = root.tables("vary");
  if (!axes.empty() && study.axes.front().size) attempt(axes.front(), "size", *study.axes.front().size);
  auto quantities = root.tables("quantity");
  for (std::size_t k = 0; k < quantities.size(); ++k) {
    const StudyQuantity& quantity = study.quantities[k];
    if (quantity.exact && attempt(quantities[k], "exact", *quantity.exact) == 0.0 && !quantity.scale)
      quantities[k].problem("exact",
                            "is 0 for the first run; give `scale`, what the error is to be divided by");
  }
}

/// Every key may be set in one place only.
void refuse_repeated_keys(SceneTable& root, const StudyScene& study) {
  std::vector<std::string> seen;
  const auto note = [&](const std::string& key) {
    if (std::find(seen.begin(), seen.end(), key) != seen.end())
      root.problem("", fmt::format("'{}' is set in two places of the study", key));
    seen.push_back(key);
  };
  for (const auto& text : study.fixed) note(text.substr(0, text.find('=')));
  for (const auto& axis : study.axes) {
    for (const auto& key : axis.keys) note(key);
  }
  for (const auto& [key, expression] : study.derived) note(key);
  if (study.bisection) note(study.bisection->key);
}

void read_settings(SceneTable& root, const toml::table& document, StudyScene& study,
                   std::vector<SceneProblem>& problems) {
  root.leave_to_others({"set", "derive"});
  const auto* set = document["set"].as_table();
  if (set != nullptr) {
    for_each_value(*set, "", [&](const std::string& path, const toml::node& value) {
      study.fixed.push_back(fmt::format("{}={}", path, one_line(value)));
    });
  }
  auto axes = root.tables("vary");
  for (std::size_t k = 0; k < axes.size(); ++k)
    study.axes.push_back(read_axis(axes[k], *document["vary"][k].as_table(), problems));
  const auto* derive = document["derive"].as_table();
  if (derive != nullptr) {
    for_each_value(*derive, "", [&](const std::string& path, const toml::node& value) {
      const auto* text = value.as_string();
      if (text == nullptr && !value.is_number())
        note(problems, value, fmt::format("'{}' needs an expression of the varied keys", path));
      study.derived.emplace_back(path, text != nullptr ? text->get() : one_line(value));
    });
  }
}

void read_root(SceneTable root, const toml::table& document, StudyScene& study,
               std::vector<SceneProblem>& problems) {
  study.title = root.text_or("title", study.file.stem().string());
  const auto scene = root.text("scene");
  study.scene = scene.empty() ? std::filesystem::path() : study.file.parent_path() / scene;
  if (!scene.empty() && !std::filesystem::is_regular_file(study.scene)) {
    root.problem("scene", fmt::format("{} is not a file; a scene is looked for from the study's folder",
                                      study.scene.string()));
  }
  constexpr std::array<std::string_view, 2> modes = {"error", "stability"};
  study.mode = root.choice("mode", modes) == "error" ? StudyMode::error : StudyMode::stability;
  const bool stability = study.mode == StudyMode::stability;
  study.timeout_s = root.number_or("timeout", 3600, Range::positive());
  read_settings(root, document, study, problems);
  for (auto& table : root.tables("quantity")) study.quantities.push_back(read_quantity(table, study.mode));
  for (std::size_t k = 0; k < study.quantities.size(); ++k) {
    for (std::size_t other = 0; other < k; ++other) {
      if (study.quantities[other].name == study.quantities[k].name)
        root.problem("quantity", fmt::format("'{}' is there twice", study.quantities[k].name));
    }
  }
  if (stability) {
    if (auto table = root.table_if("bisect")) study.bisection = read_bisection(*table);
    if (study.axes.size() > 2) root.problem("vary", "a map of stability has one or two [[vary]]");
    if (study.axes.empty() && !study.bisection)
      root.problem("", "there is nothing to vary: give [[vary]] or [bisect]");
  } else {
    study.repeats = static_cast<int>(root.integer_or("repeats", 1, 1, 1000));
    study.limits = root.has("limits") ? root.numbers("limits", 0) : std::vector<double>{0.05, 0.01, 0.003};
    if (study.axes.empty())
      root.problem("", "there is nothing to vary: give [[vary]] with a key of the scene and its values");
  }
  if (auto slurm = root.table_if("slurm")) study.slurm_options = slurm->texts_or_empty("options");
  refuse_repeated_keys(root, study);
  check_expressions(root, document, study, problems);
  root.refuse_unknown_keys();
}

}  // namespace

std::string variable_name(std::string_view key) {
  if (key.starts_with(variables_only)) key.remove_prefix(variables_only.size());
  std::string name(key);
  std::replace_if(
      name.begin(), name.end(), [](unsigned char c) { return std::isalnum(c) == 0; }, '_');
  return name;
}

StudyReading read_study(const std::filesystem::path& file) {
  StudyReading reading;
  reading.study.file = file;
  std::ifstream stream(file);
  std::ostringstream text;
  if (stream) text << stream.rdbuf();
  if (!stream || !text) {
    reading.problems.push_back({.message = "cannot be read"});
    return reading;
  }
  const Scene document = Scene::parse(text.str(), file.string());
  if (document.problems().empty()) {
    const auto values = toml::parse(text.str(), std::string_view(file.string()));
    read_root(document.root(), values, reading.study, reading.problems);
  }
  reading.problems.insert(reading.problems.end(), document.problems().begin(), document.problems().end());
  std::stable_sort(reading.problems.begin(), reading.problems.end(),
                   [](const SceneProblem& a, const SceneProblem& b) {
                     return std::pair(a.line, a.column) < std::pair(b.line, b.column);
                   });
  return reading;
}

}  // namespace estuary::coupler
