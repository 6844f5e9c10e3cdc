// The command a person types.
#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <atomic>
#include <csignal>
#include <cstdio>
#include <fstream>
#include <sstream>

#include "channel.hpp"
#include "conform.hpp"
#include "plan.hpp"
#include "precice_import.hpp"
#include "report.hpp"
#include "run_command.hpp"
#include "study_command.hpp"

namespace {

using namespace estuary;
using namespace estuary::coupler;

std::atomic<int> interrupts{0};
void on_interrupt(int /*signal*/) {
  ++interrupts;
}

struct TemporarySockets {
  TemporarySockets() {
    std::string name = (std::filesystem::temp_directory_path() / "estuary-conform-XXXXXX").string();
    if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make a folder at " + name);
    path = name;
  }
  ~TemporarySockets() {
    std::error_code ignored;
    std::filesystem::remove_all(path, ignored);
  }
  TemporarySockets(const TemporarySockets&) = delete;
  TemporarySockets& operator=(const TemporarySockets&) = delete;
  std::filesystem::path path;
};

int exit_code(ExitStatus status) {
  return static_cast<int>(status);
}

// Reads and checks; prints every problem. Nothing when the scene cannot be used.
std::optional<CheckedScene> checked_scene(const std::string& path,
                                          const std::vector<std::string>& overrides) {
  std::ifstream file(path);
  std::ostringstream text;
  if (file) text << file.rdbuf();
  if (!file || !text) {
    fmt::print(stderr, "{}: cannot be read\n", path);
    return std::nullopt;
  }
  CheckedScene checked = check_scene({.name = path, .text = text.str(), .overrides = overrides});
  for (const auto& problem : checked.problems) fmt::print(stderr, "{}\n", describe(path, problem));
  if (!checked.problems.empty()) {
    fmt::print(stderr, "{} problem{} in {}; nothing was launched\n", checked.problems.size(),
               checked.problems.size() == 1 ? "" : "s", path);
    return std::nullopt;
  }
  return checked;
}

int run(const std::string& path, std::string folder, const std::vector<std::string>& overrides, bool dry,
        bool resume, bool report) {
  const auto checked = checked_scene(path, overrides);
  if (!checked) return exit_code(ExitStatus::wrong_scene);
  if (folder.empty()) folder = (std::filesystem::path("runs") / std::filesystem::path(path).stem()).string();
  if (dry) {
    fmt::print("{}", launch_text(*checked, folder));
    return exit_code(ExitStatus::done);
  }
  for (const auto& [role, configured] : checked->participants) {
    for (const auto& warning : configured.warnings()) fmt::print(stderr, "{}: warning: {}\n", role, warning);
  }
  return exit_code(run_scene(*checked, folder, resume, interrupts, report));
}

int check(const std::string& path, const std::vector<std::string>& overrides) {
  const auto checked = checked_scene(path, overrides);
  if (!checked) return exit_code(ExitStatus::wrong_scene);
  fmt::print("{}", plan_text(*checked));
  return exit_code(ExitStatus::done);
}

int make_keys(const std::string& base) {
  const CurvePair pair = new_curve_pair();
  write_key_files(base, pair);
  fmt::print(
      "{0}.key  the pair; stays where it is used, readable by its owner only\n{0}.pub  for the others\n",
      base);
  return exit_code(ExitStatus::done);
}

int ping(const std::string& endpoint, double timeout, const std::string& key, const std::string& server_key,
         bool insecure) {
  try {
    ClientSecurity security{.insecure = insecure};
    if (!key.empty()) security.own = read_pair(key);
    if (!server_key.empty()) security.server_key = read_public_key(server_key);
    ClientChannel channel(endpoint, security);
    v1::Request request;
    request.mutable_header()->set_protocol_version(protocol_version);
    request.mutable_header()->set_sequence(1);
    request.mutable_hello();
    channel.send(request);
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::duration<double>(timeout);
    std::optional<v1::Reply> reply;
    while (!reply && std::chrono::steady_clock::now() < deadline)
      reply = channel.receive(std::chrono::milliseconds(50));
    if (!reply || !reply->has_welcome()) {
      fmt::print(stderr, "{}: {}\n", endpoint,
                 reply ? reply->error().message() : fmt::format("no answer within {} s", timeout));
      return exit_code(ExitStatus::participant_lost);
    }
    const auto& welcome = reply->welcome();
    fmt::print("{} {} at {}, process {}\n  roles {}\n  can {}\n  {}\n", welcome.name(), welcome.version(),
               endpoint, welcome.process(), fmt::join(welcome.roles(), ", "),
               fmt::join(welcome.capabilities(), ", "),
               welcome.run_id().empty() ? "free" : "serves run " + welcome.run_id());
    return exit_code(ExitStatus::done);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}\n", error.what());
    return exit_code(ExitStatus::wrong_scene);
  }
}

int conform(ConformTarget target, const std::string& scene, const std::string& launch,
            const std::vector<std::string>& overrides) {
  std::optional<CheckedScene> checked;
  if (scene.empty() != target.role.empty() || (scene.empty() && target.endpoint.empty()) ||
      (!launch.empty() && !target.endpoint.empty())) {
    fmt::print(
        stderr,
        "coupler conform: give an ADDRESS, or --scene and --role with an ADDRESS, with --launch, or with "
        "neither for the scene's own solver\n");
    return exit_code(ExitStatus::wrong_scene);
  }
  const TemporarySockets temporary;
  target.folder = temporary.path;
  if (!scene.empty()) {
    std::vector<std::string> changed = overrides;
    if (!launch.empty()) changed.push_back(fmt::format("{}.solver=\"{}\"", target.role, launch));
    checked = checked_scene(scene, changed);
    if (!checked) return exit_code(ExitStatus::wrong_scene);
    const ParticipantScene* participant = checked->coupling.find(target.role);
    if (participant == nullptr) {
      fmt::print(stderr, "{}: the scene has no participant '{}'\n", scene, target.role);
      return exit_code(ExitStatus::wrong_scene);
    }
    if (target.endpoint.empty()) {
      target.endpoint = participant->endpoint;
      target.command = participant->command;
    }
  }
  try {
    const Examination examination = examine(checked ? &*checked : nullptr, target, interrupts);
    fmt::print("{}", text_of(examination));
    return exit_code(status_of(examination));
  } catch (const RunFailure& failure) {
    fmt::print(stderr, "coupler: {}\n", failure.what());
    return exit_code(failure.status);
  }
}

int import(const std::string& path, const std::string& out, const std::vector<std::string>& roles) {
  std::map<std::string, std::string> chosen;
  for (const std::string& entry : roles) {
    const std::size_t equals = entry.find('=');
    const std::string role = equals == std::string::npos ? std::string() : entry.substr(equals + 1);
    if (role != "fluid" && role != "solid" && role != "grains") {
      fmt::print(stderr, "--role {}: expected PARTICIPANT=fluid, solid or grains\n", entry);
      return exit_code(ExitStatus::wrong_scene);
    }
    chosen[entry.substr(0, equals)] = role;
  }
  std::ifstream file(path);
  std::ostringstream text;
  if (file) text << file.rdbuf();
  if (!file || !text) {
    fmt::print(stderr, "{}: cannot be read\n", path);
    return exit_code(ExitStatus::wrong_scene);
  }
  try {
    const PreciceImport imported = import_precice(path, text.str(), chosen);
    for (const auto& note : imported.notes) fmt::print(stderr, "{}\n", note);
    if (out.empty()) {
      fmt::print("{}", imported.scene);
      return exit_code(ExitStatus::done);
    }
    std::ofstream scene(out);
    scene << imported.scene;
    scene.close();
    if (!scene) throw std::runtime_error(out + ": cannot be written");
    return exit_code(ExitStatus::done);
  } catch (const std::runtime_error& error) {
    fmt::print(stderr, "{}\n", error.what());
    return exit_code(ExitStatus::wrong_scene);
  }
}

int report(const std::string& folder) {
  try {
    write_report(folder);
    fmt::print("{}\n", (std::filesystem::path(folder) / "report.html").string());
    return exit_code(ExitStatus::done);
  } catch (const std::exception& error) {
    fmt::print(stderr, "{}: {}\n", folder, error.what());
    return exit_code(ExitStatus::wrong_scene);
  }
}

void add_study_options(CLI::App& command, StudyOptions& study) {
  command.add_option("study", study.study, "The study file (TOML)")->required();
  command.add_option("--out", study.folder, "Folder for cells and tables; runs/<study> by default");
  command
      .add_option("--jobs", study.jobs, "Settings that run at the same time; more than one spoils the times")
      ->check(CLI::Range(1, 4096))
      ->capture_default_str();
  auto* slurm =
      command.add_flag("--slurm", study.slurm, "Write and submit a job array, one task per setting");
  auto* cell =
      command.add_option("--cell", study.cell, "Run this setting only, counted from 0, without tables");
  auto* collect =
      command.add_flag("--collect", study.collect, "Run nothing: make the tables of what is there");
  slurm->excludes(cell)->excludes(collect);
  cell->excludes(collect);
  command
      .add_flag("--retime", study.retime,
                "Run again what was run before: for times of a machine that is free now")
      ->excludes(slurm)
      ->excludes(cell)
      ->excludes(collect);
  command
      .add_option("--against", study.against,
                  "An earlier study.csv (limits.csv of a bisection): exit 1 when an error grew or less holds")
      ->check(CLI::ExistingFile);
  command.add_option("--allow", study.allowed_growth, "Growth of an error that --against allows, relative")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
}

}  // namespace

int main(int argc, char** argv) {
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGINT, on_interrupt);
  std::signal(SIGTERM, on_interrupt);

  CLI::App app{"Estuary: couples fluid, solid and granular solvers that run as separate processes"};
  app.require_subcommand(1);
  app.set_version_flag("--version", ESTUARY_VERSION);
  std::string scene;
  std::string folder;
  std::vector<std::string> overrides;
  auto* run_command = app.add_subcommand("run", "Run a scene");
  auto* check_command = app.add_subcommand("check", "Check a scene and print what a run would do");
  for (auto* command : {run_command, check_command}) {
    command->add_option("scene", scene, "The scene file (TOML)")->required();
    command->add_option("--set", overrides, "Change a value of the scene: key.path=value; may be repeated")
        ->take_all()
        ->allow_extra_args(false);
  }
  run_command->add_option("--out", folder, "Folder for what the run leaves behind; runs/<scene> by default");
  bool dry = false;
  run_command->add_flag("--dry-run", dry, "Check the scene, print what would be launched and end");
  bool resume = false;
  run_command->add_flag("--resume", resume, "Go on from the newest checkpoint in the run's folder");
  bool no_report = false;
  run_command->add_flag("--no-report", no_report, "Do not make the page of the run");
  auto* report_command = app.add_subcommand("report", "Make one HTML page of a finished run");
  report_command->add_option("folder", folder, "The run's folder")->required();
  StudyOptions study;
  auto* study_command = app.add_subcommand(
      "study", "Run a scene over a grid of settings: error against run time, or stability");
  add_study_options(*study_command, study);
  auto* ping_command = app.add_subcommand("ping", "Ask a running participant who it is");
  std::string endpoint;
  double timeout = 2.0;
  ping_command->add_option("endpoint", endpoint, "ipc:///path or tcp://host:port")->required();
  ping_command->add_option("--timeout", timeout, "Seconds to wait for the answer")->capture_default_str();
  std::string key;
  std::string server_key;
  bool insecure = false;
  ping_command->add_option("--key", key, "File of the own key pair");
  ping_command->add_option("--server-key", server_key, "File of the participant's public key");
  ping_command->add_flag("--insecure", insecure, "Ask another machine without keys");
  auto* keys_command = app.add_subcommand("keys", "Make a CurveZMQ key pair: NAME.key and NAME.pub");
  std::string base;
  keys_command->add_option("name", base, "Path of the files without their endings")->required();
  auto* import_command = app.add_subcommand("import", "Make a scene of a preCICE configuration");
  std::string configuration, import_out;
  std::vector<std::string> import_roles;
  import_command->add_option("configuration", configuration, "precice-config.xml")->required();
  import_command->add_option("--out", import_out, "The scene to write; standard output by default");
  import_command->add_option("--role", import_roles, "PARTICIPANT=fluid, solid or grains; may be repeated")
      ->take_all()
      ->allow_extra_args(false);
  auto* conform_command =
      app.add_subcommand("conform", "Drive a participant through its life and print what holds");
  ConformTarget target;
  std::string launch, conform_scene;
  conform_command->add_option("endpoint", target.endpoint, "Address of a running participant");
  conform_command->add_option("--launch", launch, "Command that starts the participant");
  conform_command->add_option("--scene", conform_scene, "The scene it is configured for");
  conform_command->add_option("--role", target.role, "The scene's table it serves: fluid, solid, grains");
  conform_command->add_option("--set", overrides, "Change a value of the scene")
      ->take_all()
      ->allow_extra_args(false);
  conform_command->add_option("--timeout", target.timeout, "Longest wait for an answer [s]")
      ->capture_default_str();
  conform_command->add_option("--pressure", target.pressure, "Loads a solid [Pa]")->capture_default_str();
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : exit_code(ExitStatus::wrong_scene);
  }
  try {
    if (*run_command) return run(scene, folder, overrides, dry, resume, !no_report);
    if (*check_command) return check(scene, overrides);
    if (*study_command) return exit_code(run_study(study, interrupts));
    if (*report_command) return report(folder);
    if (*keys_command) return make_keys(base);
    if (*import_command) return import(configuration, import_out, import_roles);
    if (*conform_command) return conform(target, conform_scene, launch, overrides);
    return ping(endpoint, timeout, key, server_key, insecure);
  } catch (const std::exception& error) {
    std::fputs(fmt::format("coupler: {}\n", error.what()).c_str(), stderr);
    return exit_code(ExitStatus::wrong_scene);
  }
}
