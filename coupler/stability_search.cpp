#include "stability_search.hpp"

#include <algorithm>
#include <cmath>

#include <fmt/format.h>

namespace estuary::coupler {
namespace {

constexpr int most_halvings = 60;

StabilityRun judged_run(const StudyStore& store, const PreparedCell& cell,
                        const std::vector<StudyQuantity>& quantities) {
  StabilityRun run{.result = study_result(quantities, store, cell), .verdict = {}};
  run.verdict = stability_verdict(quantities, run.result, cell.scene.coupling);
  const StabilityVerdict& verdict = run.verdict;
  run.result.judged = {{"class", class_name(verdict.kind)},
                       {"lie", verdict.lie ? "1" : "0"},
                       {"symptom", verdict.symptom},
                       {"warnings", fmt::format("{}", fmt::join(run.result.warnings, "; "))},
                       {"detected_window", verdict.window ? fmt::format("{}", *verdict.window) : ""},
                       {"detected_time", verdict.time ? fmt::format("{:.8g}", *verdict.time) : ""}};
  return run;
}

}  // namespace

double middle_of(const StudyBisection& bisection, double holds, double fails) {
  const double middle = bisection.logarithmic ? std::sqrt(holds * fails) : 0.5 * (holds + fails);
  return bisection.whole ? std::round(middle) : middle;
}

bool resolved(const StudyBisection& bisection, double holds, double fails) {
  if (bisection.whole && std::abs(fails - holds) <= 1) return true;
  if (bisection.logarithmic) return std::max(holds / fails, fails / holds) <= 1 + bisection.resolution;
  return std::abs(fails - holds) <= bisection.resolution * std::abs(bisection.to - bisection.from);
}

StabilityMap search_cell(const StudyScene& study, const StudyStore& store,
                         const std::vector<std::size_t>& steps, const std::vector<StudyQuantity>& quantities,
                         const ObtainRun& obtain) {
  StabilityMap map{.quantities = quantities, .runs = {}, .limits = {}};
  const auto run_at = [&](std::optional<double> value) -> StabilityVerdict {
    PreparedCell cell = store.prepare(study_cell(study, steps, value));
    if (cell.refused.empty() && cell.runs.empty()) obtain(cell);
    map.runs.push_back(judged_run(store, cell, quantities));
    return map.runs.back().verdict;
  };
  if (!study.bisection) {
    run_at({});
    return map;
  }
  const StudyBisection& bisection = *study.bisection;
  StabilityLimit limit{.cell = study_cell(study, steps), .holds = {}, .fails = {}, .beyond = {}};
  const auto holds = [](const StabilityVerdict& verdict) { return verdict.kind == StabilityClass::stable; };
  const auto note = [&](double value) {
    const auto verdict = run_at(value);
    if (verdict.kind == StabilityClass::not_run) return false;
    if (holds(verdict)) {
      limit.holds = value;
    } else {
      limit.fails = value;
      limit.beyond = verdict;
    }
    return true;
  };
  bool going_on = note(bisection.from) && limit.holds && note(bisection.to);
  for (int k = 0;
       going_on && limit.fails && k < most_halvings && !resolved(bisection, *limit.holds, *limit.fails);
       ++k) {
    going_on = note(middle_of(bisection, *limit.holds, *limit.fails));
  }
  std::sort(map.runs.begin(), map.runs.end(), [](const StabilityRun& a, const StabilityRun& b) {
    return a.result.cell.bisected < b.result.cell.bisected;
  });
  map.limits.push_back(std::move(limit));
  return map;
}

}  // namespace estuary::coupler
