// The checkpoints of a run: sets of one file of each participant and one of the coupler.
//
//   DIR/<participant>/checkpoint-<slot>.h5   the participant's, in its working folder, wherever that is
//   DIR/checkpoint/coupler-<slot>.h5         the coupler's (coupler_state.hpp)
//   DIR/checkpoint/set-<slot>.json           what belongs together, with sizes and checksums; written last
//
// The oldest slot is used anew, so that `recovery.keep` sets are kept. Each file is put in place at once, and
// a set counts only when everything of it is there and unchanged.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "coupler_state.hpp"
#include "coupling_scene.hpp"
#include "file_digest.hpp"
#include "participants.hpp"

namespace estuary::coupler {

/// Belongs to another scene or was written by another version: not to be gone on from.
struct WrongCheckpoint : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct CheckpointSet {
  std::uint64_t slot = 0;
  std::uint64_t window = 0;
  struct File {
    std::string participant;
    std::string name;  // in the participant's working folder
    std::optional<FileSum> sum;
  };
  std::vector<File> files;
  CouplerState state;
};

class Checkpoints {
public:
  /// `scene`: what has to be the same for a run to go on (`resumable_text`).
  Checkpoints(const CouplingScene& coupling, std::filesystem::path folder, std::string scene);

  /// Whether this run writes any.
  [[nodiscard]] bool wanted() const;
  /// Whether the start is kept too: where a process cannot be started a second time.
  [[nodiscard]] bool start_wanted() const;
  [[nodiscard]] bool due(std::uint64_t window) const;
  /// Asks everyone to save and completes the set. A disk that is full or a participant that cannot save costs
  /// only the checkpoint: it is said, and false comes back. Throws RunFailure when a participant is lost.
  bool write(Participants& participants, const Position& position, CouplerState state);

  /// The sets that can be gone on from, newest first. `say` hears why another cannot. Throws WrongCheckpoint.
  std::vector<CheckpointSet> usable(const std::function<void(const std::string&)>& say);
  /// Brings everyone back to a set. Throws std::runtime_error when one of them cannot, RunFailure when one is
  /// lost.
  static void load(Participants& participants, const CheckpointSet& set);
  /// The set turned out to be of no use.
  void drop(const CheckpointSet& set);
  /// There are files that say that a run wrote checkpoints here.
  [[nodiscard]] bool any() const;

  [[nodiscard]] std::uint64_t written() const { return written_; }
  [[nodiscard]] double seconds() const { return seconds_; }
  /// Window of the newest; nothing before the first.
  [[nodiscard]] std::optional<std::uint64_t> newest_window() const { return newest_; }

private:
  [[nodiscard]] std::filesystem::path set_file(std::uint64_t slot) const;
  [[nodiscard]] std::filesystem::path coupler_file(std::uint64_t slot) const;
  [[nodiscard]] std::uint64_t next_slot() const;
  void complete(const CheckpointSet& set);
  [[nodiscard]] CheckpointSet read(const std::filesystem::path& file) const;

  const CouplingScene& coupling_;
  std::filesystem::path folder_;
  std::string scene_;
  std::vector<std::uint64_t> slots_;  // of complete sets, newest first
  std::optional<std::uint64_t> newest_;
  std::chrono::steady_clock::time_point last_;
  double last_cost_ = 0;  // [s]
  std::uint64_t written_ = 0;
  double seconds_ = 0;
  bool impossible_ = false;  // somebody keeps none
};

/// The scene without what may be changed when a run is gone on with: where and with how many threads it is
/// computed, how long it lasts, when an iteration is given up, what is checked.
[[nodiscard]] std::string resumable_text(const Scene& scene);

}  // namespace estuary::coupler
