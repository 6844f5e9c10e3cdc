// The coupler's own part of a scene: who takes part, how they are coupled, what is written, watched and
// checked.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "acceleration.hpp"
#include "mapping.hpp"
#include "scene.hpp"

namespace estuary::coupler {

enum class CouplingMode { steady, transient };
/// Serial: the fluid first, then the grains, then the solid, each with what came before it. Parallel: all at
/// once, each with what the others answered last. Explicit: once per window; implicit: until they agree.
enum class Scheme { serial_explicit, parallel_explicit, serial_implicit, parallel_implicit };
enum class AtMaximum { fail, go_on };
enum class Predictor { none, linear, quadratic };
/// What a convergence measure looks at, and how.
enum class Field { displacement, velocity, force };
enum class MeasureKind { relative, absolute, residual_relative };

/// Who starts a participant, and where: here, on another machine, or somebody else.
enum class Launch { local, ssh, slurm, manual };

/// One participant's launch. `command`: words; `endpoint`: where it serves, empty when it is launched here.
struct ParticipantScene {
  std::string role;  // the scene's table: "fluid", "solid", "grains"
  std::vector<std::string> command;
  std::string endpoint;
  std::string bind = {};  // where it listens, when that is not where it is reached (a forwarded port)
  int threads = 0;        // 0: all cores
  int ranks = 1;          // processes, by mpirun, that are this participant together
  Launch launch = Launch::local;
  std::string host = {};        // for ssh; for Slurm, when it has to be a certain one
  std::string folder = {};      // its working folder on that machine
  std::string key = {};         // file of its key pair on that machine
  std::string allow = {};       // file of the coupler's public key on that machine
  std::string public_key = {};  // file of its public key here
  double lost_after = 0;        // [s] of silence, where it was not launched here

  [[nodiscard]] bool here() const { return launch == Launch::local; }
  [[nodiscard]] bool launched() const { return launch != Launch::manual; }
};

/// The iteration stops when every measure is below its limit. With the increment i = H(x) - x of the field:
///   relative           |i| < limit |H(x)|
///   absolute           |i| < limit                  [m, m/s, N/m]
///   residual-relative  |i| < limit |i of the window's first iteration|
struct Measure {
  Field field = Field::displacement;
  MeasureKind kind = MeasureKind::relative;
  double limit = 1e-4;
};

/// How a load is mapped from a participant's own wet surface to the solid's (surface_link.hpp).
enum class Loads { forces, pressures };

/// `participant` may also be "coupling": figures of the wet surface as a whole (watch_integrals.hpp).
struct WatchScene {
  std::string name;
  std::string participant;
  /// For amplitude and phase of cos(angular_frequency t + phase), fitted over whole periods from `from_time`
  /// on.
  std::optional<double> angular_frequency;
  /// For time_above: the time at which a quantity is first larger.
  std::optional<double> level;
  double from_time = 0;
  /// What comes later does not count for the statistics, nor as the last value [s].
  double to_time = std::numeric_limits<double>::infinity();
};

/// `quantity` is WATCH.QUANTITY or WATCH.QUANTITY.STATISTIC (last, min, max, mean, ..., as in the README), or
/// one of coupling.iterations (the largest of all windows), coupling.total_iterations, run.windows,
/// run.wall_s.
struct CheckScene {
  std::string quantity;
  std::optional<double> reference;
  std::optional<double> relative_tolerance;
  std::optional<double> absolute_tolerance;
  std::optional<double> at_most;
  std::optional<double> at_least;
  std::string source;
};

/// What is kept of a transient run so that it can go on after an end or a loss. Checkpoints come every
/// `every` windows; when the scene names none, `every_seconds` of wall time after the last and so seldom that
/// they cost less than 2 % of it.
struct RecoveryScene {
  std::optional<std::uint64_t> every;  // windows; 0: no checkpoints
  double every_seconds = 30;
  int keep = 2;        // checkpoints
  int relaunches = 3;  // of lost participants, without a new checkpoint in between
};

struct CouplingScene {
  std::string title;
  int dimension = 2;
  CouplingMode mode = CouplingMode::steady;
  Scheme scheme = Scheme::serial_implicit;
  AccelerationKind acceleration = AccelerationKind::aitken;
  Predictor predictor = Predictor::linear;
  AtMaximum at_maximum = AtMaximum::fail;
  double relaxation = 0.5;
  int windows_reused = 8;                   // quasi-Newton: windows whose columns are kept
  int max_used_columns = 100;               // quasi-Newton
  ColumnFilter filter = ColumnFilter::qr2;  // quasi-Newton
  double filter_limit = 1e-2;               // quasi-Newton
  bool residual_sum = false;                // quasi-Newton: fields are scaled by their share of the residual
  std::vector<Measure> measures;
  MappingSettings mapping;  // where a participant brings a wet surface of its own
  Loads mapped_loads = Loads::forces;
  int min_iterations = 1;
  int max_iterations = 50;
  bool recover = true;  // try again with care before giving up
  double window = 0;    // [s]; 0 in steady mode
  double end_time = 0;  // [s]
  std::uint64_t windows = 1;
  bool adaptive_window = false;  // a failing window may be tried with half the length
  double smallest_window = 0;    // [s]
  double connect_timeout = 30;   // [s] until the first answer
  double stall_timeout = 300;    // [s] computing without any progress
  std::uint64_t frame_interval =
      0;  // windows (iterations in steady mode) between frames; 0: first and last only
  bool frames = true;
  bool record = false;  // keep every message for a replay
  RecoveryScene recovery;
  bool insecure = false;    // addresses that other machines reach without keys
  std::string coupler_key;  // file of the coupler's key pair
  std::vector<ParticipantScene> participants;
  std::vector<WatchScene> watches;
  std::vector<CheckScene> checks;

  [[nodiscard]] const ParticipantScene* find(std::string_view role) const;
  [[nodiscard]] bool implicit() const {
    return scheme == Scheme::serial_implicit || scheme == Scheme::parallel_implicit;
  }
  [[nodiscard]] bool parallel() const {
    return scheme == Scheme::parallel_explicit || scheme == Scheme::parallel_implicit;
  }
};

/// Reads everything that is not inside a participant's own table and refuses unknown keys there. Problems are
/// noted in the scene.
CouplingScene read_coupling_scene(Scene& scene);

}  // namespace estuary::coupler
