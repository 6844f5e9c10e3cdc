#include "slurm_array.hpp"

#include <fmt/format.h>

#include <stdexcept>

#include "child_process.hpp"
#include "whole_file.hpp"

namespace estuary::coupler {
namespace {

/// As one word of a shell command.
std::string quoted(const std::string& text) {
  std::string result = "'";
  for (const char c : text) result += c == '\'' ? std::string("'\\''") : std::string(1, c);
  return result + "'";
}

std::string head(const StudyScene& study, const SlurmArray& array, const std::string& name) {
  std::string text =
      fmt::format("#!/bin/bash\n#SBATCH --job-name={}-{}\n#SBATCH --output={}\n", study.file.stem().string(),
                  name, (array.folder / "slurm-%x-%a.log").string());
  for (const auto& option : study.slurm_options) text += fmt::format("#SBATCH {}\n", option);
  return text;
}

std::string command(const StudyScene& study, const SlurmArray& array) {
  return fmt::format("cd {}\nexec {} study {} --out {}", quoted(std::filesystem::current_path().string()),
                     quoted(array.coupler.string()), quoted(study.file.string()),
                     quoted(array.folder.string()));
}

std::string submit(const std::filesystem::path& sbatch, const std::vector<std::string>& arguments) {
  constexpr double patience_s = 60;
  std::vector<std::string> words{sbatch.string(), "--parsable"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  const Finished finished = run_program(words, "", patience_s);
  if (finished.status != 0)
    throw std::runtime_error(
        fmt::format("sbatch ended with status {}: {}", finished.status, finished.errors));
  auto job = finished.output.substr(0, finished.output.find_first_of(";\n"));
  if (job.empty()) throw std::runtime_error("sbatch gave no job number");
  return job;
}

}  // namespace

std::string slurm_array_script(const StudyScene& study, const SlurmArray& array) {
  auto text = head(study, array, "cells");
  text += fmt::format("#SBATCH --array=0-{}", array.tasks - 1);
  if (array.at_once > 0) text += fmt::format("%{}", array.at_once);
  return text + "\n" + command(study, array) + " --cell \"$SLURM_ARRAY_TASK_ID\"\n";
}

std::string slurm_collect_script(const StudyScene& study, const SlurmArray& array) {
  return head(study, array, "collect") + command(study, array) + " --collect\n";
}

std::string submit_slurm_array(const StudyScene& study, const SlurmArray& array) {
  const auto cells = array.folder / "study.sbatch";
  const auto collect = array.folder / "collect.sbatch";
  write_whole(cells, slurm_array_script(study, array));
  write_whole(collect, slurm_collect_script(study, array));
  const auto sbatch = find_program("sbatch");
  if (!sbatch) {
    throw std::runtime_error(fmt::format("there is no sbatch on PATH; submit {} and then {} where there is",
                                         cells.string(), collect.string()));
  }
  const auto job = submit(*sbatch, {cells.string()});
  const auto last = submit(*sbatch, {fmt::format("--dependency=afterany:{}", job), collect.string()});
  return fmt::format("job {}: {} tasks; job {} makes the tables when they have ended", job, array.tasks,
                     last);
}

}  // namespace estuary::coupler
