// What a solver has to be to take part in a run: one class with a method for each phase.
//
// The kit (`serve.hpp`) owns the socket, the threads, the checks on every message and the reports of
// progress; a solver only computes. Phase methods are called one at a time on one thread, in the order of a
// participant's life: configure, start, then for each window advance (once or more) and accept, with save,
// load and frame after any accept, stop at the end. A new solver is a class like this and
//
//     int main(int argc, char** argv) { return estuary::serve(argc, argv, std::make_unique<MySolver>()); }
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "estuary/v1/payload.pb.h"
#include "scene.hpp"

namespace estuary {

struct Identity {
  std::string name;  // of the program
  std::string version;
  std::vector<std::string> roles;         // scene tables it can serve
  std::vector<std::string> capabilities;  // "steady", "rewind", ...: protocol.proto, Welcome
  std::vector<std::uint32_t> dimensions;
};

/// What a participant tells about a scene before running it.
struct Plan {
  std::vector<std::pair<std::string, std::string>> derived;  // name, value with unit
  std::vector<std::string> warnings;
  std::vector<std::string> left_out;
  double memory_bytes = 0;
  double expected_updates = 0;  // 0 when unknown
  std::string variant;          // the compiled kernel variant
};

enum class Mode { transient, steady };

/// The stretch of time to compute. `iteration` counts from 1; from 2 on, the state goes back to the
/// window's start in transient mode. In steady mode a solver may start from wherever it is: the equilibrium
/// is the same.
struct Window {
  std::uint64_t number = 0;
  std::uint64_t iteration = 0;
  Mode mode = Mode::transient;
  double time = 0;      // at its start [s]
  double duration = 0;  // [s]
};

/// Values of one watch at the window's end.
struct WatchValues {
  std::string name;
  std::vector<std::pair<std::string, double>> quantities;
};

struct Work {
  std::uint64_t steps = 0;      // since the start of the run, repeated windows included
  double updates = 0;           // cells or particles x steps
  double bytes_per_update = 0;  // memory traffic the method needs
  std::vector<std::pair<std::string, double>> phase_seconds;
  /// What the balance of energies misses, over the energy turned over; for participants that keep one.
  std::optional<double> energy_error;
};

struct AdvanceResult {
  v1::Exchange outputs;
  std::vector<WatchValues> watches;
  Work work;
  /// Force on the wet surface by this participant's own sum [N]; empty without a surface.
  std::vector<double> surface_force;
  double surface_moment = 0;   // about the origin [N m]
  double remaining_error = 0;  // steady mode: estimate of the relative error left
};

/// The computing thread's window to the outside: a reporting thread sends what was last set here.
class ProgressBoard {
public:
  /// Says that work was done. `fraction` of the running request (0..1, below 0 when unknown).
  void report(double fraction, std::string_view note = {});
  /// True when the run was told to end: long phase methods ask now and then and throw `Interrupted`.
  [[nodiscard]] bool stop_requested() const { return stop_.load(std::memory_order_relaxed); }

  struct Snapshot {
    std::string phase;
    double fraction = -1;
    std::uint64_t counter = 0;
    std::string note;
  };
  [[nodiscard]] Snapshot snapshot() const;
  void begin_phase(std::string_view phase);
  void request_stop() { stop_.store(true, std::memory_order_relaxed); }

private:
  mutable std::mutex mutex_;
  Snapshot last_{.phase = "idle", .note = {}};
  std::atomic<bool> stop_{false};
};

/// The solution left the method's range: not finite, or beyond what the model holds for.
struct Diverged : std::runtime_error {
  Diverged(std::string field_name, const std::string& what, std::string advice_text)
      : std::runtime_error(what), field(std::move(field_name)), advice(std::move(advice_text)) {}
  std::string field;
  std::string advice;
};

/// The participant's own search for equilibrium ended without one.
struct NotConverged : std::runtime_error {
  NotConverged(const std::string& what, std::string advice_text)
      : std::runtime_error(what), advice(std::move(advice_text)) {}
  std::string advice;
};

/// An input that cannot be used; `field` names it as in the contract.
struct BadInput : std::runtime_error {
  BadInput(std::string field_name, const std::string& what)
      : std::runtime_error(what), field(std::move(field_name)) {}
  std::string field;
};

struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted") {}
};

class Participant {
public:
  Participant() = default;
  Participant(const Participant&) = delete;
  Participant& operator=(const Participant&) = delete;
  Participant(Participant&&) = delete;
  Participant& operator=(Participant&&) = delete;
  virtual ~Participant() = default;

  /// Before anything else: where a `start` that takes long says that it goes on. `board` outlives the
  /// participant's work.
  virtual void report_to(ProgressBoard& board) { (void)board; }

  [[nodiscard]] virtual Identity identity() const = 0;

  /// Reads `scene`'s table `role` and the tables it shares (title, dimension, coupling mode, its watches),
  /// notes every problem in the scene, and chooses the compiled variants. Allocates no fields.
  virtual Plan configure(Scene& scene, const std::string& role) = 0;

  /// Builds the state. `initial` holds what others bring (a wet surface with its displacements);
  /// the result is what this participant brings. Files it writes go below `folder`.
  virtual v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& folder) = 0;

  /// After start: windows may have any length that is a whole multiple of this [s]; 0: any length. Nothing:
  /// windows of the scene's length only, so that a failing one cannot be tried with a shorter one.
  [[nodiscard]] virtual std::optional<double> window_step() const { return std::nullopt; }

  /// Computes one window (transient) or one equilibrium (steady) under `inputs`.
  virtual AdvanceResult advance(const Window& window, const v1::Exchange& inputs,
                                ProgressBoard& progress) = 0;

  /// The last advance becomes the start of the next window.
  virtual void accept() = 0;

  /// Writes (reads) everything needed to go on from the last accept, bit for bit.
  virtual void save(const std::filesystem::path& file) = 0;
  virtual void load(const std::filesystem::path& file) = 0;

  /// Writes the fields as they are; returns the files written, relative to the working folder.
  virtual std::vector<std::string> frame(std::uint64_t number, double time) = 0;

  virtual void stop() {}
};

}  // namespace estuary
