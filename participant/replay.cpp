#include "replay.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <cmath>

#include "wet_surface.hpp"

namespace estuary {
namespace {

using Doubles = google::protobuf::RepeatedField<double>;

// Relative L2 difference; throws when the numbers of values differ.
double difference(const Doubles& now, const Doubles& recorded, const char* field, const Window& window) {
  if (now.size() != recorded.size()) {
    throw BadInput(field,
                   fmt::format("has {} values in window {}; the recorded run had {}: the record belongs to "
                               "another wet surface",
                               now.size(), window.number, recorded.size()));
  }
  double change = 0;
  double size = 0;
  for (int i = 0; i < now.size(); ++i) {
    change += (now[i] - recorded[i]) * (now[i] - recorded[i]);
    size += recorded[i] * recorded[i];
  }
  return change == 0 ? 0.0 : std::sqrt(change / std::max(size, change));
}

}  // namespace

Replay::Replay(const std::filesystem::path& record, Beyond beyond) : reader_(record), beyond_(beyond) {
  bool configured = false;
  bool started = false;
  for (std::uint64_t begin = 0; auto entry = reader_.next(); begin = reader_.position()) {
    if (entry->reply.has_welcome()) welcome_ = std::move(*entry->reply.mutable_welcome());
    if (entry->reply.has_configured()) {
      configured = true;
      role_ = entry->request.configure().role();
      configured_ = std::move(*entry->reply.mutable_configured());
    }
    if (entry->reply.has_started()) {
      started = true;
      start_ = std::move(*entry->request.mutable_start());
      started_ = std::move(*entry->reply.mutable_started());
    }
    if (entry->request.has_advance())
      entries_[entry->request.header().window()][entry->request.header().iteration()] = begin;
  }
  if (!configured || !started || entries_.empty())
    throw std::runtime_error(fmt::format(
        "the record {} ends before the first window: there is nothing to replay", record.string()));
}

Identity Replay::identity() const {
  return {.name = "replay of " + welcome_.name(),
          .version = welcome_.version(),
          .roles = {role_},
          .capabilities = {welcome_.capabilities().begin(), welcome_.capabilities().end()},
          .dimensions = {welcome_.dimensions().begin(), welcome_.dimensions().end()}};
}

Plan Replay::configure(Scene& scene, const std::string& role) {
  if (role != role_)
    scene.root().table(role).problem(
        "solver", fmt::format("the record is one of '{}', it cannot answer as '{}'", role_, role));
  Plan plan;
  plan.derived.emplace_back(
      "replays", fmt::format("{} windows of {} {}", entries_.size(), welcome_.name(), welcome_.version()));
  plan.variant = "replay";
  return plan;
}

v1::Exchange Replay::start(const v1::Exchange& initial, const std::filesystem::path& /*folder*/) {
  const std::size_t now = node_count(initial.wet_surface());
  const std::size_t then = node_count(start_.initial().wet_surface());
  if (now != then)
    throw BadInput("initial.wet_surface",
                   fmt::format("has {} nodes; that of the recorded run had {}", now, then));
  return started_.initial();
}

std::optional<double> Replay::window_step() const {
  return started_.has_window_step() ? std::optional<double>(started_.window_step()) : std::nullopt;
}

RecordReader::Entry Replay::entry_of(const Window& window) {
  const auto found = entries_.find(window.number);
  if (found == entries_.end())
    throw BadInput("header.window", fmt::format("window {} was not recorded; the record ends with window {}",
                                                window.number, entries_.rbegin()->first));
  const auto& iterations = found->second;
  if (beyond_ == Beyond::accepted) return reader_.at(iterations.rbegin()->second);
  const auto entry = iterations.find(window.iteration);
  if (entry == iterations.end())
    throw BadInput(
        "header.iteration",
        fmt::format("iteration {} of window {} was not recorded, which took {}: the partner answers "
                    "otherwise than in the recorded run (`replay --accepted` answers every iteration "
                    "with what was accepted)",
                    window.iteration, window.number, iterations.rbegin()->first));
  return reader_.at(entry->second);
}

void Replay::compare(const Window& window, const v1::Exchange& inputs, const v1::Exchange& recorded) {
  const auto note = [&](const Doubles& now, const Doubles& then, const char* field) {
    const double largest = difference(now, then, field, window);
    if (largest <= largest_difference_) return;
    largest_difference_ = largest;
    different_window_ = window.number;
  };
  note(inputs.displacements().displacement(), recorded.displacements().displacement(),
       "inputs.displacements");
  note(inputs.displacements().velocity(), recorded.displacements().velocity(), "inputs.displacements");
  note(inputs.forces().force(), recorded.forces().force(), "inputs.forces");
  note(inputs.grain_states().centre(), recorded.grain_states().centre(), "inputs.grain_states");
  note(inputs.grain_forces().force(), recorded.grain_forces().force(), "inputs.grain_forces");
}

AdvanceResult Replay::advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& /*progress*/) {
  const RecordReader::Entry entry = entry_of(window);
  const v1::Advance& asked = entry.request.advance();
  const double resolution = 1e-9 * std::max(window.duration, asked.duration());
  if (std::abs(window.time - asked.time()) > resolution ||
      std::abs(window.duration - asked.duration()) > resolution) {
    throw BadInput(
        "time", fmt::format("window {} begins at {} s and lasts {} s; in the recorded run it began at {} s "
                            "and lasted {} s",
                            window.number, window.time, window.duration, asked.time(), asked.duration()));
  }
  compare(window, inputs, asked.inputs());
  ++answered_;
  if (entry.reply.has_error()) {
    const v1::Error& error = entry.reply.error();
    if (error.kind() == v1::Error::NOT_CONVERGED) throw NotConverged(error.message(), error.advice());
    throw Diverged(error.field(), error.message(), error.advice());
  }
  const v1::Advanced& answer = entry.reply.advanced();
  AdvanceResult result;
  result.outputs = answer.outputs();
  for (const auto& sample : answer.watches()) {
    WatchValues values{.name = sample.name(), .quantities = {}};
    for (int i = 0; i < sample.quantity_size(); ++i)
      values.quantities.emplace_back(sample.quantity(i), sample.value(i));
    result.watches.push_back(std::move(values));
  }
  result.surface_force.assign(answer.surface_force().begin(), answer.surface_force().end());
  result.surface_moment = answer.surface_moment();
  result.remaining_error = answer.remaining_error();
  return result;
}

void Replay::save(const std::filesystem::path& /*file*/) {
  throw std::runtime_error("a replay has no state to save");
}

void Replay::load(const std::filesystem::path& /*file*/) {
  throw std::runtime_error("a replay has no state to load");
}

void Replay::stop() {
  if (largest_difference_ == 0) {
    spdlog::info("{} answers given; the inputs were those of the recorded run, bit for bit", answered_);
  } else {
    spdlog::info(
        "{} answers given; the inputs differed from the recorded ones by at most {:.3e} (relative L2), in "
        "window {}",
        answered_, largest_difference_, different_window_);
  }
}

}  // namespace estuary
