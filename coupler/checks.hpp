// A scene's [[check]]s: values of the finished run against independent references.
#pragma once

#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "run_record.hpp"

namespace estuary::coupler {

struct CheckResult {
  CheckScene check;
  double value = 0;  // not a number when the run did not produce the quantity
  double error =
      0;  // relative when the check's tolerance is, else absolute; beyond the bound for at_most, at_least
  double tolerance = 0;  // what the error is held against
  bool pass = false;
};

/// Figures of the run itself that a check may ask for.
struct RunFigures {
  double wall_s = 0;
  std::uint64_t total_iterations = 0;
  std::uint64_t windows = 0;
  std::uint64_t most_iterations = 0;  // of a window
};

/// Value of a quantity as a check names it; not a number when the run did not produce it.
double quantity_value(const std::string& quantity, const CouplingScene& scene, const WatchRecord& watches,
                      const RunFigures& figures);

/// Of `figures` wall time and iterations are taken; windows are counted in the record.
std::vector<CheckResult> evaluate_checks(const CouplingScene& scene, const RecordedRun& record,
                                         RunFigures figures);

/// Amplitude and phase [degrees, -180..180] of value(t) = mean + amplitude cos(angular_frequency t + phase),
/// by least squares over the last whole number of periods after `from_time`. Not a number when less than one
/// period is there.
struct Harmonic {
  double amplitude = 0;
  double phase = 0;
};
Harmonic fit_harmonic(const WatchSeries& series, double angular_frequency, double from_time);

/// Oscillations per second after `from_time` [s]: lines of one slope through the times at which the values
/// pass the middle between a trough and a peak, upwards and downwards, linear between samples; that middle is
/// at the same phase of every cycle when the oscillation dies out or drifts. A turn counts when the values go
/// back by a quarter of the last swing, so that noise is not taken for periods. Not a number without a whole
/// period.
double frequency_of(const WatchSeries& series, double from_time);

/// The table a person reads at the end of a run.
std::string check_table(const std::vector<CheckResult>& results, double wall_s);

}  // namespace estuary::coupler
