#include "study_page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "environment.hpp"
#include "study_plots.hpp"
#include "study_table.hpp"
#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

void add_summary(ReportPage& page, const StudyScene& study, const StudyResults& all) {
  const auto count = [&](const auto& wanted) {
    return std::count_if(all.results.begin(), all.results.end(), wanted);
  };
  const auto finished = count([](const StudyResult& result) { return result.finished; });
  const auto open = count([](const StudyResult& result) { return result.status == "not run"; });
  const auto failed = static_cast<long>(all.results.size()) - finished - open;
  page.paragraph(fmt::format("Scene {}: {} settings, {} run to their end, {} not, {} still to run.",
                             study.scene.lexically_normal().string(), all.results.size(), finished, failed,
                             open));
  for (const auto& note : all.notes) page.notice("note", note);
}

/// A picture, or a sentence that says why there is none.
void add_picture(ReportPage& page, const StudyResults& all, std::optional<std::size_t> quantity,
                 StudyAbscissa abscissa, const std::filesystem::path& stem, const std::string& caption,
                 const Gnuplot& gnuplot) {
  try {
    draw_study(all, quantity, abscissa, stem, gnuplot);
    auto file = stem;
    page.picture(file.replace_extension(".svg"), caption, false);
  } catch (const std::runtime_error& error) {
    page.paragraph(fmt::format("No picture of {}: {}.", caption, error.what()));
  }
}

void add_pictures(ReportPage& page, const StudyResults& all, const std::filesystem::path& folder) {
  for (const auto* name : {"study.svg", "study.png", "pictures"}) std::filesystem::remove_all(folder / name);
  const auto gnuplot = Gnuplot::find();
  if (!gnuplot) {
    page.notice("note", "gnuplot is not installed, so this page has no pictures (package gnuplot-nox).");
    return;
  }
  const std::string cost = std::string(" against ") + all.cost_name();
  page.heading("Error" + cost);
  const bool several = all.quantities.size() > 1;
  add_picture(page, all, {}, StudyAbscissa::cost, folder / "study",
              (several ? "largest error of all quantities" : "error") + cost, *gnuplot);
  const auto pictures = folder / "pictures";
  std::filesystem::create_directories(pictures);
  if (several) {
    page.begin_gallery();
    for (std::size_t q = 0; q < all.quantities.size(); ++q)
      add_picture(page, all, q, StudyAbscissa::cost, pictures / fmt::format("time-{:02}", q),
                  all.quantities[q].name + cost, *gnuplot);
    page.end_gallery();
  }
  const bool sized = std::any_of(all.results.begin(), all.results.end(),
                                 [](const StudyResult& result) { return result.cell.size.has_value(); });
  if (!sized) return;
  page.heading("Error against resolution");
  page.begin_gallery();
  for (std::size_t q = 0; q < all.quantities.size(); ++q)
    add_picture(page, all, q, StudyAbscissa::size, pictures / fmt::format("size-{:02}", q),
                all.quantities[q].name + " against resolution", *gnuplot);
  page.end_gallery();
}

void add_results(ReportPage& page, const StudyScene& study, const StudyResults& all) {
  page.heading("Runs");
  std::vector<std::string> names;
  for (const auto& axis : study.axes) names.push_back(axis.name);
  for (const auto& quantity : all.quantities) {
    names.push_back(quantity.name);
    names.emplace_back("error");
  }
  for (const auto* name : {"wall time [s]", "spread [s]", "processor time [s]", "steps", "updates",
                           "iterations per window", "memory [MB]", ""})
    names.emplace_back(name);
  std::vector<std::vector<std::string>> rows;
  for (const auto& result : all.results) {
    std::vector<std::string> row = result.cell.labels;
    for (const auto& quantity : result.quantities) {
      row.push_back(std::isfinite(quantity.value) ? fmt::format("{:.6g}", quantity.value) : "-");
      row.push_back(percent_text(quantity.error));
    }
    const auto figure = [](double value, const char* format) {
      return value > 0 ? fmt::format(fmt::runtime(format), value) : std::string("-");
    };
    row.push_back(seconds_text(result.wall_s));
    row.push_back(result.runs > 1
                      ? fmt::format("{}{} to {}", result.scattered() ? "bad:" : "",
                                    seconds_text(result.wall_min_s), seconds_text(result.wall_max_s))
                      : "-");
    row.push_back(seconds_text(result.processor_s));
    row.push_back(figure(result.steps, "{:.6g}"));
    row.push_back(figure(result.updates, "{:.3g}"));
    row.push_back(figure(result.iterations_per_window, "{:.3g}"));
    row.push_back(figure(result.peak_rss_bytes / 1e6, "{:.0f}"));
    row.push_back(result.finished ? (result.on_front ? "good:on the front" : "") : "bad:" + result.status);
    rows.push_back(std::move(row));
  }
  page.table(names, rows);
  for (const auto& result : all.results) {
    if (!result.finished && !result.message.empty())
      page.notice("bad", fmt::format("{}: {}. {}", result.cell.name(), result.status, result.message));
  }
}

void add_cheapest(ReportPage& page, const StudyScene& study, const StudyResults& all) {
  page.heading("What an error costs");
  std::vector<std::vector<std::string>> rows;
  const auto cheapest = cheapest_cells(study, all);
  for (std::size_t k = 0; k < cheapest.size(); ++k) {
    const auto limit = fmt::format("{:g} %", 100 * study.limits[k]);
    if (cheapest[k] == nullptr) {
      rows.push_back({limit, "not reached for good", "-", "-"});
    } else {
      rows.push_back({limit, cheapest[k]->cell.name(), percent_text(cheapest[k]->error),
                      seconds_text(cheapest[k]->cost_s)});
    }
  }
  page.table({"largest error below", "cheapest settings", "its error", std::string(all.cost_name()) + " [s]"},
             rows);
  page.paragraph("A setting counts when all finer ones of its line stay below, too.");
}

void add_orders(ReportPage& page, const StudyResults& all) {
  std::vector<std::vector<std::string>> rows;
  for (const auto& series : all.series) {
    for (std::size_t q = 0; q < series.orders.size(); ++q) {
      if (series.orders[q])
        rows.push_back({series.name, all.quantities[q].name, fmt::format("{:.2f}", *series.orders[q])});
    }
  }
  if (rows.empty()) return;
  page.heading("Observed orders");
  page.table({"", "quantity", "order"}, rows);
  page.paragraph("Slope of log error over log size through all steps, by least squares.");
}

void add_references(ReportPage& page, const StudyResults& all) {
  page.heading("References");
  std::vector<std::vector<std::string>> rows;
  for (const auto& quantity : all.quantities) {
    std::string reference = "finest step";
    if (quantity.from_check) {
      reference = fmt::format("{:.8g}, of the scene's check", *quantity.reference);
    } else if (quantity.reference) {
      reference = fmt::format("{:.8g}", *quantity.reference);
    } else if (quantity.exact) {
      reference = *quantity.exact;
    } else if (quantity.other) {
      reference = *quantity.other + " of the same run";
    }
    rows.push_back({quantity.name, reference,
                    quantity.scale ? fmt::format("divided by {:g}", *quantity.scale) : "relative",
                    quantity.source});
  }
  page.table({"quantity", "reference", "error", "source"}, rows);
}

}  // namespace

void finish_study_page(ReportPage& page, const StudyScene& study, const std::filesystem::path& folder) {
  page.heading("Environment");
  page.table({"", ""}, environment_rows());
  page.heading("Study");
  page.folded(study.file.filename().string(), read_whole(study.file));
  page.folded(study.scene.filename().string(), read_whole(study.scene));
  write_whole(folder / "study.html", page.html());
}

void write_study(const StudyScene& study, const StudyResults& all, const std::filesystem::path& folder) {
  write_whole(folder / "study.csv", study_csv(study, all));
  write_whole(folder / "study.md", study_markdown(study, all));
  ReportPage page(study.title);
  add_summary(page, study, all);
  add_pictures(page, all, folder);
  add_cheapest(page, study, all);
  add_results(page, study, all);
  add_orders(page, all);
  add_references(page, all);
  finish_study_page(page, study, folder);
}

}  // namespace estuary::coupler
