#include "run_command.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <optional>

#include "checks.hpp"
#include "coupling_loop.hpp"
#include "participants.hpp"
#include "progress_bar.hpp"
#include "report.hpp"
#include "run_record.hpp"
#include "summary.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// Time a participant has to end by itself: after a good run it may still close files; after a failure nobody
// waits.
constexpr double end_patiently = 5.0;
constexpr double end_quickly = 0.3;

void prepare_folder(const std::filesystem::path& folder, const CheckedScene& scene) {
  // What an earlier run left would be taken for this run's.
  for (const auto* name : {"summary.json", "iterations.csv", "convergence.csv", "report.html", "report",
                           "watch", "log", "record", "fluid", "solid", "grains"}) {
    std::filesystem::remove_all(folder / name);
  }
  std::filesystem::create_directories(folder / "log");
  if (scene.coupling.record) std::filesystem::create_directories(folder / "record");
  for (const auto& participant : scene.coupling.participants) {
    std::filesystem::create_directories(folder / participant.role);
  }
  std::ofstream file(folder / "scene.toml");
  file << scene.as_run;
  file.close();
  if (!file) throw std::runtime_error(fmt::format("cannot write {}", (folder / "scene.toml").string()));
}

void start_log(const std::filesystem::path& folder) {
  auto sink =
      std::make_shared<spdlog::sinks::basic_file_sink_st>((folder / "log" / "coupler.log").string(), true);
  auto logger = std::make_shared<spdlog::logger>("coupler", sink);
  logger->set_pattern("%Y-%m-%d %H:%M:%S.%e %l %v");
  logger->flush_on(spdlog::level::info);
  spdlog::set_default_logger(logger);
}

void configure_all(Participants& participants, const CheckedScene& scene) {
  for (const auto& participant : participants.all()) {
    v1::Request request;
    *request.mutable_configure() = configure_message(scene.given, participant->role());
    const v1::Reply reply = participants.ask(*participant, std::move(request), {});
    if (reply.configured().problems().empty()) continue;
    std::string text;
    for (const auto& problem : reply.configured().problems()) {
      text += (text.empty() ? "" : "\n") +
              describe(scene.given.name, {problem.line(), problem.column(), problem.message()});
    }
    throw RunFailure(ExitStatus::wrong_scene, text);
  }
}

const char* status_text(ExitStatus status) {
  switch (status) {
    case ExitStatus::done:
      return "done";
    case ExitStatus::check_failed:
      return "check failed";
    case ExitStatus::wrong_scene:
      return "wrong scene";
    case ExitStatus::no_solution:
      return "diverged or not converged";
    case ExitStatus::participant_lost:
      return "participant lost";
    case ExitStatus::interrupted:
      return "interrupted";
  }
  return "unknown";
}

}  // namespace

ExitStatus run_scene(const CheckedScene& scene, const std::filesystem::path& folder,
                     const std::atomic<bool>& interrupt) {
  const auto begin = steady_clock::now();
  const auto wall_seconds = [&] {
    return std::chrono::duration<double>(steady_clock::now() - begin).count();
  };
  try {
    if (std::filesystem::exists(folder) && !std::filesystem::is_directory(folder)) {
      throw std::runtime_error(fmt::format("{} is a file; give another folder with --out", folder.string()));
    }
    prepare_folder(folder, scene);
    start_log(folder);
  } catch (const std::exception& error) {
    fmt::print(stderr, "coupler: {}\n", error.what());
    return ExitStatus::wrong_scene;
  }
  try {
    RunRecord record(folder, scene.coupling);
    ProgressBar bar(scene.coupling);
    std::unique_ptr<Participants> participants;
    ExitStatus status = ExitStatus::done;
    RunEnd end;
    try {
      participants =
          std::make_unique<Participants>(scene.coupling, folder, interrupt,
                                         [&](const RemoteParticipant& participant, const char* phase,
                                             double seconds) { bar.waiting(participant, phase, seconds); });
      configure_all(*participants, scene);
      CouplingLoop loop(scene.coupling, *participants, record, bar);
      try {
        loop.run();
      } catch (...) {
        end.total_iterations = loop.total_iterations();
        throw;
      }
      end.total_iterations = loop.total_iterations();
      end.wall_s = wall_seconds();
      participants->stop(end_patiently);
    } catch (const RunFailure& failure) {
      bar.clear();
      status = failure.status;
      end.message = failure.what();
      end.wall_s = wall_seconds();
      if (participants) participants->stop(end_quickly);
      spdlog::error("{}", failure.what());
      fmt::print(stderr, "coupler: {}\n", failure.what());
      if (!failure.advice.empty()) fmt::print(stderr, "         {}\n", failure.advice);
      fmt::print(stderr, "         what was computed until then is in {}\n", folder.string());
    }
    bar.clear();
    const RunFigures figures{.wall_s = end.wall_s, .total_iterations = end.total_iterations};
    std::vector<CheckResult> checks;
    if (status == ExitStatus::done) {
      checks = evaluate_checks(scene.coupling, record, figures);
      const bool hold =
          std::all_of(checks.begin(), checks.end(), [](const CheckResult& result) { return result.pass; });
      if (!hold) status = ExitStatus::check_failed;
    }
    end.status = status_text(status);
    write_summary(folder, scene, participants.get(), record, checks, end);
    if (status == ExitStatus::done || status == ExitStatus::check_failed) {
      fmt::print("{}\n", scene.coupling.title);
      if (!checks.empty()) fmt::print("\n{}", check_table(checks, end.wall_s));
      fmt::print("\n{}", timing_table(*participants, end.wall_s));
      try {
        write_report(folder);
        fmt::print("\nreport: {}\n", (folder / "report.html").string());
      } catch (const std::exception& error) {
        fmt::print(stderr, "coupler: no report: {}\n", error.what());
      }
      for (const auto& participant : scene.coupling.participants) {
        fmt::print("fields: {}\n", (folder / participant.role).string());
      }
    }
    return status;
  } catch (const std::exception& error) {
    // The run's own folder can no longer be written: nothing more can be kept.
    fmt::print(stderr, "coupler: {}\n", error.what());
    return ExitStatus::participant_lost;
  }
}

}  // namespace estuary::coupler
