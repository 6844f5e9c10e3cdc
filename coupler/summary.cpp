#include "summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <numeric>
#include <stdexcept>

namespace estuary::coupler {
namespace {

using Json = nlohmann::ordered_json;

// JSON has no infinities and no not-a-number: they become null.
Json finite_or_null(double value) {
  return std::isfinite(value) ? Json(value) : Json(nullptr);
}

double wait_seconds(const RemoteParticipant& participant, double wall_s) {
  return std::max(0.0, wall_s - participant.usage().wall_s);
}

// Compute time of every phase method, from the participant's own clock.
double compute_seconds(const RemoteParticipant& participant) {
  return participant.usage().wall_s - participant.usage().exchange_s;
}

double updates_per_second(const RemoteParticipant& participant) {
  const double seconds = participant.work().compute_s();
  return seconds > 0 ? participant.work().updates() / seconds : 0.0;
}

Json participants_json(const CheckedScene& scene, const Participants* participants, double wall_s) {
  Json all = Json::object();
  if (participants == nullptr) return all;
  for (const auto& participant : participants->all()) {
    const v1::Work& work = participant->work();
    Json phases = Json::object();
    for (const auto& phase : work.phases()) phases[phase.phase()] = finite_or_null(phase.seconds());
    Json entry = {{"solver", participant->identity().name()},
                  {"version", participant->identity().version()},
                  {"wall_s", finite_or_null(participant->usage().wall_s)},
                  {"compute_s", finite_or_null(compute_seconds(*participant))},
                  {"wait_s", finite_or_null(wait_seconds(*participant, wall_s))},
                  {"exchange_s", finite_or_null(participant->usage().exchange_s)},
                  {"steps", work.steps()},
                  {"updates", finite_or_null(work.updates())},
                  {"updates_per_s", finite_or_null(updates_per_second(*participant))},
                  {"bytes_per_update", finite_or_null(work.bytes_per_update())},
                  {"peak_rss_bytes", work.peak_rss_bytes()},
                  {"phases", phases}};
    if (work.has_energy_error()) entry["energy_error"] = finite_or_null(work.energy_error());
    // Where its frames and checkpoints are, when that is not below this folder.
    if (!participant->scene().folder.empty()) {
      entry["host"] = participant->scene().host;
      entry["folder"] = participant->scene().folder;
    }
    if (const auto found = scene.participants.find(participant->role()); found != scene.participants.end()) {
      entry["variant"] = found->second.variant();
      Json plan = Json::object();
      for (const auto& item : found->second.plan()) plan[item.name()] = item.value();
      entry["plan"] = plan;
      entry["warnings"] =
          std::vector<std::string>(found->second.warnings().begin(), found->second.warnings().end());
    }
    all[participant->role()] = entry;
  }
  return all;
}

Json watches_json(const RecordedRun& record) {
  Json all = Json::object();
  for (const auto& [name, quantities] : record.watches) {
    Json entry = Json::object();
    for (const auto& [quantity, series] : quantities) {
      if (series.value.empty()) continue;
      const auto [low, high] = std::minmax_element(series.value.begin(), series.value.end());
      const double mean = std::accumulate(series.value.begin(), series.value.end(), 0.0) /
                          static_cast<double>(series.value.size());
      entry[quantity] = {{"last", finite_or_null(series.value.back())},
                         {"min", finite_or_null(*low)},
                         {"max", finite_or_null(*high)},
                         {"mean", finite_or_null(mean)}};
    }
    all[name] = entry;
  }
  return all;
}

Json checks_json(const std::vector<CheckResult>& checks) {
  Json all = Json::array();
  for (const auto& result : checks) {
    Json entry = {{"quantity", result.check.quantity}, {"value", finite_or_null(result.value)}};
    entry["reference"] = result.check.reference ? finite_or_null(*result.check.reference) : Json(nullptr);
    if (result.check.at_most) entry["at_most"] = finite_or_null(*result.check.at_most);
    if (result.check.at_least) entry["at_least"] = finite_or_null(*result.check.at_least);
    entry["error"] = finite_or_null(result.error);
    entry["tolerance"] = finite_or_null(result.tolerance);
    entry["absolute"] = result.check.absolute_tolerance.has_value();
    entry["pass"] = result.pass;
    entry["source"] = result.check.source;
    all.push_back(entry);
  }
  return all;
}

}  // namespace

void write_summary(const std::filesystem::path& folder, const CheckedScene& scene,
                   const Participants* participants, const RecordedRun& record,
                   const std::vector<CheckResult>& checks, const RunEnd& end) {
  std::uint64_t most = 0;
  for (const auto& window : record.windows) most = std::max(most, window.iterations);
  const auto windows = record.windows.size();
  double exchange_s = 0;
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
  if (participants != nullptr) {
    for (const auto& participant : participants->all()) {
      exchange_s += participant->usage().exchange_s;
      bytes += participant->bytes();
      messages += participant->messages();
    }
  }
  const Json json = {
      {"scene", scene.given.name},
      {"title", scene.coupling.title},
      {"status", end.status},
      {"message", end.message},
      {"wall_s", finite_or_null(end.wall_s)},
      {"windows", windows},
      {"iterations",
       {{"total", end.total_iterations},
        {"mean",
         windows == 0 ? 0.0 : static_cast<double>(end.total_iterations) / static_cast<double>(windows)},
        {"max", most}}},
      {"participants", participants_json(scene, participants, end.wall_s)},
      {"coupling",
       {{"exchange_s", finite_or_null(exchange_s)},
        {"compute_s", finite_or_null(end.coupler_s)},
        {"bytes", bytes},
        {"messages", messages}}},
      {"recovery",
       {{"checkpoints", end.checkpoints},
        {"checkpoint_s", finite_or_null(end.checkpoint_s)},
        {"relaunches", end.relaunches},
        {"recovery_s", finite_or_null(end.recovery_s)},
        {"resumed_after_window", end.resumed_from ? Json(*end.resumed_from) : Json(nullptr)}}},
      {"left_out", scene.left_out},
      {"warnings", scene.warnings},
      {"watch", watches_json(record)},
      {"checks", checks_json(checks)}};
  const auto path = folder / "summary.json";
  std::ofstream file(path);
  file << json.dump(2) << '\n';
  file.close();
  if (!file) throw std::runtime_error(fmt::format("cannot write {}: is the disk full?", path.string()));
}

std::string timing_table(const Participants& participants, const RunEnd& end) {
  const double wall_s = end.wall_s;
  std::string text = fmt::format("{:<28} {:>10} {:>8}\n", "time", "seconds", "share");
  const auto row = [&](const std::string& name, double seconds) {
    text += fmt::format("{:<28} {:>10.3f} {:>6.1f} %\n", name, seconds,
                        wall_s > 0 ? 100 * seconds / wall_s : 0.0);
  };
  double exchange_s = 0;
  for (const auto& participant : participants.all()) {
    row(fmt::format("{} computes", participant->role()), compute_seconds(*participant));
    for (const auto& phase : participant->work().phases()) row("  " + phase.phase(), phase.seconds());
    exchange_s += participant->usage().exchange_s;
  }
  row("coupler computes", end.coupler_s);
  row("exchange", exchange_s);
  row("whole run", wall_s);
  for (const auto& participant : participants.all()) {
    const v1::Work& work = participant->work();
    text += fmt::format("{}: {} steps, {:.3g} updates, {:.1f} million updates/s", participant->role(),
                        work.steps(), work.updates(), updates_per_second(*participant) / 1e6);
    if (work.bytes_per_update() > 0) {
      text += fmt::format(" ({:.1f} GB/s)", updates_per_second(*participant) * work.bytes_per_update() / 1e9);
    }
    text += fmt::format(", {:.0f} MB", static_cast<double>(work.peak_rss_bytes()) / 1e6);
    if (work.has_energy_error())
      text += fmt::format(", balance of energy {:+.2g} %", 100 * work.energy_error());
    text += '\n';
  }
  return text;
}

}  // namespace estuary::coupler
