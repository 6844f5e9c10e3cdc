// What came out of the cells of a study: values, errors against the references, times and work.
#pragma once

#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "study_store.hpp"

namespace estuary::coupler {

struct QuantityResult {
  double value = std::numeric_limits<double>::quiet_NaN();
  double reference = std::numeric_limits<double>::quiet_NaN();
  double error = std::numeric_limits<double>::quiet_NaN();  // |value - reference| / scale
};

struct StudyResult {
  StudyCell cell;
  std::string status;  // "done", "check failed", ..., "refused", "not run"
  std::string message;
  bool finished = false;                   // carried to its end, so that the values below mean something
  std::vector<QuantityResult> quantities;  // in the order of the study's
  double error = std::numeric_limits<double>::quiet_NaN();  // the largest of them
  // Of the runs: median, least and most.
  double wall_s = std::numeric_limits<double>::quiet_NaN();
  double wall_min_s = std::numeric_limits<double>::quiet_NaN();
  double wall_max_s = std::numeric_limits<double>::quiet_NaN();
  double processor_s = std::numeric_limits<double>::quiet_NaN();
  std::size_t runs = 0;
  double load = 0;  // the highest at the beginning of a run
  int beside = 1;
  // Work of the last run, all participants together.
  double steps = 0;
  double updates = 0;
  double compute_s = 0;
  double peak_rss_bytes = 0;  // the largest of a participant
  double iterations = 0;
  double iterations_per_window = 0;
  double windows = 0;
  std::vector<std::string> warnings;  // that a person was given, of the coupling and of the participants
  double end_time = 0;  // of the last window that was kept in iterations.csv [s]; iterations in steady mode
  std::vector<std::pair<std::string, std::string>> judged;   // stability: more columns of the table
  double cost_s = std::numeric_limits<double>::quiet_NaN();  // what an error is held against
  /// Whether it waited so long for its processors that the clock says little of it.
  [[nodiscard]] bool waited() const { return wall_s > 2 * processor_s + 0.5; }
  /// Whether the times of its repeats differ so much that their median says little.
  [[nodiscard]] bool scattered() const;
  bool on_front = false;  // no other cell has both a smaller error and a shorter time
};

/// A line of the ladder: cells that differ in nothing else.
struct StudySeries {
  std::string name;  // empty when there is one line only
  std::vector<std::size_t> results;
  std::vector<std::optional<double>> orders;  // observed, of each quantity
  std::optional<double> order;                // of the largest error
};

struct StudyResults {
  std::vector<StudyQuantity> quantities;  // with the scene's checks filled in
  std::vector<StudyResult> results;
  std::vector<StudySeries> series;
  /// Costs are processor times: a run waited for processors that had other work. Else they are wall times.
  bool by_processor = false;
  [[nodiscard]] const char* cost_name() const { return by_processor ? "processor time" : "wall time"; }
  std::vector<std::string> notes;  // what a reader has to know: no limit found, machine busy
};

/// The study's quantities, or the scene's checks with a reference where it names none. Problems are about
/// quantities the scene does not have and references that are missing.
std::vector<StudyQuantity> resolved_quantities(const StudyScene& study, const CouplingScene& scene,
                                               std::vector<std::string>& problems);

StudyResults study_results(const StudyScene& study, const StudyStore& store,
                           const std::vector<PreparedCell>& cells);

/// One cell by itself; references that need the ladder stay open.
StudyResult study_result(const std::vector<StudyQuantity>& quantities, const StudyStore& store,
                         const PreparedCell& cell);

}  // namespace estuary::coupler
