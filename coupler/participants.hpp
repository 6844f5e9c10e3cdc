// The participants of a run as the coupler sees them: launched or connected, asked one phase at a time,
// watched all the time. Whoever waits for one notices the loss of any. After a loss they can be brought back.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "channel.hpp"
#include "child_process.hpp"
#include "coupling_scene.hpp"
#include "estuary/v1/protocol.pb.h"
#include "record_file.hpp"

namespace estuary::coupler {

/// Where the run is: goes into every message's header and into every failure's line.
struct Position {
  std::uint64_t window = 0;
  std::uint64_t iteration = 0;
};

/// What one participant cost so far.
struct Usage {
  double wall_s = 0;      // between request and reply
  double exchange_s = 0;  // of that, not spent computing by the participant's own clock
  // Over channels that are closed.
  std::uint64_t bytes = 0;
  std::uint64_t messages = 0;
};

/// Program and arguments that start a participant of the scene, which writes below `folder`.
std::vector<std::string> launch_command(const CouplingScene& scene, const ParticipantScene& participant,
                                        const std::string& endpoint, const std::filesystem::path& folder);

class RemoteParticipant {
public:
  RemoteParticipant(ParticipantScene scene, const std::string& endpoint, const ClientSecurity& security)
      : scene_(std::move(scene)), channel_(endpoint, security) {}

  [[nodiscard]] const std::string& role() const { return scene_.role; }
  [[nodiscard]] const ParticipantScene& scene() const { return scene_; }
  [[nodiscard]] const v1::Welcome& identity() const { return identity_; }
  /// Whether an Advance can carry its Accept with it.
  [[nodiscard]] bool accepts_in_advance() const { return accepts_in_advance_; }
  [[nodiscard]] const v1::Work& work() const { return work_; }
  [[nodiscard]] const Usage& usage() const { return usage_; }
  [[nodiscard]] const ClientChannel& channel() const { return channel_; }
  [[nodiscard]] std::uint64_t bytes() const {
    return usage_.bytes + channel_.bytes_sent() + channel_.bytes_received();
  }
  [[nodiscard]] std::uint64_t messages() const { return usage_.messages + channel_.messages(); }
  /// What it last said about itself.
  [[nodiscard]] const v1::Progress& progress() const { return progress_; }
  /// Its answer to Start, where it has had one: a process that was kept through the loss of another cannot be
  /// started a second time.
  [[nodiscard]] const std::optional<v1::Started>& started() const { return started_; }

private:
  friend class Participants;
  ParticipantScene scene_;
  ClientChannel channel_;
  std::unique_ptr<ChildProcess> child_;   // null when it was connected to
  std::unique_ptr<RecordWriter> record_;  // null unless the scene wants a record
  std::optional<v1::Started> started_;
  v1::Welcome identity_;
  bool accepts_in_advance_ = false;
  v1::Work work_;
  v1::Progress progress_;
  Usage usage_;
  std::uint64_t sequence_ = 0;
  std::uint64_t awaited_ = 0;         // sequence of the request under way; 0: none
  std::optional<v1::Reply> arrived_;  // its reply
  std::chrono::steady_clock::time_point arrived_at_{};
  std::optional<std::chrono::steady_clock::time_point> last_heard_;
  // Since when it has to report progress: its first request after Hello.
  std::optional<std::chrono::steady_clock::time_point> reports_since_;
  std::chrono::steady_clock::time_point launched_at_{};      // for the first time since the start or a loss
  std::chrono::steady_clock::time_point last_attempt_at_{};  // to launch it
  std::chrono::steady_clock::time_point last_progress_{};    // when its counter last grew
};

/// Called a few times per second while waiting: for whom, what for, and for how long already [s].
using WaitingObserver = std::function<void(const RemoteParticipant&, const char* phase, double seconds)>;

class Participants {
public:
  /// Launches or connects to all of them and waits for their Welcome. `folder` is the run's folder; each
  /// launched participant writes below `folder`/<role> and logs to `folder`/log/<role>.log.
  /// Throws RunFailure (participant_lost) naming who did not come and where it was expected.
  /// `go_on`: records are added to. `interrupts` counts the signals that ask the run to end.
  Participants(const CouplingScene& scene, const std::filesystem::path& folder, bool go_on,
               const std::atomic<int>& interrupts, WaitingObserver observer);
  /// Ends everyone.
  ~Participants();
  Participants(const Participants&) = delete;
  Participants& operator=(const Participants&) = delete;

  /// Sends a request and waits for its reply. An Error in the reply, a lost, hung or garbage-sending
  /// participant (this or any other) and an interrupt become a RunFailure that names participant, phase,
  /// window and iteration.
  v1::Reply ask(RemoteParticipant& participant, v1::Request request, const Position& position);
  /// The same for several participants, which then compute at the same time. Replies come in the order of the
  /// questions.
  struct Question {
    RemoteParticipant* participant;
    v1::Request request;
  };
  std::vector<v1::Reply> ask_all(std::vector<Question> questions, const Position& position);

  /// After a loss: launches those anew that this run launched, all of them, so that nobody holds half a
  /// window; keeps those it connected to that are still there, or waits for others in their place. Throws as
  /// the constructor does.
  void bring_back();

  /// The run was asked to end. The first time what is under way may take a while yet, so that a window can be
  /// finished and saved: `ask` throws when this was used up, or at the second time.
  [[nodiscard]] bool interrupted() const { return interrupts_ > 0; }
  void allow_after_interrupt(double seconds) { after_interrupt_ = seconds; }
  [[nodiscard]] double after_interrupt() const { return after_interrupt_; }

  /// Bytes of the records so far, by participant; and back to such a place.
  [[nodiscard]] std::map<std::string, std::uint64_t> record_positions();
  void records_go_back(const std::map<std::string, std::uint64_t>& positions);
  /// Repeated phases on the way back to a checkpoint do not belong into a record.
  void record_messages(bool yes) { recording_ = yes; }

  [[nodiscard]] RemoteParticipant* find(std::string_view role);
  [[nodiscard]] const std::vector<std::unique_ptr<RemoteParticipant>>& all() const { return all_; }
  [[nodiscard]] const std::string& run_id() const { return run_id_; }
  /// Time spent in `ask` and `ask_all`: participants compute, or messages are on their way [s].
  [[nodiscard]] double asking_s() const { return asking_s_; }

  /// Asks everyone to stop and waits for them to end, at most `seconds` each, then makes them.
  void stop(double seconds);

private:
  void launch(RemoteParticipant& participant, const std::string& endpoint,
              const std::filesystem::path& folder);
  [[nodiscard]] ClientSecurity security_of(const ParticipantScene& participant) const;
  [[nodiscard]] std::string endpoint_of(const ParticipantScene& participant) const;
  void greet(RemoteParticipant& participant);
  // How the messages of windows go to a participant of this machine.
  [[nodiscard]] DirectLine::Bytes line_to(const v1::Welcome& welcome) const;
  void renew(RemoteParticipant& participant);
  // Waits until a participant that was kept has put away what it was asked before the loss.
  void wait_until_idle(RemoteParticipant& participant);
  void check_interrupt(const RemoteParticipant& asked, const char* phase, const Position& position);
  /// Reads what has arrived from `participant` and keeps the reply it is asked for.
  void listen(RemoteParticipant& participant);
  void check_patience(RemoteParticipant& participant, const v1::Request& request, const Position& position,
                      double waited) const;
  static v1::Reply take_reply(RemoteParticipant& participant, const v1::Request& request,
                              const Position& position, std::chrono::steady_clock::time_point asked);
  void check_alive(RemoteParticipant& participant, const RemoteParticipant& asked, const char* phase,
                   const Position& position);
  /// True when its machine could not be reached and will be tried again.
  bool tries_again(RemoteParticipant& participant);

  const CouplingScene& scene_;
  std::filesystem::path folder_;
  const std::atomic<int>& interrupts_;
  std::optional<std::chrono::steady_clock::time_point> interrupted_at_;
  double after_interrupt_ = 0;  // [s]
  bool recording_ = true;
  int generation_ = 0;  // of launched processes
  WaitingObserver observer_;
  std::string run_id_;
  double asking_s_ = 0;
  std::filesystem::path sockets_;  // folder of the local sockets
  std::vector<std::unique_ptr<RemoteParticipant>> all_;
};

}  // namespace estuary::coupler
