// The participants of a run as the coupler sees them: launched or connected, asked one phase at a time,
// watched all the time. Whoever waits for one notices the loss of any.
#pragma once

#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
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
};

/// Program and arguments that start a participant of the scene, which writes below `folder`.
std::vector<std::string> launch_command(const CouplingScene& scene, const ParticipantScene& participant,
                                        const std::string& endpoint, const std::filesystem::path& folder);

class RemoteParticipant {
public:
  RemoteParticipant(ParticipantScene scene, const std::string& endpoint)
      : scene_(std::move(scene)), channel_(endpoint) {}

  [[nodiscard]] const std::string& role() const { return scene_.role; }
  [[nodiscard]] const v1::Welcome& identity() const { return identity_; }
  /// Whether an Advance can carry its Accept with it.
  [[nodiscard]] bool accepts_in_advance() const { return accepts_in_advance_; }
  [[nodiscard]] const v1::Work& work() const { return work_; }
  [[nodiscard]] const Usage& usage() const { return usage_; }
  [[nodiscard]] const ClientChannel& channel() const { return channel_; }
  /// What it last said about itself.
  [[nodiscard]] const v1::Progress& progress() const { return progress_; }

private:
  friend class Participants;
  ParticipantScene scene_;
  ClientChannel channel_;
  std::unique_ptr<ChildProcess> child_;   // null when it was connected to
  std::unique_ptr<RecordWriter> record_;  // null unless the scene wants a record
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
  std::chrono::steady_clock::time_point last_progress_{};  // when its counter last grew
};

/// Called a few times per second while waiting: for whom, what for, and for how long already [s].
using WaitingObserver = std::function<void(const RemoteParticipant&, const char* phase, double seconds)>;

class Participants {
public:
  /// Launches or connects to all of them and waits for their Welcome. `folder` is the run's folder; each
  /// launched participant writes below `folder`/<role> and logs to `folder`/log/<role>.log.
  /// Throws RunFailure (participant_lost) naming who did not come and where it was expected.
  Participants(const CouplingScene& scene, const std::filesystem::path& folder,
               const std::atomic<bool>& interrupt, WaitingObserver observer);
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

  [[nodiscard]] RemoteParticipant* find(std::string_view role);
  [[nodiscard]] const std::vector<std::unique_ptr<RemoteParticipant>>& all() const { return all_; }
  [[nodiscard]] const std::string& run_id() const { return run_id_; }

  /// Asks everyone to stop and waits for them to end, at most `seconds` each, then makes them.
  void stop(double seconds);

private:
  void launch(RemoteParticipant& participant, const std::string& endpoint,
              const std::filesystem::path& folder);
  void greet(RemoteParticipant& participant);
  /// Reads what has arrived from `participant` and keeps the reply it is asked for.
  static void listen(RemoteParticipant& participant);
  void check_patience(RemoteParticipant& participant, const v1::Request& request, const Position& position,
                      double waited) const;
  static v1::Reply take_reply(RemoteParticipant& participant, const v1::Request& request,
                              const Position& position, std::chrono::steady_clock::time_point asked);
  void check_alive(RemoteParticipant& participant, const RemoteParticipant& asked, const char* phase,
                   const Position& position);

  const CouplingScene& scene_;
  const std::atomic<bool>& interrupt_;
  WaitingObserver observer_;
  std::string run_id_;
  std::filesystem::path sockets_;  // folder of the local sockets
  std::vector<std::unique_ptr<RemoteParticipant>> all_;
};

}  // namespace estuary::coupler
