#include "coupling_scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <sstream>

#include "channel.hpp"

namespace estuary::coupler {
namespace {

constexpr std::array<std::string_view, 3> roles = {"fluid", "solid", "grains"};

std::string default_program(std::string_view role) {
  if (role == "fluid") return "fluid-lbm";
  if (role == "solid") return "solid-sph";
  return "grains-dem";
}

std::vector<std::string> split_words(const std::string& text) {
  std::istringstream stream(text);
  std::vector<std::string> words;
  for (std::string word; stream >> word;) words.push_back(word);
  return words;
}

// A program that several processes are together has `-mpi` behind the name of the one that is alone.
void read_ranks(SceneTable& table, ParticipantScene& participant) {
  participant.ranks = static_cast<int>(table.integer_or("ranks", 1, 1, 100'000));
  if (participant.ranks == 1 || participant.command.empty()) return;
  if (participant.role != "fluid") {
    table.problem("ranks", fmt::format("the {} is one process: only the fluid is shared among ranks",
                                       participant.role));
    return;
  }
  const std::string name = std::filesystem::path(participant.command.front()).filename();
  if (name != "fluid-lbm" && name != "fluid-lbm-mpi") {
    table.problem("ranks", fmt::format("`solver` is {}: only fluid-lbm is shared among ranks", name));
    return;
  }
  if (name == "fluid-lbm") participant.command.front() += "-mpi";
}

void read_participants(SceneTable& root, CouplingScene& result) {
  for (const auto role : roles) {
    auto table = root.table_if(role);
    if (!table) continue;
    ParticipantScene participant{.role = std::string(role), .command = {}, .endpoint = {}, .threads = 0};
    if (table->has("connect")) {
      participant.endpoint = table->text("connect");
      participant.launch = Launch::manual;
      if (table->has("solver")) {
        table->problem("connect",
                       "give either `solver` (a program to launch) or `connect` (a running one), not both");
      }
    } else {
      participant.command = split_words(table->text_or("solver", default_program(role)));
      if (participant.command.empty()) table->problem("solver", "the program to launch is empty");
    }
    participant.threads = static_cast<int>(table->integer_or("threads", 0, 0, 1024));
    if (table->has("ranks")) read_ranks(*table, participant);
    result.participants.push_back(std::move(participant));
  }
  if (result.participants.empty()) {
    root.problem("",
                 "the scene has no participant: add at least one of the tables [fluid], [solid], [grains]");
  }
}

// The value that belongs to the text chosen.
template <typename Value, std::size_t count>
Value pick(SceneTable& table, const char* key, const std::array<std::string_view, count>& names,
           const std::array<Value, count>& values) {
  const std::string chosen = table.choice(key, names);
  const auto found = std::find(names.begin(), names.end(), chosen);
  return found == names.end() ? values.front() : values[static_cast<std::size_t>(found - names.begin())];
}

// A network stands still for longer than a machine does [s].
constexpr double lost_after_far = 5.0;

void read_host(SceneTable& hosts, ParticipantScene& participant) {
  auto table = hosts.table_if(participant.role);
  if (!table) return;
  constexpr std::array<std::string_view, 4> names = {"local", "ssh", "slurm", "manual"};
  const Launch launch =
      pick(*table, "launch", names, std::array{Launch::local, Launch::ssh, Launch::slurm, Launch::manual});
  const bool connects = participant.launch == Launch::manual;
  participant.public_key = table->text_or("public_key", "");
  if (!connects) participant.launch = launch;
  const bool remote = participant.launch == Launch::ssh || participant.launch == Launch::slurm;
  if (table->has("lost_after"))
    participant.lost_after = table->number("lost_after", {.minimum = 0.5, .maximum = 3600.0});
  if (remote) {
    participant.bind = table->text_or("bind", "");
  } else if (table->has("bind")) {
    table->problem("bind", "tells a participant that this run launches elsewhere where to listen");
  }
  if (connects && launch != Launch::local && launch != Launch::manual)
    table->problem("launch", "the participant's own table says `connect`: it is started by somebody else");
  if (!connects && launch != Launch::local) participant.endpoint = table->text("address");
  if (connects && table->has("address"))
    table->problem("address", "the participant's own table has it already, as `connect`");
  if (remote) {
    participant.folder = table->text("folder");
    participant.host = launch == Launch::ssh ? table->text("host") : table->text_or("host", "");
    participant.key = table->text_or("key", "");
    participant.allow = table->text_or("allow", "");
    if (participant.key.empty() != participant.allow.empty())
      table->problem("key", "`key` and `allow` belong together: files on that machine");
    // ssh would take it for an option.
    if (participant.host.starts_with("-")) table->problem("host", "is no name of a machine");
  }
}

void read_hosts(SceneTable& root, CouplingScene& result) {
  result.insecure = root.boolean_or("insecure", false);
  auto hosts = root.table_if("hosts");
  if (hosts) {
    if (auto coupler = hosts->table_if("coupler")) result.coupler_key = coupler->text("key");
    for (auto& participant : result.participants) read_host(*hosts, participant);
    // What is said of a participant that was taken out of the scene has no meaning now.
    for (const auto role : roles)
      if (result.find(role) == nullptr) hosts->leave_to_others({role});
  }
  // One process would take the second for the first, who asks again.
  for (auto one = result.participants.begin(); one != result.participants.end(); ++one) {
    const auto same = std::find_if(result.participants.begin(), one, [&](const ParticipantScene& other) {
      return !one->endpoint.empty() && other.endpoint == one->endpoint;
    });
    if (same != one)
      root.problem("", fmt::format("'{}' and '{}' are both said to be at {}: each is a process of its own",
                                   same->role, one->role, one->endpoint));
  }
  for (auto& participant : result.participants) {
    const bool stays_here = (participant.endpoint.empty() || is_local(participant.endpoint)) &&
                            (participant.bind.empty() || is_local(participant.bind));
    if (!(participant.lost_after > 0))
      participant.lost_after =
          stays_here ? std::chrono::duration<double>(lost_after).count() : lost_after_far;
    if (stays_here || result.insecure) continue;
    if (!result.coupler_key.empty() && !participant.public_key.empty()) continue;
    root.problem(
        "",
        fmt::format("'{0}' serves at {1}, which other machines reach: name key files in `hosts.coupler.key` "
                    "and `hosts.{0}.public_key` (`coupler keys` makes them), or say `insecure = true`",
                    participant.role, participant.bind.empty() ? participant.endpoint : participant.bind));
  }
}

void read_windows(SceneTable& coupling, CouplingScene& result) {
  result.window = coupling.number("window", Range::positive());
  result.end_time = coupling.number("end_time", Range::positive());
  if (!(result.window > 0) || !(result.end_time > 0)) return;
  const double count = result.end_time / result.window;
  result.windows = static_cast<std::uint64_t>(std::llround(count));
  if (count > 1e12) {
    coupling.problem("window", fmt::format("{} windows are too many", count));
  } else if (result.windows == 0 || std::abs(count - static_cast<double>(result.windows)) > 1e-6 * count) {
    coupling.problem(
        "end_time",
        fmt::format("{} s is not a whole number of windows of {} s; the nearest that is: {} s",
                    result.end_time, result.window, std::max(1.0, std::round(count)) * result.window));
  }
}

void read_adaptive_window(SceneTable& coupling, CouplingScene& result) {
  result.adaptive_window = coupling.boolean_or("adaptive_window", false);
  result.smallest_window = coupling.number_or("smallest_window", result.window / 64,
                                              {.minimum = 0.0, .maximum = 1e300, .exclusive = true});
  if (coupling.has("smallest_window") && !result.adaptive_window)
    coupling.problem("smallest_window", "has a meaning with adaptive_window = true only");
  if (result.smallest_window > result.window) coupling.problem("smallest_window", "is larger than `window`");
}

void read_scheme(SceneTable& coupling, CouplingScene& result) {
  constexpr std::array<std::string_view, 4> names = {"serial-implicit", "serial-explicit",
                                                     "parallel-implicit", "parallel-explicit"};
  result.scheme = pick(coupling, "scheme", names,
                       std::array{Scheme::serial_implicit, Scheme::serial_explicit, Scheme::parallel_implicit,
                                  Scheme::parallel_explicit});
  if (!result.implicit() && result.mode == CouplingMode::steady) {
    coupling.problem("scheme", "steady mode iterates to the common equilibrium and needs an implicit scheme");
  }
}

void read_acceleration(SceneTable& coupling, CouplingScene& result) {
  constexpr std::array<std::string_view, 5> names = {"aitken", "constant", "iqn-ils", "iqn-imvj", "none"};
  result.acceleration =
      pick(coupling, "acceleration", names,
           std::array{AccelerationKind::aitken, AccelerationKind::constant, AccelerationKind::iqn_ils,
                      AccelerationKind::iqn_imvj, AccelerationKind::none});
  result.relaxation = coupling.number_or("relaxation", 0.5, {.minimum = 1e-6, .maximum = 2.0});
  result.windows_reused = static_cast<int>(coupling.integer_or("time_windows_reused", 8, 0, 1000));
  result.max_used_columns = static_cast<int>(coupling.integer_or("max_used_iterations", 100, 1, 1000));
  constexpr std::array<std::string_view, 4> filters = {"qr2", "qr1", "qr3", "none"};
  result.filter =
      pick(coupling, "filter", filters,
           std::array{ColumnFilter::qr2, ColumnFilter::qr1, ColumnFilter::qr3, ColumnFilter::none});
  result.filter_limit = coupling.number_or("filter_limit", 1e-2, {.minimum = 1e-6, .maximum = 0.9});
  // In a serial scheme displacement and velocity alone are accelerated, in one unit.
  constexpr std::array<std::string_view, 2> preconditioners = {"none", "residual-sum"};
  result.residual_sum = coupling.has("preconditioner")
                            ? coupling.choice("preconditioner", preconditioners) == "residual-sum"
                            : result.parallel();
}

void read_mapping(SceneTable& coupling, CouplingScene& result) {
  auto table = coupling.table_if("mapping");
  if (!table) return;
  // Both spellings: people write the one they are used to.
  constexpr std::array<std::string_view, 6> kinds = {"nearest-projection", "nearest-neighbour",
                                                     "nearest-neighbor",   "thin-plate-spline",
                                                     "wendland-c2",        "wendland-c4"};
  result.mapping.kind = pick(*table, "kind", kinds,
                             std::array{MappingKind::nearest_projection, MappingKind::nearest_neighbour,
                                        MappingKind::nearest_neighbour, MappingKind::thin_plate_spline,
                                        MappingKind::wendland_c2, MappingKind::wendland_c4});
  const bool compact =
      result.mapping.kind == MappingKind::wendland_c2 || result.mapping.kind == MappingKind::wendland_c4;
  if (compact) {
    result.mapping.support_radius = table->number("support_radius", Range::positive());
  } else if (table->has("support_radius")) {
    table->leave_to_others({"support_radius"});
    table->problem("support_radius", "has a meaning for \"wendland-c2\" and \"wendland-c4\" only");
  }
  constexpr std::array<std::string_view, 2> loads = {"forces", "pressures"};
  result.mapped_loads = pick(*table, "loads", loads, std::array{Loads::forces, Loads::pressures});
}

void read_measures(SceneTable& coupling, CouplingScene& result) {
  constexpr Range limits{.minimum = 1e-14, .maximum = 1.0};
  const double tolerance = coupling.number_or("tolerance", 1e-4, limits);
  const double velocity_tolerance =
      coupling.number_or("velocity_tolerance", std::min(1.0, 10 * tolerance), limits);
  result.measures = {{Field::displacement, MeasureKind::relative, tolerance}};
  if (result.mode == CouplingMode::transient)
    result.measures.push_back({Field::velocity, MeasureKind::relative, velocity_tolerance});
  // In a parallel scheme the forces are a part of the iterate: a motion that the solid gave to other forces
  // than the fluid's is no solution, however well it agrees with itself.
  const bool forces_too = result.scheme == Scheme::parallel_implicit;
  if (forces_too || coupling.has("force_tolerance")) {
    result.measures.push_back({Field::force, MeasureKind::relative,
                               coupling.number_or("force_tolerance", std::min(1.0, 10 * tolerance), limits)});
  }
  const auto tables = coupling.tables("convergence");
  if (tables.empty()) return;
  result.measures.clear();
  for (const auto* key : {"tolerance", "velocity_tolerance", "force_tolerance"}) {
    if (coupling.has(key))
      coupling.problem(key, "give either this or [[coupling.convergence]] tables, not both");
  }
  for (SceneTable table : tables) {
    Measure measure;
    constexpr std::array<std::string_view, 3> fields = {"displacement", "velocity", "force"};
    measure.field =
        pick(table, "field", fields, std::array{Field::displacement, Field::velocity, Field::force});
    if (measure.field == Field::velocity && result.mode == CouplingMode::steady)
      table.problem("field", "nothing moves in steady mode");
    constexpr std::array<std::string_view, 3> kinds = {"relative", "absolute", "residual-relative"};
    measure.kind =
        pick(table, "measure", kinds,
             std::array{MeasureKind::relative, MeasureKind::absolute, MeasureKind::residual_relative});
    measure.limit = table.number("limit", Range::positive());
    result.measures.push_back(measure);
  }
  const bool measured = std::any_of(result.measures.begin(), result.measures.end(),
                                    [](const Measure& measure) { return measure.field == Field::force; });
  if (forces_too && !measured)
    coupling.problem(
        "convergence",
        "a parallel scheme iterates on the forces as well: add a measure of the field \"force\"");
}

void read_coupling(SceneTable coupling, CouplingScene& result) {
  constexpr std::array<std::string_view, 2> modes = {"steady", "transient"};
  result.mode =
      coupling.choice("mode", modes) == "transient" ? CouplingMode::transient : CouplingMode::steady;
  if (result.mode == CouplingMode::transient) {
    read_windows(coupling, result);
    read_adaptive_window(coupling, result);
  } else {
    for (const auto* key : {"window", "end_time", "adaptive_window", "smallest_window"}) {
      if (coupling.has(key)) coupling.problem(key, "has no meaning in steady mode");
    }
    coupling.leave_to_others({"window", "end_time", "adaptive_window", "smallest_window"});
  }
  read_scheme(coupling, result);
  read_acceleration(coupling, result);
  read_measures(coupling, result);
  read_mapping(coupling, result);
  constexpr std::array<std::string_view, 3> predictors = {"linear", "none", "quadratic"};
  result.predictor = pick(coupling, "predictor", predictors,
                          std::array{Predictor::linear, Predictor::none, Predictor::quadratic});
  result.min_iterations = static_cast<int>(coupling.integer_or("min_iterations", 1, 1, 100000));
  result.max_iterations = static_cast<int>(coupling.integer_or("max_iterations", 50, 1, 100000));
  if (result.min_iterations > result.max_iterations)
    coupling.problem("min_iterations", "is larger than `max_iterations`");
  constexpr std::array<std::string_view, 2> ends = {"fail", "go-on"};
  result.at_maximum =
      pick(coupling, "at_max_iterations", ends, std::array{AtMaximum::fail, AtMaximum::go_on});
  result.recover = coupling.boolean_or("recover", true);
  result.connect_timeout = coupling.number_or("connect_timeout", 30.0, {.minimum = 0.1, .maximum = 86400});
  result.stall_timeout = coupling.number_or("stall_timeout", 300.0, {.minimum = 1.0, .maximum = 1e7});
}

void read_recovery(SceneTable& root, CouplingScene& result) {
  auto table = root.table_if("recovery");
  if (!table) return;
  RecoveryScene& recovery = result.recovery;
  if (table->has("every")) {
    recovery.every = static_cast<std::uint64_t>(table->integer_or("every", 0, 0, 1'000'000'000));
    if (table->has("every_seconds"))
      table->problem("every_seconds", "give either `every` (windows) or `every_seconds`, not both");
    if (*recovery.every > 0 && result.mode == CouplingMode::steady)
      table->problem("every", "a steady run has one window: it begins again when a participant is lost");
  }
  recovery.every_seconds =
      table->number_or("every_seconds", recovery.every_seconds, {.minimum = 0.0, .maximum = 1e7});
  recovery.keep = static_cast<int>(table->integer_or("keep", 2, 1, 1000));
  recovery.relaunches = static_cast<int>(table->integer_or("relaunches", 3, 0, 1000));
}

void read_watches(SceneTable& root, CouplingScene& result) {
  for (auto& table : root.tables("watch")) {
    WatchScene watch;
    watch.name = table.text("name");
    watch.participant = table.text("participant");
    if (table.has("angular_frequency"))
      watch.angular_frequency = table.number("angular_frequency", Range::positive());
    if (table.has("level")) watch.level = table.number("level", Range::any());
    watch.from_time = table.number_or("from_time", 0.0, Range::not_negative());
    if (table.has("to_time")) {
      watch.to_time = table.number("to_time", Range::positive());
      if (!(watch.to_time > watch.from_time)) table.problem("to_time", "is not later than `from_time`");
    }
    // Where to look is the participant's business.
    table.leave_to_others({"point", "line", "samples", "region", "grain", "wall", "from", "to", "obstacle",
                           "reference_length", "reference_velocity", "exact_velocity", "body", "hold"});
    if (watch.name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") !=
        std::string::npos) {
      table.problem("name", "a watch is named with letters, digits, '_' and '-': it becomes a file name");
    } else if (watch.name == "coupling" || watch.name == "run") {
      table.problem("name", fmt::format("'{}' is reserved for the run's own figures", watch.name));
    }
    for (const auto& other : result.watches) {
      if (other.name == watch.name)
        table.problem("name", fmt::format("a second watch named '{}'", watch.name));
    }
    if (watch.participant == "coupling") {
      if (result.find("solid") == nullptr || result.participants.size() < 2)
        table.problem("participant",
                      "nothing is coupled at a wet surface: the scene has no solid with a partner");
    } else if (!watch.participant.empty() && result.find(watch.participant) == nullptr) {
      table.problem("participant", fmt::format("the scene has no participant '{}'", watch.participant));
    }
    result.watches.push_back(std::move(watch));
  }
}

bool known_quantity(const std::string& quantity, const CouplingScene& scene) {
  const std::size_t dot = quantity.find('.');
  if (dot == std::string::npos) return false;
  const std::string owner = quantity.substr(0, dot);
  if (owner == "coupling" || owner == "run") return true;
  return std::any_of(scene.watches.begin(), scene.watches.end(),
                     [&](const WatchScene& watch) { return watch.name == owner; });
}

void read_checks(SceneTable& root, CouplingScene& result) {
  for (auto& table : root.tables("check")) {
    CheckScene check;
    check.quantity = table.text("quantity");
    check.source = table.text_or("source", "");
    const auto optional_number = [&](const char* key, Range range) {
      return table.has(key) ? std::optional<double>(table.number(key, range)) : std::nullopt;
    };
    check.reference = optional_number("reference", Range::any());
    check.relative_tolerance = optional_number("tolerance", Range::not_negative());
    check.absolute_tolerance = optional_number("absolute_tolerance", Range::not_negative());
    check.at_most = optional_number("at_most", Range::any());
    check.at_least = optional_number("at_least", Range::any());
    const bool compares = check.reference.has_value();
    const bool tolerates = check.relative_tolerance || check.absolute_tolerance;
    if (compares != tolerates || (!compares && !check.at_most && !check.at_least)) {
      table.problem("quantity",
                    "a check needs `reference` with `tolerance` (relative) or `absolute_tolerance`, or "
                    "one of `at_most` and `at_least`");
    }
    if (check.reference == 0.0 && check.relative_tolerance) {
      table.problem("tolerance", "a relative tolerance means nothing around 0; use `absolute_tolerance`");
    }
    if (!check.quantity.empty() && !known_quantity(check.quantity, result)) {
      table.problem("quantity",
                    fmt::format("'{}' is not WATCH.QUANTITY of a [[watch]] of this scene, nor "
                                "coupling.iterations, coupling.total_iterations, run.windows or run.wall_s",
                                check.quantity));
    }
    const std::string last = check.quantity.substr(check.quantity.rfind('.') + 1);
    for (const auto& watch : result.watches) {
      if (!check.quantity.starts_with(watch.name + ".")) continue;
      if ((last == "amplitude" || last == "phase") && !watch.angular_frequency)
        table.problem(
            "quantity",
            fmt::format("the watch '{}' needs `angular_frequency` for an amplitude or phase", watch.name));
      if (last == "time_above" && !watch.level)
        table.problem("quantity",
                      fmt::format("the watch '{}' needs `level` for the time above it", watch.name));
    }
    result.checks.push_back(std::move(check));
  }
}

}  // namespace

const ParticipantScene* CouplingScene::find(std::string_view role) const {
  const auto found =
      std::find_if(participants.begin(), participants.end(),
                   [&](const ParticipantScene& participant) { return participant.role == role; });
  return found == participants.end() ? nullptr : &*found;
}

CouplingScene read_coupling_scene(Scene& scene) {
  CouplingScene result;
  SceneTable root = scene.root();
  result.title = root.text_or("title", scene.name());
  result.dimension = static_cast<int>(root.integer_or("dimension", 2, 2, 3));
  read_participants(root, result);
  read_hosts(root, result);
  read_coupling(root.table("coupling"), result);
  // A steady flow around grains that are held is the one state without time.
  const bool grains_move = result.find("grains") != nullptr &&
                           (result.find("fluid") == nullptr || result.find("solid") != nullptr);
  if (grains_move && result.mode == CouplingMode::steady) {
    root.table("coupling")
        .problem("mode", "grains move in time: use \"transient\" with `window` and `end_time`");
  }
  if (auto output = root.table_if("output")) {
    result.frames = output->boolean_or("frames", true);
    result.record = output->boolean_or("record", false);
    result.frame_interval =
        static_cast<std::uint64_t>(output->integer_or("frame_interval", 0, 0, 1'000'000'000));
  }
  read_recovery(root, result);
  read_watches(root, result);
  read_checks(root, result);
  // Each participant reads its own table and refuses what it does not know there.
  root.leave_to_others({"fluid", "solid", "grains"});
  root.refuse_unknown_keys();
  return result;
}

}  // namespace estuary::coupler
