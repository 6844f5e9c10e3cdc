#include "study_store.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "child_process.hpp"
#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

using Json = nlohmann::ordered_json;

/// FNV-1a, 64 bits: tells apart what was changed on purpose; nobody forges cells of a study.
class Fingerprint {
public:
  void add(std::string_view text) {
    for (const char c : text) {
      value_ ^= static_cast<unsigned char>(c);
      value_ *= 0x100000001b3U;
    }
    value_ ^= 0xffU;  // so that "a" + "bc" is not "ab" + "c"
    value_ *= 0x100000001b3U;
  }
  [[nodiscard]] std::string text() const { return fmt::format("{:016x}", value_); }

private:
  std::uint64_t value_ = 0xcbf29ce484222325U;
};

std::string one_line(const std::vector<SceneProblem>& problems) {
  std::string text;
  for (const auto& problem : problems) text += (text.empty() ? "" : "; ") + describe("", problem);
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

std::vector<StudyRun> read_runs(const std::filesystem::path& file, const std::string& fingerprint) {
  std::vector<StudyRun> runs;
  const auto json = Json::parse(read_whole(file), nullptr, false);
  try {
    if (!json.is_object() || json.at("fingerprint") != fingerprint) return runs;
    for (const auto& entry : json.at("runs")) {
      runs.push_back({.exit_status = entry.at("exit_status"),
                      .status = entry.at("status"),
                      .message = entry.at("message"),
                      .wall_s = entry.at("wall_s"),
                      .processor_s = entry.at("processor_s"),
                      .load = entry.at("load"),
                      .beside = entry.at("beside")});
    }
  } catch (const Json::exception&) {
    runs.clear();  // of another version, or cut off: run again
  }
  return runs;
}

}  // namespace

StudyStore::StudyStore(const std::filesystem::path& folder, const StudyScene& study)
    : cells_(folder / "cells"), scene_(study.scene), scene_text_(read_whole(study.scene)) {
  std::error_code error;
  std::filesystem::create_directories(cells_, error);
  if (error) throw std::runtime_error(fmt::format("cannot make {}: {}", cells_.string(), error.message()));
}

const std::string& StudyStore::program_print(const std::filesystem::path& program) const {
  const std::scoped_lock lock(mutex_);
  auto& print = program_prints_[program.string()];
  if (print.empty()) {
    Fingerprint fingerprint;
    fingerprint.add(read_whole(program));
    print = fingerprint.text();
  }
  return print;
}

std::string StudyStore::fingerprint_of(const CheckedScene& scene) const {
  Fingerprint fingerprint;
  fingerprint.add(scene.as_run);
  fingerprint.add(program_print("/proc/self/exe"));
  for (const auto& participant : scene.coupling.participants) {
    fingerprint.add(participant.role);
    fingerprint.add(participant.endpoint);
    for (const auto& word : participant.command) fingerprint.add(word);
    if (participant.command.empty()) continue;
    if (const auto program = find_program(participant.command.front()))
      fingerprint.add(program_print(*program));
  }
  return fingerprint.text();
}

PreparedCell StudyStore::prepare(StudyCell cell) const {
  PreparedCell prepared{.cell = std::move(cell), .scene = {}, .fingerprint = {}, .refused = {}, .runs = {}};
  // Pictures of the fields are no part of a study's answer, unless it asks for them.
  const auto sets_frames = [](const std::string& setting) { return setting.starts_with("output.frames="); };
  auto& settings = prepared.cell.settings;
  if (std::none_of(settings.begin(), settings.end(), sets_frames))
    settings.emplace_back("output.frames=false");
  if (!prepared.cell.problem.empty()) {
    prepared.refused = prepared.cell.problem;
    return prepared;
  }
  prepared.scene = check_scene({.name = scene_.string(), .text = scene_text_, .overrides = settings});
  prepared.refused = one_line(prepared.scene.problems);
  prepared.fingerprint = fingerprint_of(prepared.scene);
  prepared.runs = read_runs(folder_of(prepared) / "cell.json", prepared.fingerprint);
  return prepared;
}

std::filesystem::path StudyStore::folder_of(const PreparedCell& cell) const {
  return cells_ / cell.fingerprint;
}
std::filesystem::path StudyStore::running(const PreparedCell& cell) const {
  return folder_of(cell) / "running";
}
std::filesystem::path StudyStore::finished(const PreparedCell& cell) const {
  return folder_of(cell) / "run";
}

void StudyStore::keep(PreparedCell& cell, StudyRun run) const {
  std::error_code error;
  std::filesystem::remove_all(finished(cell), error);
  if (std::filesystem::exists(running(cell), error))
    std::filesystem::rename(running(cell), finished(cell), error);
  cell.runs.push_back(std::move(run));
  Json runs = Json::array();
  for (const auto& entry : cell.runs) {
    runs.push_back({{"exit_status", entry.exit_status},
                    {"status", entry.status},
                    {"message", entry.message},
                    {"wall_s", entry.wall_s},
                    {"processor_s", entry.processor_s},
                    {"load", entry.load},
                    {"beside", entry.beside}});
  }
  const Json json = {{"fingerprint", cell.fingerprint},
                     {"name", cell.cell.name()},
                     {"settings", cell.cell.settings},
                     {"runs", runs}};
  write_whole(folder_of(cell) / "cell.json", json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace estuary::coupler
