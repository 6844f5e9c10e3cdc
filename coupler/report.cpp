#include "report.hpp"

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <stdexcept>

#include "environment.hpp"
#include "gnuplot.hpp"
#include "report_page.hpp"
#include "report_plots.hpp"
#include "scene.hpp"
#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

using Json = nlohmann::ordered_json;

// The summary is a file: each value is looked at before it is used, and one that is missing is shown as "-".
const Json& member(const Json& json, const char* key) {
  static const Json absent;
  if (!json.is_object()) return absent;
  const auto found = json.find(key);
  return found == json.end() ? absent : *found;
}
std::string text(const Json& json, const char* key) {
  const Json& value = member(json, key);
  return value.is_string() ? value.get<std::string>() : "-";
}
std::optional<double> number(const Json& json, const char* key) {
  const Json& value = member(json, key);
  return value.is_number() ? std::optional(value.get<double>()) : std::nullopt;
}
std::string shown(const std::optional<double>& value, const char* unit = "") {
  return value ? fmt::format("{:.6g}{}", *value, unit) : "-";
}
std::vector<std::string> texts(const Json& json) {
  std::vector<std::string> result;
  if (!json.is_array()) return result;
  for (const auto& entry : json) {
    if (entry.is_string()) result.push_back(entry.get<std::string>());
  }
  return result;
}

Json read_summary(const std::filesystem::path& run_folder) {
  const auto file = run_folder / "summary.json";
  if (!std::filesystem::is_regular_file(file)) {
    throw std::runtime_error(
        fmt::format("{} is missing: this is not the folder of a finished run", file.string()));
  }
  auto summary = Json::parse(read_whole(file), nullptr, false);
  if (!summary.is_object())
    throw std::runtime_error(fmt::format("{} is not a summary of a run", file.string()));
  return summary;
}

ReportScene read_scene(const std::string& scene_text) {
  auto scene = Scene::parse(scene_text, "scene.toml");
  auto root = scene.root();
  ReportScene result;
  if (auto coupling = root.table_if("coupling")) {
    result.steady = coupling->text_or("mode", "transient") == "steady";
    result.tolerance = coupling->number_or("tolerance", 0.0, Range::not_negative());
  }
  return result;
}

void add_status(ReportPage& page, const Json& summary) {
  const auto status = text(summary, "status");
  const auto message = text(summary, "message");
  page.notice(status == "done" ? "good" : "bad", message == "-" || message.empty()
                                                     ? fmt::format("Status: {}.", status)
                                                     : fmt::format("Status: {}. {}", status, message));
  const Json& iterations = member(summary, "iterations");
  const Json& coupling = member(summary, "coupling");
  page.table({"scene", "wall time [s]", "windows", "iterations", "per window", "most", "messages",
              "bytes exchanged"},
             {{text(summary, "scene"), shown(number(summary, "wall_s")), shown(number(summary, "windows")),
               shown(number(iterations, "total")), shown(number(iterations, "mean")),
               shown(number(iterations, "max")), shown(number(coupling, "messages")),
               shown(number(coupling, "bytes"))}});
}

void add_checks(ReportPage& page, const Json& summary) {
  page.heading("Checks");
  const Json& checks = member(summary, "checks");
  if (!checks.is_array() || checks.empty()) {
    page.paragraph(text(summary, "status") == "done" ? "The scene carries no checks."
                                                     : "The run ended before its checks could be made.");
    return;
  }
  std::vector<std::vector<std::string>> rows;
  for (const auto& check : checks) {
    std::string reference = shown(number(check, "reference"));
    if (const auto limit = number(check, "at_most")) reference = fmt::format("at most {:.6g}", *limit);
    if (const auto limit = number(check, "at_least")) reference = fmt::format("at least {:.6g}", *limit);
    const bool absolute = member(check, "absolute") == true;
    const auto error = [&](const std::optional<double>& value) {
      if (!number(check, "reference") || !value) return std::string("-");
      return absolute ? fmt::format("{:.4g}", *value) : fmt::format("{:.3g} %", 100 * *value);
    };
    rows.push_back({text(check, "quantity"), shown(number(check, "value")), reference,
                    error(number(check, "error")), error(number(check, "tolerance")),
                    member(check, "pass") == true ? "good:holds" : "bad:fails", text(check, "source")});
  }
  page.table({"quantity", "value", "reference", "error", "tolerance", "", "source of the reference"}, rows);
  page.paragraph(
      fmt::format("What this accuracy cost: {} s of wall time.", shown(number(summary, "wall_s"))));
}

void add_times(ReportPage& page, const Json& summary) {
  page.heading("Where the time went");
  const double wall = number(summary, "wall_s").value_or(0);
  const Json& participants = member(summary, "participants");
  if (!participants.is_object() || participants.empty()) {
    page.paragraph("No participant was launched.");
    return;
  }
  std::vector<std::pair<std::string, double>> whole;
  std::vector<std::vector<std::string>> rows;
  for (const auto& [role, participant] : participants.items()) {
    whole.emplace_back(role + " computes", number(participant, "compute_s").value_or(0));
    const auto speed = number(participant, "updates_per_s");
    const auto bytes = number(participant, "bytes_per_update");
    const auto memory = number(participant, "peak_rss_bytes");
    rows.push_back({role, text(participant, "solver") + " " + text(participant, "version"),
                    shown(number(participant, "steps")), shown(number(participant, "compute_s")),
                    shown(number(participant, "wait_s")), speed ? fmt::format("{:.4g}", *speed / 1e6) : "-",
                    speed && bytes && *bytes > 0 ? fmt::format("{:.3g}", *speed * *bytes / 1e9) : "-",
                    memory ? fmt::format("{:.0f}", *memory / 1e6) : "-"});
  }
  if (const auto exchange = number(member(summary, "coupling"), "exchange_s"))
    whole.emplace_back("exchange", *exchange);
  page.bars(whole, wall, "s");
  page.table({"", "solver", "steps", "computes [s]", "waits [s]", "million updates/s", "GB/s", "memory [MB]"},
             rows);
  for (const auto& [role, participant] : participants.items()) {
    std::vector<std::pair<std::string, double>> phases;
    for (const auto& [phase, seconds] : member(participant, "phases").items()) {
      if (seconds.is_number()) phases.emplace_back(phase, seconds.get<double>());
    }
    if (phases.empty()) continue;
    page.subheading(fmt::format("{}, by phase, as a share of its own time", role));
    page.bars(phases, number(participant, "compute_s").value_or(0), "s");
  }
}

void add_plan(ReportPage& page, const Json& summary) {
  page.heading("Plan");
  const Json& participants = member(summary, "participants");
  if (participants.is_object()) {
    for (const auto& [role, participant] : participants.items()) {
      page.subheading(role);
      std::vector<std::vector<std::string>> rows;
      if (text(participant, "variant") != "-")
        rows.push_back({"compiled variant", text(participant, "variant")});
      for (const auto& [name, value] : member(participant, "plan").items()) {
        if (value.is_string()) rows.push_back({name, value.get<std::string>()});
      }
      if (rows.empty()) {
        page.paragraph("This participant said nothing of its plan.");
      } else {
        page.table({"quantity", "value"}, rows);
      }
      for (const auto& warning : texts(member(participant, "warnings")))
        page.notice("note", "Warning: " + warning);
    }
  }
  for (const auto& warning : texts(member(summary, "warnings"))) page.notice("note", "Warning: " + warning);
  const auto left_out = texts(member(summary, "left_out"));
  if (!left_out.empty()) {
    page.subheading("What this scene did not need, and so was left out");
    page.list(left_out);
  }
}

/// Pictures of an earlier report go away; the work folder goes away at the end.
class ReportFolders {
public:
  explicit ReportFolders(const std::filesystem::path& run_folder)
      : places_{
            .run = run_folder, .pictures = run_folder / "report", .work = run_folder / "report" / "work"} {
    std::filesystem::remove_all(places_.pictures);
    std::filesystem::create_directories(places_.work);
  }
  ReportFolders(const ReportFolders&) = delete;
  ReportFolders& operator=(const ReportFolders&) = delete;
  ~ReportFolders() {
    std::error_code ignored;
    std::filesystem::remove_all(places_.work, ignored);
  }
  [[nodiscard]] const ReportPlaces& places() const { return places_; }

private:
  ReportPlaces places_;
};

}  // namespace

void write_report(const std::filesystem::path& run_folder) {
  const Json summary = read_summary(run_folder);
  const auto scene_text = read_whole(run_folder / "scene.toml");
  const ReportScene scene = read_scene(scene_text);
  const auto gnuplot = Gnuplot::find();
  const ReportFolders folders(run_folder);
  const ReportPlaces& places = folders.places();

  const auto title = text(summary, "title");
  ReportPage page(title.empty() || title == "-" ? text(summary, "scene") : title);
  add_status(page, summary);
  if (!gnuplot)
    page.notice("note", "gnuplot is not installed, so this page has no pictures (package gnuplot-nox).");
  if (gnuplot) add_field_pictures(page, places, scene, *gnuplot);
  add_checks(page, summary);
  page.heading("Convergence");
  add_convergence(page, places, scene, gnuplot);
  if (gnuplot) {
    page.heading("Watches");
    add_watches(page, places, scene, *gnuplot);
  }
  add_times(page, summary);
  add_plan(page, summary);
  page.heading("Environment");
  page.table({"", ""}, environment_rows());
  page.heading("Scene");
  if (scene_text.empty()) {
    page.paragraph("scene.toml is missing.");
  } else {
    page.folded("scene.toml, as it was run", scene_text);
  }
  write_whole(run_folder / "report.html", page.html());
}

}  // namespace estuary::coupler
