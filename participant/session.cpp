#include "session.hpp"

#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <cmath>

#include "file_digest.hpp"
#include "scene.hpp"

namespace estuary {
namespace {

// A request that the life of a participant does not allow now.
struct OutOfOrder : std::logic_error {
  using std::logic_error::logic_error;
};

v1::Error error_of(v1::Error::Kind kind, std::string field, std::string message, std::string advice = {}) {
  v1::Error error;
  error.set_kind(kind);
  error.set_field(std::move(field));
  error.set_message(std::move(message));
  error.set_advice(std::move(advice));
  return error;
}

}  // namespace

std::uint64_t PeakMemory::bytes() {
  constexpr std::chrono::milliseconds interval{100};
  const auto now = std::chrono::steady_clock::now();
  if (bytes_ == 0 || now - asked_ > interval) {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    bytes_ = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
    asked_ = now;
  }
  return bytes_;
}

v1::Configured configure(Participant& participant, const v1::Configure& request,
                         const std::optional<std::filesystem::path>& files_below) {
  const std::vector<std::string> overrides(request.overrides().begin(), request.overrides().end());
  Scene scene = Scene::parse(request.scene(), request.scene_name(), overrides);
  if (files_below) scene.confine_files(*files_below);
  v1::Configured configured;
  if (scene.problems().empty()) {
    const Plan plan = participant.configure(scene, request.role());
    for (const auto& [name, value] : plan.derived) {
      auto* entry = configured.add_plan();
      entry->set_name(name);
      entry->set_value(value);
    }
    for (const auto& warning : plan.warnings) configured.add_warnings(warning);
    for (const auto& item : plan.left_out) configured.add_left_out(item);
    configured.set_memory_bytes(plan.memory_bytes);
    configured.set_expected_updates(plan.expected_updates);
    configured.set_variant(plan.variant);
  }
  for (const auto& problem : scene.problems()) {
    auto* entry = configured.add_problems();
    entry->set_line(problem.line);
    entry->set_column(problem.column);
    entry->set_message(problem.message);
  }
  return configured;
}

Session::Session(Participant& participant, std::filesystem::path folder, ProgressBoard& board, bool confined)
    : participant_(participant), folder_(std::move(folder)), board_(board), confined_(confined) {
  participant_.report_to(board_);
}

v1::Reply Session::answer(const v1::Request& request) {
  v1::Reply reply;
  const auto begin = std::chrono::steady_clock::now();
  try {
    reply = carry_out(request);
  } catch (const Diverged& error) {
    *reply.mutable_error() = error_of(v1::Error::DIVERGED, error.field, error.what(), error.advice);
  } catch (const NotConverged& error) {
    *reply.mutable_error() = error_of(v1::Error::NOT_CONVERGED, "", error.what(), error.advice);
  } catch (const BadInput& error) {
    *reply.mutable_error() = error_of(v1::Error::BAD_MESSAGE, error.field, error.what());
  } catch (const OutOfOrder& error) {
    *reply.mutable_error() = error_of(v1::Error::OUT_OF_ORDER, "", error.what());
  } catch (const std::invalid_argument& error) {
    *reply.mutable_error() = error_of(v1::Error::BAD_MESSAGE, "", error.what());
  } catch (const Interrupted&) {
    *reply.mutable_error() = error_of(v1::Error::FAILED, "", "stopped while computing, as asked");
  } catch (const std::bad_alloc&) {
    *reply.mutable_error() = error_of(v1::Error::FAILED, "", "out of memory", "use a coarser resolution");
  } catch (const std::exception& error) {
    *reply.mutable_error() = error_of(v1::Error::FAILED, "", error.what());
  }
  *reply.mutable_header() = request.header();
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin;
  compute_seconds_ += elapsed.count();
  reply.set_compute_s(elapsed.count());
  if (reply.has_advanced()) {
    reply.mutable_advanced()->mutable_work()->set_compute_s(compute_seconds_);
  }
  return reply;
}

void Session::require_started(const char* phase) const {
  if (!started_) throw OutOfOrder(fmt::format("{} before Start", phase));
}

std::filesystem::path Session::inside_folder(const std::string& file) const {
  const std::filesystem::path path(file);
  if (path.empty() || path.has_parent_path() || file == "." || file == "..") {
    throw BadInput("file", fmt::format("'{}' is not a plain file name", file));
  }
  std::error_code ignored;
  if (std::filesystem::is_symlink(folder_ / path, ignored))
    throw BadInput("file", fmt::format("'{}' is a link that leads elsewhere", file));
  return folder_ / path;
}

v1::Reply Session::carry_out(const v1::Request& request) {
  v1::Reply reply;
  switch (request.phase_case()) {
    case v1::Request::kConfigure: {
      if (started_) throw OutOfOrder("Configure after Start");
      *reply.mutable_configured() =
          configure(participant_, request.configure(), confined_ ? std::optional(folder_) : std::nullopt);
      configured_ = reply.configured().problems().empty();
      break;
    }
    case v1::Request::kStart: {
      if (!configured_) throw OutOfOrder("Start before a Configure without problems");
      if (started_) throw OutOfOrder("a second Start");
      *reply.mutable_started()->mutable_initial() = participant_.start(request.start().initial(), folder_);
      if (const auto step = participant_.window_step()) reply.mutable_started()->set_window_step(*step);
      started_ = true;
      break;
    }
    case v1::Request::kAdvance: {
      require_started("Advance");
      advance(request, reply);
      break;
    }
    case v1::Request::kAccept: {
      require_started("Accept");
      if (!advanced_) throw OutOfOrder("Accept without a completed Advance");
      participant_.accept();
      advanced_ = false;
      reply.mutable_done();
      break;
    }
    case v1::Request::kSave: {
      require_started("Save");
      save(request.save().file(), *reply.mutable_done());
      break;
    }
    case v1::Request::kLoad: {
      require_started("Load");
      load(request.load());
      reply.mutable_done();
      break;
    }
    case v1::Request::kFrame: {
      require_started("Frame");
      auto* done = reply.mutable_done();
      for (const auto& file : participant_.frame(request.frame().number(), request.frame().time())) {
        done->add_files(file);
      }
      break;
    }
    case v1::Request::kStop: {
      stopped_ = true;
      participant_.stop();
      reply.mutable_done();
      break;
    }
    case v1::Request::kHello:
    case v1::Request::PHASE_NOT_SET:
      throw BadInput("phase", "the request names no phase to carry out");
  }
  return reply;
}

void Session::save(const std::string& name, v1::Done& done) {
  const std::filesystem::path file = inside_folder(name);
  // What an earlier Save left must not be taken for this one's.
  std::filesystem::remove(file);
  participant_.save(file);
  if (!std::filesystem::exists(file)) throw std::runtime_error("this participant cannot save its state");
  const FileSum sum = sum_of_file(file);
  done.add_files(name);
  done.mutable_digest()->set_bytes(sum.bytes);
  done.mutable_digest()->set_crc32(sum.crc32);
}

void Session::load(const v1::Load& request) {
  const std::filesystem::path file = inside_folder(request.file());
  if (request.has_digest()) require_sum(file, {request.digest().bytes(), request.digest().crc32()});
  participant_.load(file);
  advanced_ = false;
}

void Session::advance(const v1::Request& request, v1::Reply& reply) {
  const v1::Advance& message = request.advance();
  if (!std::isfinite(message.time()) || !std::isfinite(message.duration()) || message.duration() < 0) {
    throw BadInput("duration",
                   fmt::format("a window from {} s lasting {} s", message.time(), message.duration()));
  }
  if (request.header().window() == 0 || request.header().iteration() == 0) {
    throw BadInput("header", "windows and iterations count from 1");
  }
  const Window window{.number = request.header().window(),
                      .iteration = request.header().iteration(),
                      .mode = message.mode() == v1::Advance::STEADY ? Mode::steady : Mode::transient,
                      .time = message.time(),
                      .duration = message.duration()};
  advanced_ = false;
  AdvanceResult result = participant_.advance(window, message.inputs(), board_);
  advanced_ = true;
  if (message.accept()) {
    participant_.accept();
    advanced_ = false;
  }
  v1::Advanced& advanced = *reply.mutable_advanced();
  *advanced.mutable_outputs() = std::move(result.outputs);
  for (const auto& watch : result.watches) {
    auto* sample = advanced.add_watches();
    sample->set_name(watch.name);
    for (const auto& [quantity, value] : watch.quantities) {
      sample->add_quantity(quantity);
      sample->add_value(value);
    }
  }
  v1::Work& work = *advanced.mutable_work();
  work.set_steps(result.work.steps);
  work.set_updates(result.work.updates);
  work.set_bytes_per_update(result.work.bytes_per_update);
  if (result.work.energy_error) work.set_energy_error(*result.work.energy_error);
  work.set_peak_rss_bytes(peak_memory_.bytes());
  for (const auto& [phase, seconds] : result.work.phase_seconds) {
    auto* entry = work.add_phases();
    entry->set_phase(phase);
    entry->set_seconds(seconds);
  }
  for (const double component : result.surface_force) advanced.add_surface_force(component);
  advanced.set_surface_moment(result.surface_moment);
  advanced.set_remaining_error(result.remaining_error);
}

}  // namespace estuary
