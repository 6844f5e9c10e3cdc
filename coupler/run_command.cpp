#include "run_command.hpp"

#include <fmt/format.h>
#include <spdlog/sinks/basic_file_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <memory>
#include <optional>

#include "checkpoints.hpp"
#include "checks.hpp"
#include "coupling_loop.hpp"
#include "elapsed.hpp"
#include "folder_lock.hpp"
#include "participants.hpp"
#include "progress_bar.hpp"
#include "report.hpp"
#include "run_record.hpp"
#include "summary.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// To standard error. Where that is a file on a full disk there is nobody to tell, and nothing to throw for.
template <typename... Arguments>
void tell_person(fmt::format_string<Arguments...> text, Arguments&&... arguments) {
  std::fputs(fmt::format(text, std::forward<Arguments>(arguments)...).c_str(), stderr);
}

// Time a participant has to end by itself: after a good run it may still close files; after a failure nobody
// waits.
constexpr double end_patiently = 5.0;
constexpr double end_quickly = 0.3;

// After an interrupt, for the window under way, so that it can be saved.
constexpr double finish_a_window = 2.0;

void prepare_folder(const std::filesystem::path& folder, const CheckedScene& scene, bool resumes) {
  // What an earlier run left would be taken for this run's.
  for (const auto* name : {"summary.json", "report.html", "report"})
    std::filesystem::remove_all(folder / name);
  for (const auto* name : {"iterations.csv", "convergence.csv", "watch", "log", "record", "checkpoint",
                           "fluid", "solid", "grains"}) {
    if (!resumes) std::filesystem::remove_all(folder / name);
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

void start_log(const std::filesystem::path& folder, bool resumes) {
  auto sink = std::make_shared<spdlog::sinks::basic_file_sink_st>((folder / "log" / "coupler.log").string(),
                                                                  !resumes);
  auto logger = std::make_shared<spdlog::logger>("coupler", sink);
  logger->set_pattern("%Y-%m-%d %H:%M:%S.%e %l %v");
  logger->flush_on(spdlog::level::warn);  // the rest with the run's tables
  spdlog::set_default_logger(logger);
}

void configure_all(Participants& participants, const CheckedScene& scene) {
  for (const auto& participant : participants.all()) {
    if (participant->started()) continue;  // it is still there after the loss of another
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

void warn_of_insecurity() {
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  tell_person(
      "{}INSECURE: the scene says insecure = true: whoever reaches an address of this run can read and "
      "change it{}\n",
      terminal ? "\033[1;31m" : "", terminal ? "\033[0m" : "");
}

// One run: from the launch to the last window, with as many new beginnings as losses allow.
class Run {
public:
  Run(const CheckedScene& scene, const std::filesystem::path& folder, bool resume,
      const std::atomic<int>& interrupts, bool report)
      : scene_(scene),
        folder_(folder),
        interrupts_(interrupts),
        report_(report),
        bar_(scene.coupling),
        checkpoints_(scene.coupling, folder, scene.resumable) {
    lock_.emplace(made(folder), FolderLock::Kind::alone, "run");
    std::vector<std::string> news;
    if (resume) sets_ = checkpoints_.usable([&](const std::string& line) { news.push_back(line); });
    // What was asked for is gone on with; what somebody may still want is not thrown away.
    if (resume && sets_.empty() && checkpoints_.any()) {
      throw std::runtime_error(
          fmt::format("{}\nno checkpoint in {} can be gone on from; without --resume the "
                      "run begins at its beginning",
                      fmt::join(news, "\n"), folder.string()));
    }
    resumes_ = !sets_.empty();
    if (scene.coupling.insecure) warn_of_insecurity();
    prepare_folder(folder, scene, resumes_);
    start_log(folder, resumes_);
    for (const auto& line : news) say(line);
    if (resumes_) {
      end_.resumed_from = sets_.front().window;
      begin_ -= std::chrono::duration_cast<steady_clock::duration>(
          std::chrono::duration<double>(sets_.front().state.wall_s));
      say(fmt::format("goes on after window {}", sets_.front().window));
    } else if (resume) {
      say("there is no checkpoint yet: the run begins at its beginning");
    }
  }

  ExitStatus carry_out() {
    if (resumes_) {
      record_ = std::make_unique<RunRecord>(folder_, scene_.coupling, sets_.front().state.record);
    } else {
      record_ = std::make_unique<RunRecord>(folder_, scene_.coupling);
    }
    ExitStatus status = ExitStatus::done;
    try {
      while (!attempt()) {
      }
      participants_->stop(end_patiently);
    } catch (const RunFailure& failure) {
      status = failure.status;
      tell(failure);
    }
    bar_.clear();
    return finish(status);
  }

private:
  static const std::filesystem::path& made(const std::filesystem::path& folder) {
    if (std::filesystem::exists(folder) && !std::filesystem::is_directory(folder))
      throw std::runtime_error(fmt::format("{} is a file; give another folder with --out", folder.string()));
    std::filesystem::create_directories(folder);
    return folder;
  }

  void say(const std::string& line) {
    bar_.clear();
    spdlog::warn("{}", line);
    tell_person("coupler: {}\n", line);
  }

  void find_checkpoints() {
    sets_ = checkpoints_.usable([this](const std::string& line) { say(line); });
  }

  [[nodiscard]] double wall_seconds() const { return seconds_since(begin_); }

  // False when a participant was lost and the run is to go on from a checkpoint, or from its beginning.
  bool attempt() {
    try {
      if (!participants_) {
        participants_ = std::make_unique<Participants>(
            scene_.coupling, folder_, resumes_, interrupts_,
            [&](const RemoteParticipant& participant, const char* phase, double seconds) {
              bar_.waiting(participant, phase, seconds);
              if (record_->flush_if_due()) spdlog::default_logger()->flush();
            });
        if (checkpoints_.wanted()) participants_->allow_after_interrupt(finish_a_window);
        participants_->record_messages(sets_.empty());
      } else {
        // What is repeated on the way to a checkpoint is no part of a record.
        if (sets_.empty()) participants_->records_go_back({});
        participants_->record_messages(sets_.empty());
        participants_->bring_back();
      }
      configure_all(*participants_, scene_);
      CouplingLoop loop(scene_.coupling, *participants_, *record_, bar_, checkpoints_, begin_);
      try {
        loop.start();
        go_back(loop);
        participants_->record_messages(true);
        const auto begin = steady_clock::now();
        const double asked_s = participants_->asking_s();
        loop.run();
        end_.coupler_s += seconds_since(begin) - (participants_->asking_s() - asked_s);
      } catch (...) {
        end_.total_iterations = loop.total_iterations();
        throw;
      }
      end_.total_iterations = loop.total_iterations();
      end_.wall_s = wall_seconds();
      return true;
    } catch (const RunFailure& failure) {
      if (!may_relaunch(failure)) throw;
      const auto begin = steady_clock::now();
      find_checkpoints();
      const std::string from = sets_.empty() ? std::string("from the beginning")
                                             : fmt::format("after window {}", sets_.front().window);
      say(fmt::format("{}; goes on {}", failure.what(), from));
      if (sets_.empty()) record_->begin_anew();
      recovery_begin_ = begin;
      return false;
    }
  }

  bool may_relaunch(const RunFailure& failure) {
    if (!failure.lost || !participants_ || interrupts_ > 0) return false;
    // A checkpoint since the last loss: the run gets further.
    if (checkpoints_.written() > written_at_loss_) relaunches_ = 0;
    written_at_loss_ = checkpoints_.written();
    if (relaunches_ >= scene_.coupling.recovery.relaunches) return false;
    ++relaunches_;
    ++end_.relaunches;
    return true;
  }

  // To the newest checkpoint that everyone can load.
  void go_back(CouplingLoop& loop) {
    while (!sets_.empty()) {
      try {
        loop.go_to(sets_.front());
        spdlog::info("everyone is back after window {}", sets_.front().window);
        note_recovery();
        return;
      } catch (const RunFailure&) {
        throw;
      } catch (const std::exception& error) {
        say(fmt::format("the checkpoint of window {} cannot be used: {}", sets_.front().window,
                        error.what()));
        checkpoints_.drop(sets_.front());
        sets_.erase(sets_.begin());
        if (sets_.empty())
          throw RunFailure(ExitStatus::participant_lost, "no checkpoint can be gone on from");
        say(fmt::format("goes on after window {}", sets_.front().window));
      }
    }
    for (const auto& participant : participants_->all())
      if (relaunched() && participant->started())
        throw RunFailure(ExitStatus::participant_lost,
                         fmt::format("participant '{}' was not launched by this run and cannot begin again",
                                     participant->role()));
    note_recovery();
  }

  [[nodiscard]] bool relaunched() const { return end_.relaunches > 0; }

  void note_recovery() {
    if (!recovery_begin_) return;
    const double seconds = seconds_since(*recovery_begin_);
    end_.recovery_s += seconds;
    spdlog::info("recovered in {:.3f} s", seconds);
    recovery_begin_.reset();
  }

  void tell(const RunFailure& failure) {
    bar_.clear();
    end_.message = failure.what();
    end_.wall_s = wall_seconds();
    if (participants_) participants_->stop(end_quickly);
    spdlog::error("{}", failure.what());
    tell_person("coupler: {}\n", failure.what());
    if (!failure.advice.empty()) tell_person("         {}\n", failure.advice);
    tell_person("         what was computed until then is in {}\n", folder_.string());
    if (const auto window = checkpoints_.newest_window())
      tell_person("         saved after window {}: the same command with --resume goes on from there\n",
                  *window);
  }

  ExitStatus finish(ExitStatus status) {
    RecordedRun recorded;
    if (record_) {
      record_->flush();
      recorded = record_->read();
    }
    end_.checkpoints = checkpoints_.written();
    end_.checkpoint_s = checkpoints_.seconds();
    const RunFigures figures{.wall_s = end_.wall_s, .total_iterations = end_.total_iterations};
    std::vector<CheckResult> checks;
    if (status == ExitStatus::done) {
      checks = evaluate_checks(scene_.coupling, recorded, figures);
      const bool hold =
          std::all_of(checks.begin(), checks.end(), [](const CheckResult& result) { return result.pass; });
      if (!hold) status = ExitStatus::check_failed;
    }
    end_.status = status_text(status);
    write_summary(folder_, scene_, participants_.get(), recorded, checks, end_);
    if (status == ExitStatus::done || status == ExitStatus::check_failed) print_results(checks);
    return status;
  }

  void print_results(const std::vector<CheckResult>& checks) const {
    fmt::print("{}\n", scene_.coupling.title);
    if (!checks.empty()) fmt::print("\n{}", check_table(checks, end_.wall_s));
    fmt::print("\n{}", timing_table(*participants_, end_));
    try {
      if (report_) write_report(folder_);
      if (report_) fmt::print("\nreport: {}\n", (folder_ / "report.html").string());
    } catch (const std::exception& error) {
      tell_person("coupler: no report: {}\n", error.what());
    }
    for (const auto& participant : scene_.coupling.participants)
      fmt::print("fields: {}\n", (folder_ / participant.role).string());
  }

  const CheckedScene& scene_;
  std::filesystem::path folder_;
  const std::atomic<int>& interrupts_;
  const bool report_;                                     // a page at the end
  steady_clock::time_point begin_ = steady_clock::now();  // less what it took before it was resumed
  ProgressBar bar_;
  Checkpoints checkpoints_;
  std::optional<FolderLock> lock_;
  std::vector<CheckpointSet> sets_;  // to go back to, newest first
  bool resumes_ = false;
  std::unique_ptr<RunRecord> record_;
  std::unique_ptr<Participants> participants_;
  RunEnd end_;
  int relaunches_ = 0;  // since the last new checkpoint
  std::uint64_t written_at_loss_ = 0;
  std::optional<steady_clock::time_point> recovery_begin_;
};

}  // namespace

ExitStatus run_scene(const CheckedScene& scene, const std::filesystem::path& folder, bool resume,
                     const std::atomic<int>& interrupts, bool report) {
  std::optional<Run> run;
  try {
    run.emplace(scene, folder, resume, interrupts, report);
  } catch (const std::exception& error) {
    tell_person("coupler: {}\n", error.what());
    return ExitStatus::wrong_scene;
  }
  try {
    return run->carry_out();
  } catch (const std::exception& error) {
    // The run's own folder can no longer be written: nothing more can be kept.
    tell_person("coupler: {}\n", error.what());
    return ExitStatus::participant_lost;
  }
}

}  // namespace estuary::coupler
