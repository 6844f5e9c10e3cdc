// A study: one scene, what to vary in it, what to look at. Read from a TOML file with the reader of scenes,
// so that every problem comes with its line and column.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "scene.hpp"

namespace estuary::coupler {

enum class StudyMode { error, stability };

/// One [[vary]]: keys of the scene that change together, step by step. The first of a study is its ladder,
/// from coarse to fine.
struct StudyAxis {
  std::string name;
  std::vector<std::string> keys;                 // of the scene; those under `let` are variables only
  std::vector<std::vector<std::string>> values;  // [step][key], TOML text
  std::vector<std::string> labels;               // one per step, for people
  std::optional<std::string> size;  // expression for the size of a step's cells, particles or windows
};

/// What a run is judged by. At most one source of its reference is set; none: that of the scene's [[check]].
struct StudyQuantity {
  std::string name;                         // WATCH.QUANTITY[.STATISTIC] or coupling.*, run.*, as in a check
  std::optional<double> reference;          // a number
  std::optional<std::string> other;         // another quantity of the same run
  std::optional<std::string> exact;         // an expression of the varied keys
  bool finest = false;                      // the ladder's own limit
  bool from_check = false;                  // taken from the [[check]] of the scene, as the cell changed it
  std::optional<double> order;              // of that limit; found from three steps when absent
  std::optional<double> scale;              // what an error is divided by; the reference's size when absent
  std::optional<double> at_most, at_least;  // stability: beyond this a run counts as inaccurate
  double tolerance = 0;                     // stability: largest error of a run that counts as stable
  double lie = 0.1;  // stability: error above which a run may not end without a warning
  std::string source;
};

/// [bisect]: the limit of one key for every cell of the grid.
struct StudyBisection {
  std::string key;
  double from = 0;  // expected to hold
  double to = 0;    // expected not to
  bool logarithmic = true;
  bool whole = false;       // whole numbers only
  double resolution = 0.1;  // of the limit: relative when logarithmic, else as a share of the interval
};

struct StudyScene {
  std::filesystem::path file;
  std::string title;
  std::filesystem::path scene;  // as found from here
  StudyMode mode = StudyMode::error;
  std::vector<std::string> fixed;  // key=value for every run
  std::vector<StudyAxis> axes;
  std::vector<std::pair<std::string, std::string>>
      derived;                            // key of the scene, expression of the varied keys
  std::vector<StudyQuantity> quantities;  // empty: the scene's checks with a reference
  std::optional<StudyBisection> bisection;
  int repeats = 1;
  double timeout_s = 3600;
  std::vector<double> limits;              // errors of the table of the cheapest settings
  std::vector<std::string> slurm_options;  // of the array script
};

struct StudyReading {
  StudyScene study;
  std::vector<SceneProblem> problems;
};

/// Reads the study in `file`. A file that cannot be read is a problem without a place.
StudyReading read_study(const std::filesystem::path& file);

/// "fluid.viscosity" as the name of a variable: "fluid_viscosity".
std::string variable_name(std::string_view key);

}  // namespace estuary::coupler
