// The runs of a study: every combination of the steps of what it varies.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "study_scene.hpp"

namespace estuary::coupler {

/// One run of the scene with settings of its own.
struct StudyCell {
  std::vector<std::size_t> steps;           // of each axis
  std::vector<std::string> labels;          // of each axis
  std::vector<std::string> settings;        // key=value, for `coupler run --set`
  std::map<std::string, double> variables;  // the varied keys that are numbers, by their variable's name
  std::optional<double> bisected;           // value of the bisected key
  std::optional<double>
      size;             // of the ladder's step: cells, particles or windows, any unit; smaller is finer
  std::string problem;  // why it cannot be run; empty when it can

  /// Labels of all axes but the ladder: cells with the same make one line.
  [[nodiscard]] std::string series() const;
  /// All labels, for messages.
  [[nodiscard]] std::string name() const;
};

/// All cells, the ladder's steps next to each other.
std::vector<StudyCell> study_cells(const StudyScene& study);

/// The cell at these steps, with a value of the bisected key when the study has one.
StudyCell study_cell(const StudyScene& study, std::vector<std::size_t> steps,
                     std::optional<double> bisected = {});

/// TOML text as a person reads it: a string without its quotes.
std::string unquoted(const std::string& toml);

/// The number that TOML text stands for.
std::optional<double> number_of(const std::string& toml);

}  // namespace estuary::coupler
