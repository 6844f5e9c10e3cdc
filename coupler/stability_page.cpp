#include "stability_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "stability_plots.hpp"
#include "study_page.hpp"
#include "study_table.hpp"
#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

std::string limit_text(const StudyScene& study, const StabilityLimit& limit) {
  const StudyBisection& bisection = *study.bisection;
  if (!limit.holds && !limit.fails) return "not run";
  if (!limit.holds) return fmt::format("fails from {:.4g} on", bisection.from);
  if (!limit.fails) return fmt::format("holds to {:.4g}", bisection.to);
  return fmt::format("{:.4g} holds, {:.4g} does not", *limit.holds, *limit.fails);
}

std::string beyond_text(const StabilityLimit& limit) {
  if (!limit.fails) return "";
  std::string text = class_name(limit.beyond.kind);
  if (limit.beyond.time) text += fmt::format(" at {:.4g} s", *limit.beyond.time);
  if (!limit.beyond.symptom.empty()) text += ": " + limit.beyond.symptom;
  return text;
}

std::string counts_text(const StabilityMap& map) {
  std::map<std::string, int> counts;
  int lies = 0;
  for (const auto& run : map.runs) {
    ++counts[class_name(run.verdict.kind)];
    lies += run.verdict.lie ? 1 : 0;
  }
  std::string text = fmt::format("{} runs:", map.runs.size());
  for (const auto& [name, count] : counts) text += fmt::format(" {} {},", count, name);
  return text + fmt::format(" {} {}.", lies, lies == 1 ? "lie" : "lies");
}

std::string limits_csv(const StudyScene& study, const StabilityMap& map) {
  std::string text;
  for (const auto& axis : study.axes) text += axis.name + ",";
  text += "holds,fails,class,time,symptom\n";
  for (const auto& limit : map.limits) {
    for (const auto& label : limit.cell.labels) text += csv_entry(label) + ",";
    text += fmt::format("{},{},{},{},{}\n", limit.holds ? fmt::format("{:.8g}", *limit.holds) : "",
                        limit.fails ? fmt::format("{:.8g}", *limit.fails) : "",
                        limit.fails ? class_name(limit.beyond.kind) : "",
                        limit.beyond.time ? fmt::format("{:.8g}", *limit.beyond.time) : "",
                        csv_entry(limit.beyond.symptom));
  }
  return text;
}

StudyResults as_results(const StabilityMap& map) {
  StudyResults all;
  all.quantities = map.quantities;
  for (const auto& run : map.runs) all.results.push_back(run.result);
  return all;
}

void add_lies(ReportPage& page, const StabilityMap& map) {
  page.heading("Wrong, and not a word of warning");
  bool none = true;
  for (const auto& run : map.runs) {
    if (!run.verdict.lie) continue;
    none = false;
    page.notice("bad", fmt::format("{}: {}", run.result.cell.name(), run.verdict.symptom));
  }
  if (none) page.notice("good", "None.");
}

void add_judged_runs(ReportPage& page, const StudyScene& study, const StabilityMap& map) {
  page.heading("Runs");
  std::vector<std::string> names;
  for (const auto& axis : study.axes) names.push_back(axis.name);
  if (study.bisection) names.push_back(study.bisection->key);
  names.emplace_back("");
  for (const auto& quantity : map.quantities) names.push_back(quantity.name);
  for (const auto* name :
       {"largest error", "noticed at [s]", "wall time [s]", "iterations per window", "symptom"})
    names.emplace_back(name);
  std::vector<std::vector<std::string>> rows;
  for (const auto& run : map.runs) {
    std::vector<std::string> row = run.result.cell.labels;
    if (study.bisection) row.push_back(fmt::format("{:.6g}", run.result.cell.bisected.value_or(NAN)));
    const bool good = run.verdict.kind == StabilityClass::stable;
    row.push_back(fmt::format("{}:{}{}", good ? "good" : "bad", class_name(run.verdict.kind),
                              run.verdict.lie ? ", a lie" : ""));
    for (const auto& quantity : run.result.quantities)
      row.push_back(std::isfinite(quantity.value) ? fmt::format("{:.5g}", quantity.value) : "-");
    row.push_back(percent_text(run.result.error));
    row.push_back(run.verdict.time ? fmt::format("{:.5g}", *run.verdict.time) : "-");
    row.push_back(seconds_text(run.result.wall_s));
    row.push_back(
        run.result.iterations_per_window > 0 ? fmt::format("{:.3g}", run.result.iterations_per_window) : "-");
    row.push_back(run.verdict.symptom);
    rows.push_back(std::move(row));
  }
  page.table(names, rows);
}

void add_map(ReportPage& page, const StudyScene& study, const StabilityMap& map,
             const std::filesystem::path& folder) {
  for (const auto* name : {"study.svg", "study.png"}) std::filesystem::remove(folder / name);
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    page.notice("note", "gnuplot is not installed, so this page has no pictures (package gnuplot-nox).");
    return;
  }
  try {
    draw_stability(study, map, folder / "study", *gnuplot);
    page.picture(folder / "study.svg",
                 study.bisection ? "limit of " + study.bisection->key : "class of each run", false);
  } catch (const std::runtime_error& error) {
    page.paragraph(fmt::format("No picture: {}.", error.what()));
  }
}

}  // namespace

std::string stability_markdown(const StudyScene& study, const StabilityMap& map) {
  std::vector<std::string> names;
  for (const auto& axis : study.axes) names.push_back(axis.name);
  std::string text;
  if (study.bisection) {
    names.push_back(study.bisection->key);
    names.emplace_back("beyond");
    text = markdown_row(names) + markdown_row(std::vector<std::string>(names.size(), "---"));
    for (const auto& limit : map.limits) {
      auto row = limit.cell.labels;
      row.push_back(limit_text(study, limit));
      row.push_back(beyond_text(limit));
      text += markdown_row(row);
    }
  } else {
    for (const auto* name : {"class", "largest error", "iterations per window", "symptom"})
      names.emplace_back(name);
    text = markdown_row(names) + markdown_row(std::vector<std::string>(names.size(), "---"));
    for (const auto& run : map.runs) {
      auto row = run.result.cell.labels;
      row.push_back(std::string(class_name(run.verdict.kind)) + (run.verdict.lie ? ", a lie" : ""));
      row.push_back(percent_text(run.result.error));
      row.push_back(run.result.iterations_per_window > 0
                        ? fmt::format("{:.3g}", run.result.iterations_per_window)
                        : "-");
      row.push_back(run.verdict.symptom);
      text += markdown_row(row);
    }
  }
  return text + "\n" + counts_text(map) + "\n";
}

std::vector<std::string> what_holds_less(const StudyScene& study, const StabilityMap& map,
                                         const std::filesystem::path& before, double allowed) {
  const auto rows = read_csv_rows(before);
  std::vector<std::string> worse;
  const auto row_of = [&](const StudyCell& cell) {
    return std::find_if(rows.begin(), rows.end(), [&](const auto& row) {
      for (std::size_t k = 0; k < study.axes.size(); ++k) {
        const auto entry = row.find(study.axes[k].name);
        if (entry == row.end() || entry->second != cell.labels[k]) return false;
      }
      return true;
    });
  };
  if (!study.bisection) {
    for (const auto& run : map.runs) {
      const auto row = row_of(run.result.cell);
      if (row == rows.end() || !row->contains("class") || row->at("class") != "stable") continue;
      if (run.verdict.kind != StabilityClass::stable && run.verdict.kind != StabilityClass::not_run)
        worse.push_back(fmt::format("{}: stable before, {} now: {}", run.result.cell.name(),
                                    class_name(run.verdict.kind), run.verdict.symptom));
    }
    return worse;
  }
  const StudyBisection& bisection = *study.bisection;
  const auto distance = [&](double value) {
    return bisection.logarithmic ? std::abs(std::log(value / bisection.from))
                                 : std::abs(value - bisection.from);
  };
  const double slack = bisection.logarithmic ? std::log1p(allowed + bisection.resolution)
                                             : (allowed + bisection.resolution) * distance(bisection.to);
  for (const auto& limit : map.limits) {
    const auto row = row_of(limit.cell);
    if (row == rows.end() || !row->contains("holds")) continue;
    const auto earlier = number_of(row->at("holds"));
    if (!earlier || (!limit.holds && !limit.fails)) continue;
    if (!limit.holds || distance(*limit.holds) < distance(*earlier) - slack)
      worse.push_back(fmt::format("{}: held to {:.4g} before, {} now", limit.cell.name(), *earlier,
                                  limit_text(study, limit)));
  }
  return worse;
}

void write_stability(const StudyScene& study, const StabilityMap& map, const std::filesystem::path& folder) {
  write_whole(folder / "study.csv", study_csv(study, as_results(map)));
  write_whole(folder / "study.md", stability_markdown(study, map));
  if (study.bisection) write_whole(folder / "limits.csv", limits_csv(study, map));
  ReportPage page(study.title);
  page.paragraph(fmt::format("Scene {}. {}", study.scene.lexically_normal().string(), counts_text(map)));
  add_map(page, study, map, folder);
  if (study.bisection) {
    page.heading("Limits");
    std::vector<std::string> names;
    for (const auto& axis : study.axes) names.push_back(axis.name);
    names.push_back(study.bisection->key);
    names.emplace_back("beyond");
    std::vector<std::vector<std::string>> rows;
    for (const auto& limit : map.limits) {
      auto row = limit.cell.labels;
      row.push_back(limit_text(study, limit));
      row.push_back(beyond_text(limit));
      rows.push_back(std::move(row));
    }
    page.table(names, rows);
  }
  add_lies(page, map);
  add_judged_runs(page, study, map);
  finish_study_page(page, study, folder);
}

}  // namespace estuary::coupler
