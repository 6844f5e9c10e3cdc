#include "participants.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <random>
#include <thread>
#include <utility>

#include "elapsed.hpp"
#include "failure.hpp"
#include "requirements.hpp"

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;

// How often a wait looks at everything that is not a message: children that ended, silence, an interrupt.
constexpr std::chrono::milliseconds look_round{20};
const char* const other_protocol =
    "build the solver with the messages of this coupler (proto/estuary/v1), or run the coupler it was built "
    "for";
// A reply that has not come although the participant says it is idle was lost; ask again.
constexpr double ask_again_after = 1.0;
// For ssh and srun to end what they launched [s].
constexpr double remote_end = 1.0;
// How long a process that runs on this machine may be silent.
constexpr std::chrono::milliseconds starved_at_most{15000};

std::string new_run_id() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}", random(), random());
}

std::filesystem::path make_socket_folder() {
  std::string name = (std::filesystem::temp_directory_path() / "estuary-XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) {
    throw RunFailure(
        ExitStatus::participant_lost,
        fmt::format("cannot make a folder for local sockets at {}: {}", name, std::strerror(errno)));
  }
  return name;
}

// Of a participant's output, two lines: what the far side said, and what ssh or srun made of it.
std::string last_lines(const std::filesystem::path& folder, const std::string& role) {
  std::ifstream in(folder / "log" / (role + ".log"));
  std::string before;
  std::string last;
  for (std::string line; std::getline(in, line);) {
    line.erase(line.find_last_not_of("\r\n ") + 1);
    // ssh's farewell, after whatever went wrong.
    const bool farewell = line.starts_with("Connection to ") && line.ends_with(" closed.");
    if (!line.empty() && !farewell) before = std::exchange(last, line);
  }
  return before.empty() ? last : before + " | " + last;
}

std::string at(const Position& position) {
  return fmt::format("window {}, iteration {}", position.window, position.iteration);
}

ExitStatus status_of(v1::Error::Kind kind) {
  switch (kind) {
    case v1::Error::DIVERGED:
    case v1::Error::NOT_CONVERGED:
      return ExitStatus::no_solution;
    case v1::Error::VERSION:
      return ExitStatus::wrong_scene;
    default:
      return ExitStatus::participant_lost;
  }
}

}  // namespace

Participants::Participants(const CouplingScene& scene, const std::filesystem::path& folder, bool go_on,
                           const std::atomic<int>& interrupts, WaitingObserver observer)
    : scene_(scene),
      folder_(folder),
      interrupts_(interrupts),
      observer_(std::move(observer)),
      run_id_(new_run_id()),
      sockets_(make_socket_folder()) {
  try {
    for (const auto& entry : scene.participants) {
      auto participant = std::make_unique<RemoteParticipant>(entry, endpoint_of(entry), security_of(entry));
      if (scene.record) {
        participant->record_ =
            std::make_unique<RecordWriter>(folder / "record" / (entry.role + ".record"), go_on);
      }
      if (entry.launched()) launch(*participant, participant->channel_.endpoint(), folder);
      all_.push_back(std::move(participant));
    }
    for (auto& participant : all_) greet(*participant);
  } catch (const ChannelError& error) {
    std::filesystem::remove_all(sockets_);
    throw RunFailure(ExitStatus::participant_lost, error.what());
  } catch (RunFailure& failure) {
    // Who has never been there will hardly come when asked again.
    failure.lost = false;
    std::error_code ignored;
    std::filesystem::remove_all(sockets_, ignored);
    throw;
  } catch (...) {
    std::error_code ignored;
    std::filesystem::remove_all(sockets_, ignored);
    throw;
  }
}

ClientSecurity Participants::security_of(const ParticipantScene& participant) const {
  ClientSecurity security{.insecure = scene_.insecure};
  if (participant.public_key.empty()) return security;
  try {
    security.own = read_pair(scene_.coupler_key);
    security.server_key = read_public_key(participant.public_key);
  } catch (const KeyError& error) {
    throw RunFailure(ExitStatus::wrong_scene, error.what());
  }
  return security;
}

// A new path for each process: what was sent to the one before never reaches it.
std::string Participants::endpoint_of(const ParticipantScene& participant) const {
  if (!participant.endpoint.empty()) return participant.endpoint;
  const std::string name =
      generation_ == 0 ? participant.role : fmt::format("{}.{}", participant.role, generation_);
  return fmt::format("ipc://{}/{}", sockets_.string(), name);
}

void Participants::bring_back() {
  ++generation_;
  for (auto& participant : all_)
    if (participant->child_ && !participant->scene_.here()) participant->child_->ask_to_end();
  for (auto& participant : all_)
    if (participant->child_) participant->child_->end(participant->scene_.here() ? 0.0 : remote_end);
  for (auto& participant : all_) renew(*participant);
  for (auto& participant : all_) {
    const std::uint64_t process = participant->identity_.process();
    greet(*participant);
    if (participant->child_) continue;
    const bool same =
        participant->identity_.process() == process && participant->identity_.run_id() == run_id_;
    if (same && participant->started_) {
      wait_until_idle(*participant);
      spdlog::info("{}: is still there", participant->role());
    } else {
      participant->started_.reset();
    }
  }
}

void Participants::renew(RemoteParticipant& participant) {
  participant.awaited_ = 0;
  participant.arrived_.reset();
  participant.last_heard_.reset();
  participant.reports_since_.reset();
  participant.progress_ = {};
  if (!participant.child_) return;
  participant.usage_.bytes = participant.bytes();
  participant.usage_.messages = participant.messages();
  participant.started_.reset();
  participant.channel_.drop_unsent();
  participant.channel_ = ClientChannel(endpoint_of(participant.scene_), security_of(participant.scene_));
  launch(participant, participant.channel_.endpoint(), folder_);
  participant.launched_at_ = participant.last_attempt_at_ = steady_clock::now();
}

void Participants::wait_until_idle(RemoteParticipant& participant) {
  const auto begin = steady_clock::now();
  while (participant.progress_.phase() != "idle") {
    std::this_thread::sleep_for(look_round);
    for (auto& other : all_) {
      listen(*other);
      check_alive(*other, participant, "load", {});
    }
    check_interrupt(participant, "load", {});
    if (seconds_since(begin) > scene_.stall_timeout)
      throw loss(fmt::format("participant '{}' did not come to an end of what it was doing within {} s",
                             participant.role(), scene_.stall_timeout));
  }
}

std::map<std::string, std::uint64_t> Participants::record_positions() {
  std::map<std::string, std::uint64_t> positions;
  for (auto& participant : all_)
    if (participant->record_) positions[participant->role()] = participant->record_->position();
  return positions;
}

void Participants::records_go_back(const std::map<std::string, std::uint64_t>& positions) {
  for (auto& participant : all_) {
    if (!participant->record_) continue;
    const auto found = positions.find(participant->role());
    participant->record_->go_back(found == positions.end() ? 0 : found->second);
  }
}

Participants::~Participants() {
  all_.clear();  // ends every child
  std::error_code ignored;
  std::filesystem::remove_all(sockets_, ignored);
}

namespace {

// For a shell on the other side.
std::string quoted(const std::string& word) {
  std::string text = "'";
  for (const char character : word)
    text += character == '\'' ? std::string("'\\''") : std::string(1, character);
  return text + "'";
}

// Several processes instead of one. They may be more than the machine has cores, and it is not for the
// coupler to bind them to some, when other participants compute at other times. Over several machines MPI
// finds the hosts where it always does: in the allocation of Slurm, in a host file of its settings.
std::vector<std::string> with_ranks(const ParticipantScene& participant, std::vector<std::string> words) {
  if (participant.here()) {
    // mpirun looks for programs in other places.
    if (const auto program = find_program(words.front())) words.front() = program->string();
  }
  // Who waits gives way to those that compute.
  std::vector<std::string> mpirun = {"mpirun",
                                     "-n",
                                     std::to_string(participant.ranks),
                                     "--oversubscribe",
                                     "--bind-to",
                                     "none",
                                     "--mca",
                                     "mpi_yield_when_idle",
                                     "1"};
  mpirun.insert(mpirun.end(), words.begin(), words.end());
  return mpirun;
}

// Brings the command to the machine it is meant for.
std::vector<std::string> sent_to_host(const ParticipantScene& participant, std::vector<std::string> words) {
  if (participant.launch == Launch::ssh) {
    // With a terminal of its own the process ends with the connection, a stopped one too.
    std::vector<std::string> ssh = {"ssh",
                                    "-tt",
                                    "-o",
                                    "BatchMode=yes",
                                    "-o",
                                    "ServerAliveInterval=5",
                                    "-o",
                                    "ConnectTimeout=10",
                                    participant.host,
                                    "exec"};
    for (const auto& word : words) ssh.push_back(quoted(word));
    return ssh;
  }
  // Participants wait for one another most of the time: they may share the processors of the allocation.
  std::vector<std::string> srun = {"srun", "--ntasks=1", "--overlap",
                                   "--job-name=estuary-" + participant.role};
  if (!participant.host.empty()) srun.push_back("--nodelist=" + participant.host);
  // Ranks are processes of mpirun inside the one task.
  if (participant.threads > 0 || participant.ranks > 1)
    srun.push_back(fmt::format("--cpus-per-task={}", std::max(participant.threads, 1) * participant.ranks));
  srun.insert(srun.end(), words.begin(), words.end());
  return srun;
}

}  // namespace

std::vector<std::string> launch_command(const CouplingScene& scene, const ParticipantScene& participant,
                                        const std::string& endpoint, const std::filesystem::path& folder) {
  const std::string own_folder =
      participant.here() ? (folder / participant.role).string() : participant.folder;
  std::vector<std::string> words = participant.command;
  words.insert(words.end(),
               {"--bind", participant.bind.empty() ? endpoint : participant.bind, "--folder", own_folder,
                // Nobody asks it for anything while another is waited for.
                "--orphan-timeout", fmt::format("{}", 2 * scene.connect_timeout + 5)});
  if (participant.threads > 0) words.insert(words.end(), {"--threads", std::to_string(participant.threads)});
  if (!participant.key.empty())
    words.insert(words.end(), {"--key", participant.key, "--allow", participant.allow});
  else if (!is_local(endpoint))
    words.emplace_back("--insecure");
  if (participant.ranks > 1) words = with_ranks(participant, std::move(words));
  if (!participant.here()) words = sent_to_host(participant, std::move(words));
  if (const auto program = find_program(words.front())) words.front() = program->string();
  return words;
}

void Participants::launch(RemoteParticipant& participant, const std::string& endpoint,
                          const std::filesystem::path& folder) {
  const ParticipantScene& entry = participant.scene_;
  const std::vector<std::string> words = launch_command(scene_, entry, endpoint, folder);
  spdlog::info("{}: launches {}", entry.role, fmt::join(words, " "));
  try {
    participant.child_ = std::make_unique<ChildProcess>(words, folder / "log" / (entry.role + ".log"));
  } catch (const std::exception& error) {
    throw loss(fmt::format("{}: {}", entry.role, error.what()));
  }
}

DirectLine::Bytes Participants::line_to(const v1::Welcome& welcome) const {
  if (!can(welcome, "shared-ring")) return DirectLine::Bytes::over_socket;
  const int processors = std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
  int most = 0;
  int all = 0;
  for (const auto& participant : all_) {
    const ParticipantScene& entry = participant->scene();
    if (!entry.here()) continue;
    const bool known = participant->child_ != nullptr && entry.threads > 0;
    const int threads = known ? entry.threads * std::max(1, entry.ranks) : processors;
    most = std::max(most, threads);
    all += threads;
  }
  const int at_a_time = scene_.parallel() ? all : most;
  return at_a_time < processors ? DirectLine::Bytes::through_memory_with_processor_to_spare
                                : DirectLine::Bytes::through_memory;
}

void Participants::greet(RemoteParticipant& participant) {
  v1::Request hello;
  hello.mutable_hello();
  const v1::Reply reply = ask(participant, std::move(hello), {});
  if (!reply.has_welcome()) {
    throw RunFailure(ExitStatus::participant_lost,
                     fmt::format("{}: {} answered Hello with something else than Welcome", participant.role(),
                                 participant.channel_.endpoint()));
  }
  participant.identity_ = reply.welcome();
  const auto& welcome = participant.identity_;
  require(scene_, participant.role(), welcome, participant.channel_.endpoint());
  participant.accepts_in_advance_ = can(welcome, "advance-accepts");
  if (can(welcome, "direct-line")) participant.channel_.open_direct_line(line_to(welcome));
  spdlog::info("{}: {} {} at {}, process {}", participant.role(), welcome.name(), welcome.version(),
               participant.channel_.endpoint(), welcome.process());
}

RemoteParticipant* Participants::find(std::string_view role) {
  const auto found = std::find_if(all_.begin(), all_.end(),
                                  [&](const auto& participant) { return participant->role() == role; });
  return found == all_.end() ? nullptr : found->get();
}

void Participants::listen(RemoteParticipant& participant) {
  while (auto reply = participant.channel_.receive(std::chrono::milliseconds(0))) {
    const auto now = steady_clock::now();
    participant.last_heard_ = now;
    if (reply->has_progress()) {
      if (reply->progress().counter() != participant.progress_.counter()) participant.last_progress_ = now;
      participant.progress_ = std::move(*reply->mutable_progress());
      continue;
    }
    // No bytes at all are a message, too. From who was greeted before it is a loss; in the first Hello it is
    // of version 0, which is another.
    const bool greeted = generation_ > 0 || participant.reports_since_;
    if (!reply->has_header() && greeted)
      throw ChannelError(
          fmt::format("'{}' sent a message without a header", participant.channel_.endpoint()));
    if (reply->header().protocol_version() != protocol_version) {
      throw RunFailure(ExitStatus::wrong_scene,
                       fmt::format("{}: the participant at {} speaks protocol version {}, this coupler {}",
                                   participant.role(), participant.channel_.endpoint(),
                                   reply->header().protocol_version(), protocol_version),
                       other_protocol);
    }
    // Any other is the repeated answer to a repeated question: already known.
    if (participant.awaited_ == 0 || reply->header().sequence() != participant.awaited_) continue;
    participant.arrived_ = std::move(reply);
    participant.arrived_at_ = now;
    participant.awaited_ = 0;
    return;  // what else has come is read while the next reply is waited for
  }
}

bool Participants::tries_again(RemoteParticipant& participant) {
  constexpr int no_connection = 255;  // ssh's own exit status
  constexpr double pause = 1.0;       // [s]
  const bool out_of_reach = generation_ > 0 && participant.scene_.launch == Launch::ssh &&
                            participant.child_->exit_status() == no_connection && !participant.last_heard_;
  if (!out_of_reach || seconds_since(participant.launched_at_) > scene_.connect_timeout) return false;
  if (seconds_since(participant.last_attempt_at_) > pause) {
    launch(participant, participant.channel_.endpoint(), folder_);
    participant.last_attempt_at_ = steady_clock::now();
  }
  return true;
}

void Participants::check_alive(RemoteParticipant& participant, const RemoteParticipant& asked,
                               const char* phase, const Position& position) {
  const auto lost = [&](const std::string& how) {
    const std::string while_what = &participant == &asked
                                       ? fmt::format("in phase {}", phase)
                                       : fmt::format("while {} was in phase {}", asked.role(), phase);
    return loss(fmt::format("participant '{}' was lost at {}, {}: {}", participant.role(), at(position),
                            while_what, how));
  };
  if (participant.child_) {
    if (const auto how = participant.child_->ended()) {
      if (tries_again(participant)) return;
      const std::string last =
          participant.scene_.here() ? std::string() : last_lines(folder_, participant.role());
      throw lost(last.empty() ? *how : fmt::format("{}; the last it said: {}", *how, last));
    }
  }
  // Who was only greeted says nothing by itself, however long another is configured.
  if (!participant.last_heard_ || !participant.reports_since_) return;
  const auto heard = std::max(*participant.last_heard_, *participant.reports_since_);
  const auto silence = steady_clock::now() - heard;
  // A process of ours that is there and not stopped may merely have got no processor on a busy machine.
  const bool may_be_starved =
      participant.child_ && participant.scene_.here() && !participant.child_->stopped();
  const bool is_here = participant.child_ && participant.scene_.here();
  const std::chrono::duration<double> patience =
      may_be_starved ? starved_at_most
      : is_here      ? lost_after
                     : std::chrono::duration<double>(participant.scene_.lost_after);
  if (silence > patience) {
    throw lost(fmt::format("nothing heard from it for {:.1f} s", seconds_since(heard)));
  }
}

v1::Reply Participants::ask(RemoteParticipant& participant, v1::Request request, const Position& position) {
  std::vector<Question> questions;
  questions.push_back({&participant, std::move(request)});
  return std::move(ask_all(std::move(questions), position).front());
}

void Participants::check_interrupt(const RemoteParticipant& asked, const char* phase,
                                   const Position& position) {
  if (interrupts_ == 0) return;
  if (!interrupted_at_) {
    interrupted_at_ = steady_clock::now();
    if (after_interrupt_ > 0) spdlog::info("interrupted: the window under way may be finished");
  }
  if (interrupts_ < 2 && seconds_since(*interrupted_at_) < after_interrupt_) return;
  throw RunFailure(ExitStatus::interrupted, fmt::format("interrupted at {}, while {} was in phase {}",
                                                        at(position), asked.role(), phase));
}

// Throws when a participant has had time enough.
void Participants::check_patience(RemoteParticipant& participant, const v1::Request& request,
                                  const Position& position, double waited) const {
  if (request.has_hello()) {
    if (waited <= scene_.connect_timeout) return;
    auto failure = loss(fmt::format("participant '{}' did not answer at {} within {} s", participant.role(),
                                    participant.channel_.endpoint(), scene_.connect_timeout),
                        "start it, check the address, or raise coupling.connect_timeout");
    // Launched anew it would be waited for just as long, for nothing: its machine cannot be reached.
    if (!participant.scene_.here()) failure.lost = false;
    throw failure;
  }
  if (seconds_since(participant.last_progress_) <= scene_.stall_timeout) return;
  throw loss(
      fmt::format("participant '{}' made no progress for {:.0f} s at {}, in phase {}", participant.role(),
                  seconds_since(participant.last_progress_), at(position), phase_name(request)),
      "raise coupling.stall_timeout if it is only slow");
}

v1::Reply Participants::take_reply(RemoteParticipant& participant, const v1::Request& request,
                                   const Position& position, steady_clock::time_point asked) {
  v1::Reply reply = std::move(*participant.arrived_);
  participant.arrived_.reset();
  if (!request.has_hello()) {
    const double waited = std::chrono::duration<double>(participant.arrived_at_ - asked).count();
    participant.usage_.wall_s += waited;
    participant.usage_.exchange_s += std::max(0.0, waited - reply.compute_s());
  }
  if (reply.has_error()) {
    const auto& error = reply.error();
    // It has lost what it knew: another process took its place before the loss of the first was noticed.
    if (error.kind() == v1::Error::OUT_OF_ORDER)
      throw loss(fmt::format("participant '{}' at {} does not know where it is: {}", participant.role(),
                             at(position), error.message()));
    throw RunFailure(
        status_of(error.kind()),
        fmt::format("participant '{}' at {}, in phase {}{}: {}", participant.role(), at(position),
                    phase_name(request),
                    error.field().empty() ? "" : fmt::format(", field {}", error.field()), error.message()),
        error.kind() == v1::Error::VERSION ? other_protocol : error.advice(),
        status_of(error.kind()) == ExitStatus::no_solution);
  }
  if (reply.has_advanced()) participant.work_ = reply.advanced().work();
  if (reply.has_started() && !participant.child_) participant.started_ = reply.started();
  return reply;
}

std::vector<v1::Reply> Participants::ask_all(std::vector<Question> questions, const Position& position) {
  const auto begin = steady_clock::now();
  auto next_look = begin + look_round;
  const RemoteParticipant* speaking = nullptr;  // whose channel is in use, for an error's line
  std::vector<steady_clock::time_point> asked(questions.size(), begin);
  std::vector<steady_clock::time_point> asked_again(questions.size(), begin);
  try {
    for (std::size_t k = 0; k < questions.size(); ++k) {
      auto& [participant, request] = questions[k];
      speaking = participant;
      auto* header = request.mutable_header();
      header->set_protocol_version(protocol_version);
      header->set_run_id(run_id_);
      header->set_window(position.window);
      header->set_iteration(position.iteration);
      header->set_sequence(++participant->sequence_);
      participant->awaited_ = participant->sequence_;
      participant->arrived_.reset();
      asked[k] = asked_again[k] = participant->last_progress_ = steady_clock::now();
      if (!request.has_hello() && !participant->reports_since_) participant->reports_since_ = asked[k];
      participant->channel_.send(request);
    }
    while (true) {
      std::vector<ClientChannel*> open;
      for (auto& [participant, request] : questions) {
        if (!participant->arrived_) open.push_back(&participant->channel_);
      }
      if (open.empty()) break;
      ClientChannel::wait_for_any(open, look_round);
      for (auto& [participant, request] : questions) {
        speaking = participant;
        listen(*participant);
      }
      if (steady_clock::now() < next_look) continue;
      next_look = steady_clock::now() + look_round;
      const auto waiting = std::find_if(questions.begin(), questions.end(), [](const Question& question) {
        return !question.participant->arrived_;
      });
      if (waiting == questions.end()) break;
      const char* phase = phase_name(waiting->request);
      check_interrupt(*waiting->participant, phase, position);
      for (auto& other : all_) {
        speaking = other.get();
        listen(*other);
        check_alive(*other, *waiting->participant, phase, position);
      }
      for (std::size_t k = 0; k < questions.size(); ++k) {
        auto& [participant, request] = questions[k];
        if (participant->arrived_) continue;
        speaking = participant;
        check_patience(*participant, request, position, seconds_since(begin));
        const bool reply_lost = participant->progress_.phase() == "idle" && participant->last_heard_ &&
                                seconds_since(asked_again[k]) > ask_again_after;
        if (!request.has_hello() && reply_lost) {
          participant->channel_.send(request);
          asked_again[k] = steady_clock::now();
        }
      }
      if (observer_) observer_(*waiting->participant, phase, seconds_since(begin));
    }
  } catch (const ChannelError& error) {
    throw loss(fmt::format("participant '{}' at {}: {}", speaking->role(), at(position), error.what()));
  }
  std::vector<v1::Reply> replies;
  for (const auto& [participant, request] : questions)
    if (participant->record_ && recording_) participant->record_->add(request, *participant->arrived_);
  for (std::size_t k = 0; k < questions.size(); ++k)
    replies.push_back(take_reply(*questions[k].participant, questions[k].request, position, asked[k]));
  asking_s_ += seconds_since(begin);
  return replies;
}

void Participants::stop(double seconds) {
  for (auto& participant : all_) {
    v1::Request request;
    request.mutable_stop();
    auto* header = request.mutable_header();
    header->set_protocol_version(protocol_version);
    header->set_run_id(run_id_);
    header->set_sequence(++participant->sequence_);
    try {
      participant->channel_.send(request);
    } catch (const ChannelError& error) {
      spdlog::warn("{}: {}", participant->role(), error.what());
    }
  }
  for (auto& participant : all_) {
    if (participant->child_) participant->child_->end(seconds);
  }
}

}  // namespace estuary::coupler
