// A study as a job array of Slurm: one task for each cell of the grid, and a job that collects.
#pragma once

#include <filesystem>
#include <string>

#include "study_scene.hpp"

namespace estuary::coupler {

struct SlurmArray {
  std::filesystem::path coupler;  // this program
  std::filesystem::path folder;   // of the study
  std::size_t tasks = 0;
  int at_once = 0;  // tasks that may run at the same time; 0: as many as the cluster allows
};

/// Text of the batch script of the array; `collect` gives that of the job that makes the tables afterwards.
std::string slurm_array_script(const StudyScene& study, const SlurmArray& array);
std::string slurm_collect_script(const StudyScene& study, const SlurmArray& array);

/// Writes both scripts into the folder and submits them with `sbatch`, the second to begin when the first has
/// ended, however it did. Returns what sbatch said. Throws std::runtime_error when sbatch is missing or
/// fails; the scripts are there then.
std::string submit_slurm_array(const StudyScene& study, const SlurmArray& array);

}  // namespace estuary::coupler
