// What a run leaves behind, apart from the fields the participants write: convergence.csv, iterations.csv,
// watch/*.csv. Keeps the watches in memory for the checks.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "estuary/v1/protocol.pb.h"

namespace estuary::coupler {

/// One coupling iteration: a row of convergence.csv. Empty values stay empty in the file.
struct IterationRow {
  std::uint64_t window = 0;
  std::uint64_t iteration = 0;
  double time = 0;                          // end of the window [s]
  double residual = 0;                      // |d_k - d_{k-1}|_2 / |d_k|_2
  std::optional<double> velocity_residual;  // the same of the velocity, in transient mode
  std::optional<double> force_residual;
  double relaxation = 0;                // 0: none was needed or none was possible
  double load_share = 1;                // of the load that the solid was given
  double displacement_norm = 0;         // |d_k|_2 over the wet nodes [m]
  std::array<double, 2> force{};        // sum of the nodal forces [N/m]
  double moment = 0;                    // about the origin [N]
  std::array<double, 2> fluid_force{};  // the fluid's own sum over its links [N/m]
  double fluid_moment = 0;
  std::array<double, 2> solid_force{};  // as received by the solid's particles [N/m]
  double solid_moment = 0;
  double fluid_power = 0;  // nodal forces with the velocities given to the fluid [W/m]
  double solid_power = 0;  // nodal forces with the velocities the solid answered [W/m]
  double fluid_s = 0;      // from request to reply
  double solid_s = 0;
  /// Sums of the load on the surfaces that participants brought of their own, before it was mapped to the
  /// solid's: where force, moment and power are the same, the mapping conserved them.
  std::optional<std::array<double, 4>> before_mapping;  // force x, y [N/m], moment [N], power [W/m]
  double fluid_error = 0;  // the participants' own estimates of their remaining error
  double solid_error = 0;
};

/// One accepted (or given up) window: a row of iterations.csv.
struct WindowRow {
  std::uint64_t window = 0;
  std::uint64_t total_iterations = 0;
  std::uint64_t iterations = 0;
  std::string verdict;  // converged, not converged, diverged, explicit, alone
  double time = 0;
  double residual = 0;
  double wall_s = 0;
  double duration = 0;  // [s]; 0 in steady mode
};

/// All values of one quantity of one watch, in the order recorded.
struct WatchSeries {
  std::vector<double> time;  // [s]; the iteration in steady mode
  std::vector<double> value;
};

/// Bytes of each file so far, by its name in the run's folder.
using RecordPosition = std::map<std::string, std::uint64_t>;

/// Watch name -> quantity -> series.
using WatchRecord = std::map<std::string, std::map<std::string, WatchSeries>>;

/// What the tables of a run hold.
struct RecordedRun {
  std::vector<WindowRow> windows;
  WatchRecord watches;
};

class RunRecord {
public:
  /// Makes the folder's files anew. Throws std::runtime_error when they cannot be written.
  RunRecord(const std::filesystem::path& folder, const CouplingScene& scene);
  /// Goes on with those of an earlier run, from a place that `position` gave then. Throws std::runtime_error
  /// when they do not reach that far.
  RunRecord(const std::filesystem::path& folder, const CouplingScene& scene, const RecordPosition& position);

  /// Where the files end; they are on the disk up to there.
  [[nodiscard]] RecordPosition position();
  /// Forgets what came after. Throws std::runtime_error when the files do not reach that far.
  void go_back(const RecordPosition& position);
  void begin_anew();

  void add(const IterationRow& row);
  void add(const WindowRow& row);
  void add(const v1::WatchSample& sample, std::uint64_t window, std::uint64_t iteration, double time);
  /// Gives the rows so far to the system, so that a fault of this process does not lose them. Throws
  /// std::runtime_error when they cannot be written.
  void flush();
  /// The same when rows may have waited for 20 ms. True when it did.
  bool flush_if_due();

  /// Reads the tables so far. They are not kept in memory: a run may have any number of windows. What cannot
  /// be read is left out.
  [[nodiscard]] RecordedRun read();

private:
  std::ofstream& watch_file(const v1::WatchSample& sample);
  void check(std::ofstream& file, const std::string& name) const;
  [[nodiscard]] std::map<std::string, std::ofstream*> files();

  std::filesystem::path folder_;
  bool coupled_;
  std::ofstream convergence_;
  std::ofstream iterations_;
  std::map<std::string, std::ofstream> watch_files_;
  std::chrono::steady_clock::time_point flushed_ = std::chrono::steady_clock::now();
};

}  // namespace estuary::coupler
