#include "plan.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <set>
#include <tuple>

#include "checkpoints.hpp"
#include "child_process.hpp"
#include "participants.hpp"

namespace estuary::coupler {
namespace {

constexpr double check_timeout = 30.0;  // [s] for a program to check its table

// What would otherwise be known only after the launch.
void check_mpirun(SceneTable& table) {
  if (!find_program("mpirun")) {
    table.problem("ranks", "there is no mpirun on PATH to start several ranks with: install openmpi-bin");
    return;
  }
  const auto set = [](const char* name) { return std::getenv(name) != nullptr; };
  if (::geteuid() == 0 && !(set("OMPI_ALLOW_RUN_AS_ROOT") && set("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM"))) {
    table.problem("ranks",
                  "mpirun starts nothing for root unless OMPI_ALLOW_RUN_AS_ROOT=1 and "
                  "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM=1 are in the environment; better be another user");
  }
}

void ask_participants(CheckedScene& checked, Scene& scene) {
  for (const auto& participant : checked.coupling.participants) {
    if (participant.command.empty() || !participant.here()) continue;
    SceneTable table = scene.root().table(participant.role);
    const auto program = find_program(participant.command.front());
    if (!program) {
      table.problem(participant.ranks > 1 ? "ranks" : "solver",
                    fmt::format("'{}' is not a program: give a path, a name beside the coupler or on PATH",
                                participant.command.front()));
      continue;
    }
    if (participant.ranks > 1) check_mpirun(table);
    std::vector<std::string> words = participant.command;
    words.front() = program->string();
    words.emplace_back("--check");
    std::string input;
    configure_message(checked.given, participant.role).SerializeToString(&input);
    try {
      const Finished finished = run_program(words, input, check_timeout);
      v1::Configured configured;
      if ((finished.status != 0 && finished.status != 2) || !configured.ParseFromString(finished.output)) {
        table.problem("solver", fmt::format("'{} --check' ended with status {}: {}",
                                            participant.command.front(), finished.status, finished.errors));
        continue;
      }
      checked.participants[participant.role] = std::move(configured);
    } catch (const std::exception& error) {
      table.problem("solver", error.what());
    }
  }
}

std::vector<SceneProblem> all_problems(const Scene& scene, const CheckedScene& checked) {
  std::vector<SceneProblem> problems = scene.problems();
  for (const auto& [role, configured] : checked.participants) {
    for (const auto& problem : configured.problems()) {
      problems.push_back({.line = problem.line(), .column = problem.column(), .message = problem.message()});
    }
  }
  const auto place = [](const SceneProblem& problem) {
    return std::tie(problem.line, problem.column, problem.message);
  };
  std::stable_sort(problems.begin(), problems.end(),
                   [&](const SceneProblem& a, const SceneProblem& b) { return place(a) < place(b); });
  // What two readers noticed is said once.
  problems.erase(
      std::unique(problems.begin(), problems.end(),
                  [&](const SceneProblem& a, const SceneProblem& b) { return place(a) == place(b); }),
      problems.end());
  return problems;
}

void note_left_out(CheckedScene& checked) {
  for (const auto* role : {"fluid", "solid", "grains"}) {
    if (checked.coupling.find(role) == nullptr) {
      checked.left_out.push_back(
          fmt::format("{0}: the scene has no [{0}] table, no such process is launched", role));
    }
  }
  if (checked.coupling.participants.size() == 1) {
    checked.left_out.emplace_back("exchange, mapping and coupling iterations: one participant");
  }
  if (!checked.coupling.record) checked.left_out.emplace_back("record for a replay: output.record is false");
  if (!checked.coupling.frames) checked.left_out.emplace_back("field files: output.frames is false");
  for (const auto& [role, configured] : checked.participants) {
    for (const auto& item : configured.left_out())
      checked.left_out.push_back(fmt::format("{}: {}", role, item));
  }
}

/// Grains are usually exchanged once a window, and their scenes say so; a solid under a fluid is another
/// matter.
void note_warnings(CheckedScene& checked) {
  const CouplingScene& coupling = checked.coupling;
  if (!coupling.implicit() && coupling.find("fluid") != nullptr && coupling.find("solid") != nullptr) {
    checked.warnings.emplace_back(
        "explicit coupling: each window is computed once, and nothing measures how far motion and load "
        "agree; "
        "a solid not much denser than the fluid needs an implicit scheme");
  }
}

std::string measure_text(const Measure& measure) {
  const char* symbol = measure.field == Field::displacement ? "d"
                       : measure.field == Field::velocity   ? "v"
                                                            : "f";
  std::string increment = fmt::format("|{0}_k - {0}_(k-1)| < {1:g}", symbol, measure.limit);
  switch (measure.kind) {
    case MeasureKind::relative:
      return increment + fmt::format(" |{}_k|", symbol);
    case MeasureKind::residual_relative:
      return increment + fmt::format(" |{0}_1 - {0}_0|", symbol);
    case MeasureKind::absolute:
      break;
  }
  return increment;
}

std::string coupling_text(const CouplingScene& coupling) {
  std::string text = coupling.mode == CouplingMode::steady
                         ? std::string("steady: one common equilibrium")
                         : fmt::format("transient: {} windows of {:g} s to {:g} s", coupling.windows,
                                       coupling.window, coupling.end_time);
  if (coupling.participants.size() < 2) return text;
  const bool agree = coupling.find("solid") != nullptr;
  text += coupling.parallel() ? ", parallel" : ", serial";
  if (!coupling.implicit() || !agree) return text + "-explicit";
  text += "-implicit, ";
  switch (coupling.acceleration) {
    case AccelerationKind::none:
      text += "no acceleration";
      break;
    case AccelerationKind::constant:
      text += fmt::format("constant relaxation {:g}", coupling.relaxation);
      break;
    case AccelerationKind::aitken:
      text += fmt::format("Aitken relaxation from {:g}", coupling.relaxation);
      break;
    case AccelerationKind::iqn_ils:
      text += fmt::format("IQN-ILS from {:g}", coupling.relaxation);
      break;
    case AccelerationKind::iqn_imvj:
      text += fmt::format("IQN-IMVJ from {:g}", coupling.relaxation);
      break;
  }
  for (std::size_t k = 0; k < coupling.measures.size(); ++k)
    text += (k == 0 ? ", until " : " and ") + measure_text(coupling.measures[k]);
  text += fmt::format(", at most {} iterations", coupling.max_iterations);
  if (coupling.adaptive_window)
    text += fmt::format(", a failing window shortened to no less than {:g} s", coupling.smallest_window);
  return text;
}

std::string bytes_text(double bytes) {
  return bytes < 1e6   ? fmt::format("{:.0f} kB", bytes / 1e3)
         : bytes < 1e9 ? fmt::format("{:.1f} MB", bytes / 1e6)
                       : fmt::format("{:.2f} GB", bytes / 1e9);
}

}  // namespace

v1::Configure configure_message(const SceneText& given, const std::string& role) {
  v1::Configure message;
  message.set_role(role);
  message.set_scene_name(given.name);
  message.set_scene(given.text);
  for (const auto& entry : given.overrides) message.add_overrides(entry);
  return message;
}

CheckedScene check_scene(SceneText given) {
  CheckedScene checked{.given = std::move(given),
                       .coupling = {},
                       .as_run = {},
                       .resumable = {},
                       .problems = {},
                       .participants = {},
                       .left_out = {},
                       .warnings = {}};
  Scene scene = Scene::parse(checked.given.text, checked.given.name, checked.given.overrides);
  checked.as_run = scene.as_run();
  checked.resumable = resumable_text(scene);
  if (scene.problems().empty()) {
    checked.coupling = read_coupling_scene(scene);
    ask_participants(checked, scene);
  }
  checked.problems = all_problems(scene, checked);
  note_left_out(checked);
  note_warnings(checked);
  return checked;
}

std::string plan_text(const CheckedScene& checked) {
  const CouplingScene& coupling = checked.coupling;
  std::string text = fmt::format("{}\n  {}\n", coupling.title, coupling_text(coupling));
  for (const auto& warning : checked.warnings) text += fmt::format("  warning: {}\n", warning);
  for (const auto& participant : coupling.participants) {
    const std::string ranks = participant.ranks > 1 ? fmt::format("mpirun -n {} ", participant.ranks) : "";
    const std::string what = fmt::format("launch {}{}", ranks, fmt::join(participant.command, " "));
    const std::string how = participant.here() ? what
                            : participant.launched()
                                ? fmt::format("{} on {} at {}, folder {} there", what,
                                              participant.host.empty() ? "a node of Slurm" : participant.host,
                                              participant.endpoint, participant.folder)
                                : fmt::format("connect to {}", participant.endpoint);
    text += fmt::format("{}: {}\n", participant.role, how);
    const auto found = checked.participants.find(participant.role);
    if (found == checked.participants.end()) continue;
    const v1::Configured& configured = found->second;
    if (!configured.variant().empty())
      text += fmt::format("  {:<28} {}\n", "kernel variant", configured.variant());
    for (const auto& entry : configured.plan())
      text += fmt::format("  {:<28} {}\n", entry.name(), entry.value());
    if (configured.memory_bytes() > 0) {
      text += fmt::format("  {:<28} {}\n", "memory", bytes_text(configured.memory_bytes()));
    }
    if (configured.expected_updates() > 0) {
      text += fmt::format("  {:<28} {:.3g}\n", "updates for one pass", configured.expected_updates());
    }
    for (const auto& warning : configured.warnings()) text += fmt::format("  warning: {}\n", warning);
  }
  text += "left out:\n";
  for (const auto& item : checked.left_out) text += fmt::format("  {}\n", item);
  return text;
}

std::string launch_text(const CheckedScene& checked, const std::filesystem::path& folder) {
  std::string text;
  for (const auto& participant : checked.coupling.participants) {
    if (!participant.launched()) {
      text += fmt::format("{}: connect to {}\n", participant.role, participant.endpoint);
      continue;
    }
    const auto words = launch_command(
        checked.coupling, participant,
        participant.here() ? "ipc://SOCKETS/" + participant.role : participant.endpoint, folder);
    text += fmt::format("{}: {}\n", participant.role, fmt::join(words, " "));
  }
  return text + "SOCKETS is a new folder for each run\n";
}

}  // namespace estuary::coupler
