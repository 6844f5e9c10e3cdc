#include "study_result.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "checks.hpp"
#include "csv_file.hpp"
#include "richardson.hpp"
#include "study_expression.hpp"
#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

using Json = nlohmann::ordered_json;

constexpr double missing = std::numeric_limits<double>::quiet_NaN();

double number(const Json& json, const char* key) {
  const auto found = json.is_object() ? json.find(key) : json.end();
  return json.is_object() && found != json.end() && found->is_number() ? found->get<double>() : 0.0;
}

void add_warnings(StudyResult& result, const Json& json) {
  const auto found = json.is_object() ? json.find("warnings") : json.end();
  if (!json.is_object() || found == json.end()) return;
  for (const auto& warning : *found) {
    if (warning.is_string()) result.warnings.push_back(warning.get<std::string>());
  }
}

WatchRecord read_watches(const std::filesystem::path& folder) {
  WatchRecord watches;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder / "watch", error)) {
    const auto table = read_csv(entry.path());
    const auto* time = table ? table->column("time") : nullptr;
    if (time == nullptr) continue;
    auto& quantities = watches[entry.path().stem().string()];
    for (std::size_t k = 0; k < table->names.size(); ++k)
      quantities[table->names[k]] = {.time = *time, .value = table->columns[k]};
  }
  return watches;
}

void read_work(StudyResult& result, const Json& summary, const std::filesystem::path& folder) {
  if (!summary.is_object()) return;
  result.windows = number(summary, "windows");
  if (summary.contains("iterations")) {
    result.iterations = number(summary["iterations"], "total");
    result.iterations_per_window = number(summary["iterations"], "mean");
  }
  add_warnings(result, summary);
  if (summary.contains("participants")) {
    for (const auto& [role, participant] : summary["participants"].items()) {
      add_warnings(result, participant);
      result.steps += number(participant, "steps");
      result.updates += number(participant, "updates");
      result.compute_s += number(participant, "compute_s");
      result.peak_rss_bytes = std::max(result.peak_rss_bytes, number(participant, "peak_rss_bytes"));
    }
  }
  const auto table = read_csv(folder / "iterations.csv");
  const auto* time = table ? table->column("time") : nullptr;
  if (time != nullptr && !time->empty()) result.end_time = time->back();
}

void judge(QuantityResult& result, const StudyQuantity& quantity) {
  double difference = result.value - result.reference;
  if (quantity.name.ends_with(".phase")) difference = std::remainder(difference, 360.0);
  const double scale = quantity.scale.value_or(std::abs(result.reference));
  result.error = scale > 0 ? std::abs(difference) / scale : missing;
}

void take_times(StudyResult& result, const std::vector<StudyRun>& runs) {
  if (runs.empty()) return;
  std::vector<double> wall;
  std::vector<double> processor;
  for (const auto& run : runs) {
    wall.push_back(run.wall_s);
    processor.push_back(run.processor_s);
    result.load = std::max(result.load, run.load);
    result.beside = std::max(result.beside, run.beside);
  }
  const auto median = [](std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
  };
  result.runs = runs.size();
  result.wall_s = median(wall);
  result.processor_s = median(processor);
  result.wall_min_s = *std::min_element(wall.begin(), wall.end());
  result.wall_max_s = *std::max_element(wall.begin(), wall.end());
}

void take_largest_error(StudyResult& result) {
  result.error = result.quantities.empty() ? missing : 0.0;
  for (const auto& quantity : result.quantities) {
    // One that is not there or not finite must not make the others look like the whole.
    result.error = std::isfinite(quantity.error) ? std::max(result.error, quantity.error) : missing;
    if (!std::isfinite(result.error)) return;
  }
}

/// The values of a series as far as its cells came to their end with a size.
struct Ladder {
  std::vector<std::size_t> results;
  std::vector<double> sizes;
};
Ladder ladder_of(const StudySeries& series, const std::vector<StudyResult>& results) {
  Ladder ladder;
  for (const std::size_t k : series.results) {
    if (!results[k].finished || !results[k].cell.size) continue;
    ladder.results.push_back(k);
    ladder.sizes.push_back(*results[k].cell.size);
  }
  return ladder;
}

void refer_to_limit(StudyResults& all, const StudySeries& series, std::size_t quantity) {
  const Ladder ladder = ladder_of(series, all.results);
  std::vector<double> values;
  for (const std::size_t k : ladder.results) values.push_back(all.results[k].quantities[quantity].value);
  const auto limit = ladder_limit(ladder.sizes, values, all.quantities[quantity].order);
  const auto name = all.quantities[quantity].name + (series.name.empty() ? "" : " of " + series.name);
  if (limit.extrapolated) {
    all.notes.push_back(
        fmt::format("Reference of {}: {:.8g}, extrapolated from the finest steps with order {:.2f}.", name,
                    limit.value, limit.order));
  } else {
    all.notes.push_back(
        fmt::format("Reference of {}: {:.8g}, the finest step itself, which so has no error; the "
                    "ladder gives no order to extrapolate with.",
                    name, limit.value));
  }
  for (const std::size_t k : series.results) {
    auto& result = all.results[k].quantities[quantity];
    result.reference = limit.value;
    const bool itself = !limit.extrapolated && !ladder.results.empty() && k == ladder.results.back();
    if (all.results[k].finished && !itself) judge(result, all.quantities[quantity]);
  }
}

void find_orders(StudySeries& series, const StudyResults& all) {
  const Ladder ladder = ladder_of(series, all.results);
  const auto order = [&](const auto& error_of) {
    std::vector<double> errors;
    for (const std::size_t k : ladder.results) errors.push_back(error_of(all.results[k]));
    return observed_order(ladder.sizes, errors);
  };
  for (std::size_t q = 0; q < all.quantities.size(); ++q)
    series.orders.push_back(order([q](const StudyResult& result) { return result.quantities[q].error; }));
  series.order = order([](const StudyResult& result) { return result.error; });
}

/// On a machine with other work the clock counts that, too.
void take_costs(StudyResults& all) {
  all.by_processor = std::any_of(all.results.begin(), all.results.end(),
                                 [](const StudyResult& result) { return result.waited(); });
  for (auto& result : all.results) result.cost_s = all.by_processor ? result.processor_s : result.wall_s;
  if (all.by_processor)
    all.notes.emplace_back(
        "Runs waited for processors that had other work: an error is held against the time of the "
        "processors, "
        "not of the clock.");
}

void mark_front(std::vector<StudyResult>& results) {
  for (auto& candidate : results) {
    candidate.on_front = std::isfinite(candidate.error) &&
                         std::none_of(results.begin(), results.end(), [&](const StudyResult& other) {
                           return other.error <= candidate.error && other.cost_s <= candidate.cost_s &&
                                  (other.error < candidate.error || other.cost_s < candidate.cost_s);
                         });
  }
}

}  // namespace

bool StudyResult::scattered() const {
  constexpr double much = 0.25;
  return runs > 1 && wall_max_s - wall_min_s > much * wall_s;
}

std::vector<StudyQuantity> resolved_quantities(const StudyScene& study, const CouplingScene& scene,
                                               std::vector<std::string>& problems) {
  std::vector<StudyQuantity> quantities = study.quantities;
  if (quantities.empty()) {
    for (const auto& check : scene.checks) {
      const auto same = [&](const StudyQuantity& other) { return other.name == check.quantity; };
      if (!check.reference || std::any_of(quantities.begin(), quantities.end(), same)) continue;
      StudyQuantity quantity;
      quantity.name = check.quantity;
      quantity.tolerance = 0.1;
      // Where the scene itself measures in absolute terms, a tolerance is the natural unit.
      if (*check.reference == 0) quantity.scale = check.absolute_tolerance;
      quantities.push_back(quantity);
    }
    if (quantities.empty())
      problems.emplace_back("the scene has no [[check]] with a reference: give [[quantity]] with one");
  }
  for (auto& quantity : quantities) {
    const bool bounded = quantity.at_most || quantity.at_least;
    const auto watch = quantity.name.substr(0, quantity.name.find('.'));
    const bool known = watch == "coupling" || watch == "run" ||
                       std::any_of(scene.watches.begin(), scene.watches.end(),
                                   [&](const WatchScene& candidate) { return candidate.name == watch; });
    if (!known)
      problems.push_back(fmt::format("quantity '{}': the scene has no watch '{}'", quantity.name, watch));
    if (quantity.reference || quantity.other || quantity.exact || quantity.finest || bounded) continue;
    const auto check =
        std::find_if(scene.checks.begin(), scene.checks.end(), [&](const CheckScene& candidate) {
          return candidate.reference && candidate.quantity == quantity.name;
        });
    if (check == scene.checks.end()) {
      problems.push_back(
          fmt::format("quantity '{}': give its reference (`reference`, `other`, `exact` or `finest`); "
                      "the scene has no [[check]] of it",
                      quantity.name));
      continue;
    }
    quantity.reference = check->reference;
    quantity.from_check = true;
    if (quantity.source.empty()) quantity.source = check->source;
    if (quantity.reference == 0.0 && !quantity.scale)
      problems.push_back(
          fmt::format("quantity '{}': its reference is 0; give `scale`, what the error is to be "
                      "divided by",
                      quantity.name));
  }
  return quantities;
}

StudyResult study_result(const std::vector<StudyQuantity>& quantities, const StudyStore& store,
                         const PreparedCell& cell) {
  StudyResult result;
  result.cell = cell.cell;
  result.quantities.resize(quantities.size());
  if (!cell.refused.empty()) {
    result.status = "refused";
    result.message = cell.refused;
    return result;
  }
  if (cell.runs.empty()) {
    result.status = "not run";
    return result;
  }
  const StudyRun& last = cell.runs.back();
  result.status = last.status;
  result.message = last.message;
  result.finished = last.finished();
  take_times(result, cell.runs);
  const auto folder = store.finished(cell);
  const Json summary = Json::parse(read_whole(folder / "summary.json"), nullptr, false);
  read_work(result, summary, folder);
  const WatchRecord watches = read_watches(folder);
  RunFigures figures{.wall_s = last.wall_s,
                     .total_iterations = static_cast<std::uint64_t>(result.iterations),
                     .windows = static_cast<std::uint64_t>(result.windows),
                     .most_iterations = 0};
  if (summary.is_object() && summary.contains("iterations"))
    figures.most_iterations = static_cast<std::uint64_t>(number(summary["iterations"], "max"));
  const auto value = [&](const std::string& name) {
    return quantity_value(name, cell.scene.coupling, watches, figures);
  };
  for (std::size_t k = 0; k < quantities.size(); ++k) {
    QuantityResult& here = result.quantities[k];
    here.value = value(quantities[k].name);
    if (quantities[k].reference) here.reference = *quantities[k].reference;
    if (quantities[k].from_check) {
      for (const auto& check : cell.scene.coupling.checks) {
        if (check.quantity != quantities[k].name || !check.reference) continue;
        here.reference = *check.reference;
        break;
      }
    }
    if (quantities[k].other) here.reference = value(*quantities[k].other);
    if (quantities[k].exact) {
      try {
        here.reference = evaluate_expression(*quantities[k].exact, cell.cell.variables);
      } catch (const std::exception& error) {
        result.message = error.what();
      }
    }
    if (result.finished) judge(here, quantities[k]);
  }
  take_largest_error(result);
  return result;
}

StudyResults study_results(const StudyScene& study, const StudyStore& store,
                           const std::vector<PreparedCell>& cells) {
  StudyResults all;
  std::vector<std::string> ignored;
  const auto good =
      std::find_if(cells.begin(), cells.end(), [](const auto& cell) { return cell.refused.empty(); });
  if (good != cells.end()) all.quantities = resolved_quantities(study, good->scene.coupling, ignored);
  for (const auto& cell : cells) {
    all.results.push_back(study_result(all.quantities, store, cell));
    const auto name = cell.cell.series();
    const auto series = std::find_if(all.series.begin(), all.series.end(),
                                     [&](const StudySeries& other) { return other.name == name; });
    if (series == all.series.end()) {
      all.series.push_back({.name = name, .results = {all.results.size() - 1}, .orders = {}, .order = {}});
    } else {
      series->results.push_back(all.results.size() - 1);
    }
  }
  for (auto& series : all.series) {
    for (std::size_t q = 0; q < all.quantities.size(); ++q) {
      if (all.quantities[q].finest) refer_to_limit(all, series, q);
    }
    for (const std::size_t k : series.results) take_largest_error(all.results[k]);
    find_orders(series, all);
  }
  take_costs(all);
  mark_front(all.results);
  const auto scattered = std::count_if(all.results.begin(), all.results.end(),
                                       [](const auto& result) { return result.scattered(); });
  if (scattered > 0)
    all.notes.push_back(fmt::format(
        "Times of {} setting{} differ by more than a quarter between repeats: the machine had other work.",
        scattered, scattered == 1 ? "" : "s"));
  if (std::any_of(all.results.begin(), all.results.end(),
                  [](const auto& result) { return result.beside > 1; }))
    all.notes.emplace_back("Several runs went on at the same time: wall times are too long.");
  return all;
}

}  // namespace estuary::coupler
