// Checks a scene completely without running it and says what a run would do.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "coupling_scene.hpp"
#include "estuary/v1/protocol.pb.h"
#include "scene.hpp"

namespace estuary::coupler {

/// A scene as given on the command line.
struct SceneText {
  std::string name;  // as the person wrote it
  std::string text;
  std::vector<std::string> overrides;
};

struct CheckedScene {
  SceneText given;
  CouplingScene coupling;
  std::string as_run;                  // with the overrides
  std::string resumable;               // what has to be the same for a run to go on (checkpoints.hpp)
  std::vector<SceneProblem> problems;  // of the coupler and of every participant, in the order of the file
  std::map<std::string, v1::Configured> participants;  // by role; absent when it could not be asked
  std::vector<std::string> left_out;
  std::vector<std::string> warnings;  // of the coupling itself; those of a participant are in its answer
};

/// Asks each participant's program to check its own table (`PROGRAM --check`, nothing is served). A program
/// that is missing is a problem at its `solver` key. One that is connected to checks its table when the run
/// begins.
CheckedScene check_scene(SceneText given);

/// What will run, with which derived numbers, and what is left out.
std::string plan_text(const CheckedScene& checked);

/// The command of every participant that a run into `folder` would launch.
std::string launch_text(const CheckedScene& checked, const std::filesystem::path& folder);

v1::Configure configure_message(const SceneText& given, const std::string& role);

}  // namespace estuary::coupler
