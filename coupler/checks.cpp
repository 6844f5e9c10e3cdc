#include "checks.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

namespace estuary::coupler {
namespace {

// A turn of the values counts when they go back by this share of the last swing.
constexpr double smallest_turn = 0.25;
constexpr double missing = std::numeric_limits<double>::quiet_NaN();

// Where the values turn: the extremes between which they go by a quarter of the swing before.
std::vector<std::size_t> turns_of(const std::vector<double>& value, std::size_t first) {
  const auto [low, high] =
      std::minmax_element(value.begin() + static_cast<std::ptrdiff_t>(first), value.end());
  double swing = *high - *low;
  std::vector<std::size_t> turns;
  std::size_t extreme = first;  // the highest value while they rise, the lowest while they fall
  int direction = 0;            // unknown before the first quarter of a swing
  for (std::size_t n = first; n < value.size(); ++n) {
    if (direction == 0) {
      const double change = value[n] - value[first];
      if (std::abs(change) <= smallest_turn * swing) continue;
      direction = change > 0 ? 1 : -1;
      extreme = n;
    } else if (direction * (value[n] - value[extreme]) > 0) {
      extreme = n;
    } else if (std::abs(value[n] - value[extreme]) > smallest_turn * swing) {
      if (!turns.empty()) swing = std::abs(value[extreme] - value[turns.back()]);
      turns.push_back(extreme);
      direction = -direction;
      extreme = n;
    }
  }
  return turns;
}

// When the values pass the middle between two turns, linear between samples.
double time_of_passage(const WatchSeries& series, std::size_t from, std::size_t to) {
  const auto& value = series.value;
  const double middle = 0.5 * (value[from] + value[to]);
  const bool rises = value[to] > value[from];
  std::size_t n = from + 1;
  while (rises ? value[n] < middle : value[n] > middle) ++n;
  const double part = (middle - value[n - 1]) / (value[n] - value[n - 1]);
  return series.time[n - 1] + part * (series.time[n] - series.time[n - 1]);
}

// The first time at which the values are above the level, linear between samples.
double time_above(const WatchSeries& series, std::size_t first, double level) {
  for (std::size_t n = first; n < series.value.size(); ++n) {
    if (!(series.value[n] > level)) continue;
    if (n == first) return series.time[n];
    const double part = (level - series.value[n - 1]) / (series.value[n] - series.value[n - 1]);
    return series.time[n - 1] + part * (series.time[n] - series.time[n - 1]);
  }
  return missing;
}

double statistic_of(const WatchSeries& whole, const std::string& statistic, const WatchScene& watch) {
  WatchSeries series = whole;
  // Times are multiples of the window, `to_time` is as somebody wrote it: they may differ by round-off.
  const double last = watch.to_time * (1 + 1e-12);
  const auto count = static_cast<std::size_t>(std::upper_bound(series.time.begin(), series.time.end(), last) -
                                              series.time.begin());
  series.time.resize(count);
  series.value.resize(count);
  if (series.value.empty()) return missing;
  if (statistic == "last") return series.value.back();
  if (statistic == "amplitude" || statistic == "phase") {
    if (!watch.angular_frequency) return missing;
    const Harmonic harmonic = fit_harmonic(series, *watch.angular_frequency, watch.from_time);
    return statistic == "amplitude" ? harmonic.amplitude : harmonic.phase;
  }
  const auto first = static_cast<std::ptrdiff_t>(
      std::lower_bound(series.time.begin(), series.time.end(), watch.from_time) - series.time.begin());
  const auto begin = series.value.begin() + first;
  if (begin == series.value.end()) return missing;
  if (statistic == "time_above")
    return watch.level ? time_above(series, static_cast<std::size_t>(first), *watch.level) : missing;
  if (statistic == "frequency") return frequency_of(series, watch.from_time);
  if (statistic == "min") return *std::min_element(begin, series.value.end());
  if (statistic == "max") return *std::max_element(begin, series.value.end());
  if (statistic == "mid_range" || statistic == "half_range") {
    const auto [low, high] = std::minmax_element(begin, series.value.end());
    return 0.5 * (statistic == "mid_range" ? *high + *low : *high - *low);
  }
  if (statistic == "mean") {
    return std::accumulate(begin, series.value.end(), 0.0) / static_cast<double>(series.value.end() - begin);
  }
  return missing;
}

}  // namespace

double quantity_value(const std::string& quantity, const CouplingScene& scene, const WatchRecord& watches,
                      const RunFigures& figures) {
  if (quantity == "coupling.iterations") return static_cast<double>(figures.most_iterations);
  if (quantity == "coupling.total_iterations") return static_cast<double>(figures.total_iterations);
  if (quantity == "run.windows") return static_cast<double>(figures.windows);
  if (quantity == "run.wall_s") return figures.wall_s;
  const std::size_t dot = quantity.find('.');
  if (dot == std::string::npos) return missing;
  const std::string name = quantity.substr(0, dot);
  std::string rest = quantity.substr(dot + 1);
  std::string statistic = "last";
  if (const std::size_t second = rest.find('.'); second != std::string::npos) {
    statistic = rest.substr(second + 1);
    rest.resize(second);
  }
  const auto watch = std::find_if(scene.watches.begin(), scene.watches.end(),
                                  [&](const WatchScene& candidate) { return candidate.name == name; });
  const auto quantities = watches.find(name);
  if (watch == scene.watches.end() || quantities == watches.end()) return missing;
  const auto series = quantities->second.find(rest);
  return series == quantities->second.end() ? missing : statistic_of(series->second, statistic, *watch);
}

double frequency_of(const WatchSeries& series, double from_time) {
  const auto first = static_cast<std::size_t>(
      std::lower_bound(series.time.begin(), series.time.end(), from_time) - series.time.begin());
  if (first >= series.value.size()) return missing;
  const std::vector<std::size_t> turns = turns_of(series.value, first);
  // One line through the passages upwards and one, of the same slope, through those downwards.
  double slope = 0;
  double weight = 0;
  for (const std::size_t kind : {std::size_t{0}, std::size_t{1}}) {
    std::vector<double> times;
    for (std::size_t k = kind; k + 1 < turns.size(); k += 2)
      times.push_back(time_of_passage(series, turns[k], turns[k + 1]));
    const double middle = 0.5 * (static_cast<double>(times.size()) - 1);
    for (std::size_t k = 0; k < times.size(); ++k) {
      const double off = static_cast<double>(k) - middle;
      slope += off * times[k];
      weight += off * off;
    }
  }
  return weight > 0 ? weight / slope : missing;
}

Harmonic fit_harmonic(const WatchSeries& series, double angular_frequency, double from_time) {
  const double period = 2 * std::numbers::pi / angular_frequency;
  if (series.time.size() < 4) return {missing, missing};
  const double end = series.time.back();
  // One sample interval is added, since the samples stand for the ends of their windows.
  const double span = end - from_time + (series.time[1] - series.time[0]);
  const double periods = std::floor(span / period * (1 + 1e-9));
  if (periods < 1) return {missing, missing};
  const double begin = end - periods * period;
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < series.time.size(); ++i) {
    if (series.time[i] <= begin * (1 + 1e-12)) continue;
    const double angle = angular_frequency * series.time[i];
    const Eigen::Vector3d row(1.0, std::cos(angle), std::sin(angle));
    normal += row * row.transpose();
    right += row * series.value[i];
  }
  const Eigen::Vector3d fit = normal.ldlt().solve(right);
  return {std::hypot(fit[1], fit[2]), std::atan2(-fit[2], fit[1]) * 180 / std::numbers::pi};
}

std::vector<CheckResult> evaluate_checks(const CouplingScene& scene, const RecordedRun& record,
                                         RunFigures figures) {
  figures.windows = record.windows.size();
  for (const auto& window : record.windows)
    figures.most_iterations = std::max(figures.most_iterations, window.iterations);
  std::vector<CheckResult> results;
  for (const auto& check : scene.checks) {
    CheckResult result{.check = check};
    result.value = quantity_value(check.quantity, scene, record.watches, figures);
    if (check.reference) {
      double difference = result.value - *check.reference;
      if (check.quantity.ends_with(".phase")) difference = std::remainder(difference, 360.0);
      if (check.relative_tolerance) {
        result.error = difference / std::abs(*check.reference);
        result.tolerance = *check.relative_tolerance;
      } else {
        result.error = difference;
        result.tolerance = *check.absolute_tolerance;
      }
      result.pass = std::abs(result.error) <= result.tolerance;  // false for a missing value
    } else {
      result.pass = std::isfinite(result.value);
      if (check.at_most) result.error = std::max(result.error, result.value - *check.at_most);
      if (check.at_least) result.error = std::max(result.error, *check.at_least - result.value);
      result.pass = result.pass && result.error <= 0;
    }
    results.push_back(std::move(result));
  }
  return results;
}

std::string check_table(const std::vector<CheckResult>& results, double wall_s) {
  std::string text = fmt::format("{:<34} {:>13} {:>13} {:>10} {:>10}  {:<6} {}\n", "check", "value",
                                 "reference", "error", "allowed", "", "source");
  for (const auto& result : results) {
    const auto& check = result.check;
    std::string reference;
    std::string error;
    std::string allowed;
    if (check.reference) {
      reference = fmt::format("{:.6g}", *check.reference);
      error = check.relative_tolerance ? fmt::format("{:+.2f} %", 100 * result.error)
                                       : fmt::format("{:+.3g}", result.error);
      allowed = check.relative_tolerance ? fmt::format("{:.4g} %", 100 * result.tolerance)
                                         : fmt::format("{:.3g}", result.tolerance);
    } else {
      if (check.at_least) reference = fmt::format(">= {:.6g}", *check.at_least);
      if (check.at_most)
        reference += fmt::format("{}<= {:.6g}", reference.empty() ? "" : ", ", *check.at_most);
    }
    text += fmt::format("{:<34} {:>13} {:>13} {:>10} {:>10}  {:<6} {}\n", check.quantity,
                        std::isfinite(result.value) ? fmt::format("{:.6g}", result.value) : "missing",
                        reference, error, allowed, result.pass ? "ok" : "FAILED", check.source);
  }
  const auto passed =
      std::count_if(results.begin(), results.end(), [](const CheckResult& result) { return result.pass; });
  text += fmt::format("{} of {} checks hold; wall time {:.1f} s\n", passed, results.size(), wall_s);
  return text;
}

}  // namespace estuary::coupler
