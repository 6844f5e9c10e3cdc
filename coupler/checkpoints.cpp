#include "checkpoints.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "atomic_file.hpp"
#include "elapsed.hpp"
#include "failure.hpp"
#include "requirements.hpp"

namespace estuary::coupler {
namespace {

using Json = nlohmann::ordered_json;
using std::chrono::steady_clock;

constexpr std::uint64_t layout_version = 2;
// Checkpoints that come by the clock cost at most this share of a run.
constexpr double largest_share = 0.02;

Json json_of(const FileSum& sum) {
  return {{"bytes", sum.bytes}, {"crc32", sum.crc32}};
}

FileSum sum_of(const Json& json) {
  return {json.at("bytes").get<std::uint64_t>(), json.at("crc32").get<std::uint32_t>()};
}

std::uint32_t sum_of_text(const std::string& text) {
  return crc32_of(text.data(), text.size());
}

// The first line in which the scene of the folder differs from `scene`, for people.
std::string first_difference(const std::filesystem::path& folder, const std::string& scene) {
  std::ifstream file(folder / "scene.toml");
  std::ostringstream text;
  text << file.rdbuf();
  const Scene earlier = Scene::parse(text.str(), "scene.toml");
  std::istringstream before(resumable_text(earlier));
  std::istringstream now(scene);
  std::string line_before;
  std::string line_now;
  while (true) {
    const bool more_before = static_cast<bool>(std::getline(before, line_before));
    const bool more_now = static_cast<bool>(std::getline(now, line_now));
    if (!more_before && !more_now) return {};
    if (!more_before) line_before = "nothing";
    if (!more_now) line_now = "nothing";
    if (line_before != line_now)
      return fmt::format(": it had '{}' where this scene has '{}'", line_before, line_now);
  }
}

}  // namespace

std::string resumable_text(const Scene& scene) {
  constexpr std::array<std::string_view, 30> may_change = {"recovery",
                                                           "hosts",
                                                           "check",
                                                           "title",
                                                           "insecure",
                                                           "coupling.end_time",
                                                           "coupling.min_iterations",
                                                           "coupling.max_iterations",
                                                           "coupling.at_max_iterations",
                                                           "coupling.tolerance",
                                                           "coupling.velocity_tolerance",
                                                           "coupling.force_tolerance",
                                                           "coupling.convergence",
                                                           "coupling.relaxation",
                                                           "coupling.recover",
                                                           "coupling.connect_timeout",
                                                           "coupling.stall_timeout",
                                                           "fluid.solver",
                                                           "fluid.connect",
                                                           "fluid.threads",
                                                           "fluid.ranks",
                                                           "fluid.host",
                                                           "solid.solver",
                                                           "solid.connect",
                                                           "solid.threads",
                                                           "solid.host",
                                                           "grains.solver",
                                                           "grains.connect",
                                                           "grains.threads",
                                                           "grains.host"};
  return scene.canonical(may_change);
}

Checkpoints::Checkpoints(const CouplingScene& coupling, std::filesystem::path folder, std::string scene)
    : coupling_(coupling), folder_(std::move(folder)), scene_(std::move(scene)), last_(steady_clock::now()) {}

std::filesystem::path Checkpoints::set_file(std::uint64_t slot) const {
  return folder_ / "checkpoint" / fmt::format("set-{}.json", slot);
}

std::filesystem::path Checkpoints::coupler_file(std::uint64_t slot) const {
  return folder_ / "checkpoint" / fmt::format("coupler-{}.h5", slot);
}

bool Checkpoints::wanted() const {
  return !impossible_ && coupling_.mode == CouplingMode::transient &&
         coupling_.recovery.every != std::uint64_t{0};
}

bool Checkpoints::start_wanted() const {
  return wanted() && std::any_of(coupling_.participants.begin(), coupling_.participants.end(),
                                 [](const ParticipantScene& one) { return !one.launched(); });
}

bool Checkpoints::due(std::uint64_t window) const {
  if (!wanted()) return false;
  const RecoveryScene& recovery = coupling_.recovery;
  if (recovery.every) return window % *recovery.every == 0;
  const double rest = last_cost_ / largest_share - last_cost_;
  return seconds_since(last_) >= std::max(recovery.every_seconds, rest);
}

std::uint64_t Checkpoints::next_slot() const {
  for (std::uint64_t slot = 0; slot < static_cast<std::uint64_t>(coupling_.recovery.keep); ++slot)
    if (std::find(slots_.begin(), slots_.end(), slot) == slots_.end()) return slot;
  return slots_.back();
}

bool Checkpoints::write(Participants& participants, const Position& position, CouplerState state) {
  for (const auto& participant : participants.all()) {
    if (can(participant->identity(), "checkpoint")) continue;
    impossible_ = true;
    const std::string line =
        fmt::format("no checkpoints: '{}' ({} {}) keeps none, so this run cannot be resumed",
                    participant->role(), participant->identity().name(), participant->identity().version());
    spdlog::warn("{}", line);
    std::fputs(fmt::format("coupler: {}\n", line).c_str(), stderr);
    return false;
  }
  const auto begin = steady_clock::now();
  CheckpointSet set{.slot = next_slot(), .window = state.window, .files = {}, .state = {}};
  set.state = std::move(state);
  const auto failed = [&](const std::string& why) {
    last_ = steady_clock::now();
    seconds_ += seconds_since(begin);
    const std::string line = fmt::format("no checkpoint of window {}: {}{}", set.window, why,
                                         newest_ ? fmt::format("; that of window {} stays", *newest_) : "");
    spdlog::warn("{}", line);
    std::fputs(fmt::format("coupler: {}\n", line).c_str(), stderr);
    return false;
  };
  try {
    std::filesystem::create_directories(folder_ / "checkpoint");
    // From here on until the end the slot holds parts of two sets.
    std::filesystem::remove(set_file(set.slot));
    std::erase(slots_, set.slot);
    std::vector<Participants::Question> questions;
    for (const auto& participant : participants.all()) {
      questions.push_back({participant.get(), {}});
      questions.back().request.mutable_save()->set_file(fmt::format("checkpoint-{}.h5", set.slot));
    }
    const auto replies = participants.ask_all(std::move(questions), position);
    for (std::size_t k = 0; k < replies.size(); ++k) {
      const v1::Done& done = replies[k].done();
      set.files.push_back({participants.all()[k]->role(), fmt::format("checkpoint-{}.h5", set.slot), {}});
      if (done.has_digest()) set.files.back().sum = {done.digest().bytes(), done.digest().crc32()};
    }
    complete(set);
  } catch (const RunFailure& failure) {
    if (failure.lost || failure.status != ExitStatus::participant_lost) throw;
    return failed(failure.what());
  } catch (const std::exception& error) {
    return failed(error.what());
  }
  slots_.insert(slots_.begin(), set.slot);
  newest_ = set.window;
  ++written_;
  last_ = steady_clock::now();
  last_cost_ = seconds_since(begin);
  seconds_ += last_cost_;
  spdlog::info("checkpoint of window {} in slot {}, {:.3f} s", set.window, set.slot, last_cost_);
  return true;
}

void Checkpoints::complete(const CheckpointSet& set) {
  write_coupler_state(coupler_file(set.slot), set.state);
  Json files = Json::array();
  for (const auto& file : set.files) {
    Json entry = {{"participant", file.participant}, {"file", file.name}};
    if (file.sum) entry.update(json_of(*file.sum));
    files.push_back(entry);
  }
  Json json = {{"estuary", ESTUARY_VERSION},
               {"layout", layout_version},
               {"scene", sum_of_text(scene_)},
               {"window", set.window},
               {"time", set.state.time},
               {"written", fmt::format("{:%Y-%m-%d %H:%M:%S}", fmt::localtime(std::time(nullptr)))},
               {"participants", files},
               {"coupler", json_of(sum_of_file(coupler_file(set.slot)))}};
  const std::string text = json.dump(2) + '\n';
  write_atomically(set_file(set.slot), std::as_bytes(std::span(text)));
}

bool Checkpoints::any() const {
  std::error_code missing;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "checkpoint", missing))
    if (entry.path().extension() == ".json") return true;
  return false;
}

CheckpointSet Checkpoints::read(const std::filesystem::path& file) const {
  std::ifstream stream(file);
  const Json json = Json::parse(stream);
  const auto version = json.at("estuary").get<std::string>();
  if (json.at("layout").get<std::uint64_t>() != layout_version || version != ESTUARY_VERSION) {
    throw WrongCheckpoint(
        fmt::format("{} was written by version {} of Estuary (layout {}), this is {} (layout {})",
                    file.string(), version, json.at("layout").dump(), ESTUARY_VERSION, layout_version));
  }
  if (json.at("scene").get<std::uint32_t>() != sum_of_text(scene_)) {
    throw WrongCheckpoint(
        fmt::format("{} belongs to another scene{}", file.string(), first_difference(folder_, scene_)));
  }
  CheckpointSet set;
  const std::string name = file.stem().string();
  set.slot = std::stoull(name.substr(name.find('-') + 1));
  require_sum(coupler_file(set.slot), sum_of(json.at("coupler")));
  set.state = read_coupler_state(coupler_file(set.slot));
  set.window = set.state.window;
  for (const auto& entry : json.at("participants")) {
    CheckpointSet::File one{entry.at("participant"), entry.at("file"), {}};
    if (entry.contains("crc32")) one.sum = sum_of(entry);
    const ParticipantScene* participant = coupling_.find(one.participant);
    if (participant == nullptr)
      throw std::runtime_error(fmt::format("{} has a participant '{}'", file.string(), one.participant));
    // What lies on another machine is looked at there.
    const auto here = folder_ / one.participant / one.name;
    if (one.sum && participant->here()) require_sum(here, *one.sum);
    set.files.push_back(std::move(one));
  }
  if (set.files.size() != coupling_.participants.size())
    throw std::runtime_error(fmt::format("{} lacks a participant", file.string()));
  for (const auto& [name_of_table, size] : set.state.record) {
    std::error_code missing;
    const auto now = std::filesystem::file_size(folder_ / name_of_table, missing);
    if (missing || now < size)
      throw std::runtime_error(
          fmt::format("{} does not reach as far as the checkpoint of window {}", name_of_table, set.window));
  }
  return set;
}

std::vector<CheckpointSet> Checkpoints::usable(const std::function<void(const std::string&)>& say) {
  std::vector<CheckpointSet> sets;
  std::error_code missing;
  for (const auto& entry : std::filesystem::directory_iterator(folder_ / "checkpoint", missing)) {
    if (entry.path().extension() != ".json") continue;
    try {
      sets.push_back(read(entry.path()));
    } catch (const WrongCheckpoint&) {
      throw;
    } catch (const std::exception& error) {
      say(fmt::format("a checkpoint cannot be used: {}: {}", entry.path().filename().string(), error.what()));
    }
  }
  std::sort(sets.begin(), sets.end(),
            [](const CheckpointSet& a, const CheckpointSet& b) { return a.window > b.window; });
  slots_.clear();
  for (const auto& set : sets) slots_.push_back(set.slot);
  newest_ = sets.empty() ? std::optional<std::uint64_t>() : sets.front().window;
  return sets;
}

void Checkpoints::load(Participants& participants, const CheckpointSet& set) {
  std::vector<Participants::Question> questions;
  for (const auto& file : set.files) {
    RemoteParticipant* participant = participants.find(file.participant);
    if (participant == nullptr) throw std::runtime_error("there is no participant " + file.participant);
    questions.push_back({participant, {}});
    v1::Load& load = *questions.back().request.mutable_load();
    load.set_file(file.name);
    if (!file.sum) continue;
    load.mutable_digest()->set_bytes(file.sum->bytes);
    load.mutable_digest()->set_crc32(file.sum->crc32);
  }
  try {
    participants.ask_all(std::move(questions), {.window = set.window, .iteration = 0});
  } catch (const RunFailure& failure) {
    if (failure.lost || failure.status == ExitStatus::interrupted) throw;
    throw std::runtime_error(failure.what());
  }
}

void Checkpoints::drop(const CheckpointSet& set) {
  std::filesystem::remove(set_file(set.slot));
  std::erase(slots_, set.slot);
}

}  // namespace estuary::coupler
