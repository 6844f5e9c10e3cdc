#include "study_runner.hpp"

#include <fmt/format.h>
#include <signal.h>
#include <stdlib.h>

#include <algorithm>
#include <chrono>
#include <exception>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "child_process.hpp"
#include "failure.hpp"
#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

constexpr double end_patience_s = 10;  // for a run that was told to end: it saves its state

double machine_load() {
  double load = 0;
  return getloadavg(&load, 1) == 1 ? load : 0;
}

void tell_to_end(ChildProcess& child) {
  ::kill(child.process(), SIGTERM);
  const auto patience = steady_clock::now() + std::chrono::duration<double>(end_patience_s);
  while (!child.ended() && steady_clock::now() < patience)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  child.end(0);
}

/// Fills in what the run itself says of its end.
void read_end(StudyRun& run, const std::filesystem::path& folder, const std::filesystem::path& log) {
  const auto json = nlohmann::json::parse(read_whole(folder / "summary.json"), nullptr, false);
  if (json.is_object()) {
    if (json.contains("wall_s") && json["wall_s"].is_number()) run.wall_s = json["wall_s"];
    if (json.contains("status") && json["status"].is_string()) run.status = json["status"];
    if (json.contains("message") && json["message"].is_string()) run.message = json["message"];
    return;
  }
  run.status =
      run.exit_status == static_cast<int>(ExitStatus::wrong_scene) ? "refused" : "ended without a summary";
  auto lines = read_whole(log);
  while (!lines.empty() && lines.back() == '\n') lines.pop_back();
  run.message = lines.substr(lines.rfind('\n') + 1);
}

}  // namespace

StudyRunner::StudyRunner(const StudyStore& store, RunnerSettings settings, const std::atomic<int>& interrupt,
                         std::function<void(const std::string&)> say)
    : store_(store), settings_(settings), interrupt_(interrupt), say_(std::move(say)) {}

bool StudyRunner::run(PreparedCell& cell) const {
  if (interrupt_) return false;
  const auto folder = store_.running(cell);
  const auto log = store_.folder_of(cell) / "run.log";
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  std::filesystem::remove(log);
  // This program itself, also when it was replaced on disk meanwhile.
  std::vector<std::string> words = {std::filesystem::read_symlink("/proc/self/exe").string(),
                                    "run",
                                    cell.scene.given.name,
                                    "--out",
                                    folder.string(),
                                    "--no-report"};
  for (const auto& setting : cell.cell.settings) {
    words.emplace_back("--set");
    words.push_back(setting);
  }
  StudyRun run{.exit_status = 0,
               .status = {},
               .message = {},
               .wall_s = 0,
               .processor_s = 0,
               .load = machine_load(),
               .beside = settings_.jobs};
  const auto begin = steady_clock::now();
  ChildProcess child(words, log);
  while (!child.ended()) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
    run.wall_s = std::chrono::duration<double>(steady_clock::now() - begin).count();
    if (interrupt_) {
      tell_to_end(child);
      std::filesystem::remove_all(folder);
      return false;
    }
    if (run.wall_s > settings_.timeout_s) {
      tell_to_end(child);
      run.exit_status = -1;
      break;
    }
  }
  run.processor_s = child.processor_seconds();
  if (run.exit_status == -1) {
    run.status = "time limit";
    run.message = fmt::format("no end within {:g} s", settings_.timeout_s);
  } else {
    run.exit_status = child.exit_status();
    read_end(run, folder, log);
  }
  store_.keep(cell, std::move(run));
  return true;
}

void StudyRunner::for_each(std::size_t count, const std::function<void(std::size_t)>& task) const {
  std::atomic<std::size_t> next{0};
  std::mutex mutex;
  std::exception_ptr failure;
  const auto work = [&] {
    for (std::size_t k = next++; k < count && !interrupt_; k = next++) {
      try {
        task(k);
      } catch (...) {
        const std::scoped_lock lock(mutex);
        if (!failure) failure = std::current_exception();
        return;
      }
    }
  };
  if (settings_.jobs <= 1) {
    work();
  } else {
    std::vector<std::jthread> threads;
    for (int job = 0; job < settings_.jobs; ++job) threads.emplace_back(work);
  }
  if (failure) std::rethrow_exception(failure);
}

void StudyRunner::run_all(std::vector<PreparedCell>& cells, int repeats) const {
  std::mutex mutex;
  std::size_t wanted = 0;
  for (const auto& cell : cells) {
    const bool over = !cell.refused.empty() || (!cell.runs.empty() && !cell.runs.back().finished());
    if (!over && cell.runs.size() < static_cast<std::size_t>(repeats)) wanted += repeats - cell.runs.size();
  }
  std::size_t number = 0;
  const auto first_alike = [&](std::size_t k) {
    const auto same = [&](const PreparedCell& other) { return other.fingerprint == cells[k].fingerprint; };
    return static_cast<std::size_t>(std::find_if(cells.begin(), cells.end(), same) - cells.begin());
  };
  for (int round = 1; round <= repeats && !interrupt_; ++round) {
    for_each(cells.size(), [&](std::size_t k) {
      PreparedCell& cell = cells[k];
      if (first_alike(k) != k) return;  // settings that make the same scene are run once
      if (!cell.refused.empty() || cell.runs.size() >= static_cast<std::size_t>(round)) return;
      if (!cell.runs.empty() && !cell.runs.back().finished()) return;  // it will not do better the next time
      if (!run(cell)) return;
      const std::scoped_lock lock(mutex);
      const StudyRun& last = cell.runs.back();
      say_(fmt::format("{}/{} {}: {}, {:.3g} s{}", ++number, wanted, cell.cell.name(), last.status,
                       last.wall_s, last.message.empty() ? "" : ": " + last.message));
    });
  }
  for (std::size_t k = 0; k < cells.size(); ++k) cells[k].runs = cells[first_alike(k)].runs;
}

}  // namespace estuary::coupler
