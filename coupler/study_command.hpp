// `coupler study STUDY`.
#pragma once

#include <atomic>
#include <filesystem>
#include <optional>

#include "failure.hpp"

namespace estuary::coupler {

struct StudyOptions {
  std::filesystem::path study;
  std::filesystem::path folder;  // runs/<study> when empty
  int jobs = 1;
  bool slurm = false;               // as a job array
  std::optional<std::size_t> cell;  // run this one only, and make no tables (a task of the array)
  bool collect = false;             // run nothing, make the tables of what is there
  bool retime = false;              // run again what came to its end before, for its times
  std::filesystem::path
      against;  // an earlier study.csv (limits.csv with [bisect]): what got worse is a failure
  double allowed_growth = 0.1;  // relative
};

/// Exit status: 0 the study was carried out, whatever its cells came to; 1 an error grew, or a stability
/// study found a run that is wrong and yet ended as done; 2 the study or every cell of it is wrong; 130
/// interrupted, cells and tables so far are kept.
ExitStatus run_study(const StudyOptions& options, const std::atomic<int>& interrupt);

}  // namespace estuary::coupler
