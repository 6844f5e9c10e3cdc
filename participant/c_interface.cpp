// The C interface turns a participant inside out: the solver's own loop calls, and a thread that serves the
// coupler waits for it. They take turns; what they share is touched by whoever's turn it is.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <condition_variable>
#include <cstdlib>
#include <cstring>
#include <map>
#include <thread>

#include "estuary.h"
#include "participant.hpp"
#include "serve.hpp"
#include "wet_surface.hpp"

namespace {

using namespace estuary;

// How often a wait for the solver looks whether it was told to stop.
constexpr std::chrono::milliseconds look_round{50};

enum class Turn {
  coupler,    // the serving thread's
  configure,  // the solver reads keys and sets vertices
  compute,    // the solver computes a step
  over        // nobody serves any more
};

struct Field {
  int components = 0;
  std::vector<double> values;  // at the end of the window
  std::vector<double> start;   // accepted
};

// Everything the two threads share.
struct Shared {
  mutable std::mutex mutex;
  std::condition_variable changed;
  Turn turn = Turn::coupler;
  std::string role;
  std::string name;
  int status = 0;  // of serve()
  bool check_only = false;
  bool initialized = false;
  bool ongoing = true;

  SceneTable* table = nullptr;            // during Turn::configure
  std::map<std::string, double> numbers;  // keys read, with their fallback
  std::map<std::string, double> values;   // what they were

  v1::WetSurface surface;
  std::map<std::string, Field, std::less<>> inputs, outputs;
  std::optional<std::string> failure;
  std::string advice;

  bool steady = false;
  bool repeats = false;  // windows may be repeated
  bool write_checkpoint = false;
  bool read_checkpoint = false;
  double duration = 0;
  double elapsed = 0;

  void give(Turn to) {
    turn = to;
    changed.notify_all();
  }
};

class Handover final : public Participant {
public:
  explicit Handover(Shared& shared) : shared_(shared) {}

  Identity identity() const override {
    return {.name = shared_.name,
            .version = ESTUARY_VERSION,
            .roles = {shared_.role},
            .capabilities = {"steady", "transient", "wet-surface", "viscous-traction", "rewind"},
            .dimensions = {2}};
  }

  Plan configure(Scene& scene, const std::string& role) override {
    SceneTable root = scene.root();
    SceneTable table = root.table(role);
    table.leave_to_others({"solver", "connect", "threads"});
    std::unique_lock lock(shared_.mutex);
    if (auto coupling = root.table_if("coupling")) {
      shared_.steady = coupling->text_or("mode", "steady") != "transient";
      shared_.repeats =
          !shared_.steady && coupling->text_or("scheme", "serial-implicit").ends_with("implicit");
    }
    if (shared_.initialized) {
      // The program read its keys from an earlier Configure and does not come back to them.
      for (const auto& [key, fallback] : shared_.numbers)
        if (table.number_or(key, fallback) != shared_.values[key])
          table.problem(key, "the program has read another value already");
    } else {
      shared_.table = &table;
      shared_.give(Turn::configure);
      shared_.changed.wait(lock, [&] { return shared_.turn != Turn::configure; });
      shared_.table = nullptr;
      shared_.initialized = true;
      if (shared_.surface.connectivity().empty())
        table.problem("", "the program sets no vertices and edges, so nothing can be coupled");
    }
    table.refuse_unknown_keys();
    return {.derived = {{"vertices", std::to_string(shared_.surface.reference_positions_size() / 2)}},
            .warnings = {},
            .left_out = {},
            .memory_bytes = 0,
            .expected_updates = 0,
            .variant = {}};
  }

  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& /*folder*/) override {
    if (initial.has_wet_surface()) check_wet_surface(initial.wet_surface());
    const std::lock_guard lock(shared_.mutex);
    v1::Exchange brought;
    *brought.mutable_wet_surface() = shared_.surface;
    if (shared_.role == "solid") {
      take_start("Displacement");
      take_start("Velocity");
      fill(*brought.mutable_displacements());
    }
    return brought;
  }

  std::optional<double> window_step() const override { return 0.0; }

  AdvanceResult advance(const Window& window, const v1::Exchange& received,
                        ProgressBoard& progress) override {
    std::unique_lock lock(shared_.mutex);
    if (window.iteration > 1 && window.mode == Mode::transient && !shared_.repeats)
      throw BadInput("header.iteration", "a window is repeated although the scene's scheme is explicit");
    take_inputs(received);
    shared_.steady = window.mode == Mode::steady;
    shared_.duration = window.duration;
    shared_.elapsed = 0;
    // An Advance that failed on its way leaves the solver inside the window as well.
    shared_.read_checkpoint = touched_ && !shared_.steady;
    shared_.write_checkpoint = !touched_ && shared_.repeats;
    touched_ = true;
    shared_.failure.reset();
    shared_.give(Turn::compute);
    while (!shared_.changed.wait_for(lock, look_round, [&] { return shared_.turn != Turn::compute; })) {
      if (!progress.stop_requested()) continue;
      shared_.ongoing = false;
      throw Interrupted();
    }
    progress.report(1.0);
    if (shared_.failure) throw Diverged("", *shared_.failure, shared_.advice);
    AdvanceResult result;
    result.work.steps = ++steps_;
    if (shared_.role == "solid") {
      fill(*result.outputs.mutable_displacements());
    } else {
      auto& pressures = *result.outputs.mutable_pressures();
      pressures.set_surface(shared_.surface.identity());
      assign(*pressures.mutable_pressure(), "Pressure");
      if (const auto& traction = shared_.outputs["ViscousTraction"].values; !traction.empty())
        assign(*pressures.mutable_viscous_traction(), "ViscousTraction");
    }
    return result;
  }

  void accept() override {
    const std::lock_guard lock(shared_.mutex);
    for (auto* fields : {&shared_.inputs, &shared_.outputs})
      for (auto& [name, field] : *fields) field.start = field.values;
    touched_ = false;
  }

  void save(const std::filesystem::path& /*file*/) override {
    throw std::runtime_error("participants of the C interface keep no checkpoints");
  }
  void load(const std::filesystem::path& /*file*/) override {
    throw std::runtime_error("participants of the C interface keep no checkpoints");
  }
  std::vector<std::string> frame(std::uint64_t /*number*/, double /*time*/) override { return {}; }
  void stop() override {
    const std::lock_guard lock(shared_.mutex);
    shared_.ongoing = false;
  }

private:
  void take_start(const char* name) {
    Field& field = shared_.outputs[name];
    if (!field.values.empty()) field.start = field.values;
  }
  void assign(google::protobuf::RepeatedField<double>& to, const char* name) {
    const std::vector<double>& values = shared_.outputs[name].values;
    to.Assign(values.begin(), values.end());
  }
  void fill(v1::Displacements& field) {
    field.set_surface(shared_.surface.identity());
    const int size = shared_.surface.reference_positions_size();
    const auto& displacement = shared_.outputs["Displacement"];
    const auto& velocity = shared_.outputs["Velocity"];
    field.mutable_displacement()->Resize(size, 0.0);
    field.mutable_velocity()->Resize(size, 0.0);
    for (int i = 0; i < size; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (!displacement.values.empty()) field.set_displacement(i, displacement.values[k]);
      if (!velocity.values.empty()) {
        field.set_velocity(i, velocity.values[k]);
      } else if (!shared_.steady && shared_.duration > 0 && !displacement.values.empty()) {
        const double before = displacement.start.empty() ? 0.0 : displacement.start[k];
        field.set_velocity(i, (displacement.values[k] - before) / shared_.duration);
      }
    }
  }
  void take(const char* name, const google::protobuf::RepeatedField<double>& values) {
    Field& field = shared_.inputs[name];
    field.values.assign(values.begin(), values.end());
  }
  void take_inputs(const v1::Exchange& received) {
    try {
      if (shared_.role == "solid") {
        check_forces(received.forces(), shared_.surface);
        take("Force", received.forces().force());
      } else {
        check_displacements(received.displacements(), shared_.surface);
        take("Displacement", received.displacements().displacement());
        take("Velocity", received.displacements().velocity());
      }
    } catch (const std::invalid_argument& error) {
      throw BadInput("inputs", error.what());
    }
  }

  Shared& shared_;
  bool touched_ = false;  // the window was computed, and not accepted
  std::uint64_t steps_ = 0;
};

std::uint64_t identity_of(const Shared& shared) {
  std::uint64_t hash = 1469598103934665603ULL;
  const auto mix = [&](std::uint64_t bits) { hash = (hash ^ bits) * 1099511628211ULL; };
  for (const char letter : shared.role + shared.name) mix(static_cast<std::uint64_t>(letter));
  for (const double x : shared.surface.reference_positions()) {
    std::uint64_t bits = 0;
    std::memcpy(&bits, &x, sizeof bits);
    mix(bits);
  }
  return hash;
}

}  // namespace

struct estuary_participant {
  Shared shared;
  std::thread server;
  std::string error;

  // Waits for the solver's turn.
  void wait() {
    std::unique_lock lock(shared.mutex);
    shared.changed.wait(lock, [&] { return shared.turn != Turn::coupler || !shared.ongoing; });
    if (shared.turn == Turn::over) shared.ongoing = false;
  }
  int fail(std::string message) {
    error = std::move(message);
    return -1;
  }
  int well() {
    error.clear();
    return 0;
  }
  [[noreturn]] void end_process() {
    server.join();
    std::exit(shared.status);
  }
  std::size_t vertices() const {
    return static_cast<std::size_t>(shared.surface.reference_positions_size()) / 2;
  }
};

estuary_participant* estuary_create(int argc, char** argv, const char* name, const char* role) {
  auto* p = new estuary_participant;
  p->shared.name = name;
  p->shared.role = role;
  p->shared.outputs = {{"Displacement", {2, {}, {}}},
                       {"Velocity", {2, {}, {}}},
                       {"Pressure", {1, {}, {}}},
                       {"ViscousTraction", {2, {}, {}}}};
  if (p->shared.role != "solid" && p->shared.role != "fluid") {
    fmt::print(stderr, "estuary_create: the role is \"solid\" or \"fluid\", not \"{}\"\n", role);
    std::exit(2);
  }
  for (int i = 1; i < argc; ++i) p->shared.check_only |= std::string_view(argv[i]) == "--check";
  p->server = std::thread([p, argc, argv] {
    const int status = serve(argc, argv, std::make_unique<Handover>(p->shared));
    const std::lock_guard lock(p->shared.mutex);
    p->shared.status = status;
    p->shared.give(Turn::over);
  });
  p->wait();
  if (p->shared.turn == Turn::over) p->end_process();
  return p;
}

double estuary_number(estuary_participant* p, const char* key, double fallback) {
  if (p->shared.table == nullptr) {
    (void)p->fail("keys of the scene are read between estuary_create and estuary_initialize");
    return fallback;
  }
  p->well();
  p->shared.numbers[key] = fallback;
  return p->shared.values[key] = p->shared.table->number_or(key, fallback);
}

int estuary_set_vertices(estuary_participant* p, size_t count, const double* positions) {
  if (p->shared.table == nullptr) return p->fail("vertices are set before estuary_initialize");
  if (count < 2) return p->fail("a wet surface has at least two vertices");
  p->shared.surface.set_dimension(2);
  p->shared.surface.mutable_reference_positions()->Assign(positions, positions + 2 * count);
  return p->well();
}

int estuary_set_edges(estuary_participant* p, size_t count, const int* ends) {
  if (p->shared.table == nullptr) return p->fail("edges are set before estuary_initialize");
  auto& surface = p->shared.surface;
  surface.clear_connectivity();
  std::vector<int> met(p->vertices(), 0);
  for (std::size_t k = 0; k < 2 * count; ++k) {
    if (ends[k] < 0 || static_cast<std::size_t>(ends[k]) >= met.size())
      return p->fail(
          fmt::format("edge {} has the end {}, there are {} vertices", k / 2, ends[k], met.size()));
    ++met[static_cast<std::size_t>(ends[k])];
    surface.add_connectivity(static_cast<std::uint32_t>(ends[k]));
  }
  surface.set_closed(std::all_of(met.begin(), met.end(), [](int times) { return times == 2; }));
  surface.set_identity(identity_of(p->shared));
  try {
    check_wet_surface(surface);
  } catch (const std::invalid_argument& error) {
    return p->fail(error.what());
  }
  return p->well();
}

int estuary_initialize(estuary_participant* p) {
  {
    const std::lock_guard lock(p->shared.mutex);
    if (p->shared.turn != Turn::configure) return p->fail("estuary_initialize is called once");
    p->shared.give(Turn::coupler);
  }
  p->wait();
  if (p->shared.turn == Turn::over && p->shared.check_only) p->end_process();
  return p->shared.ongoing ? p->well() : p->fail("the run ended before its first window; the log says why");
}

int estuary_is_coupling_ongoing(const estuary_participant* p) {
  const std::lock_guard lock(p->shared.mutex);
  return p->shared.ongoing ? 1 : 0;
}

double estuary_max_time_step(const estuary_participant* p) {
  return p->shared.steady ? 0.0 : p->shared.duration - p->shared.elapsed;
}

int estuary_requires_writing_checkpoint(estuary_participant* p) {
  return std::exchange(p->shared.write_checkpoint, false) ? 1 : 0;
}

int estuary_requires_reading_checkpoint(estuary_participant* p) {
  return std::exchange(p->shared.read_checkpoint, false) ? 1 : 0;
}

int estuary_read(estuary_participant* p, const char* name, double relative_time, double* values) {
  const auto found = p->shared.inputs.find(name);
  if (found == p->shared.inputs.end())
    return p->fail(fmt::format("a {} reads no field \"{}\"", p->shared.role, name));
  const Field& field = found->second;
  const double time = p->shared.elapsed + relative_time;
  if (!(time >= 0) || time > p->shared.duration * (1 + 1e-9))
    return p->fail(fmt::format("{} s from now is outside of the window", relative_time));
  const double share =
      p->shared.steady || !(p->shared.duration > 0) ? 1.0 : std::min(1.0, time / p->shared.duration);
  for (std::size_t k = 0; k < field.values.size(); ++k) {
    const double start = field.start.empty() ? field.values[k] : field.start[k];
    values[k] = share == 1.0 ? field.values[k] : start + share * (field.values[k] - start);
  }
  return p->well();
}

int estuary_write(estuary_participant* p, const char* name, const double* values) {
  const auto found = p->shared.outputs.find(name);
  const bool of_solid = std::strcmp(name, "Displacement") == 0 || std::strcmp(name, "Velocity") == 0;
  if (found == p->shared.outputs.end() || of_solid != (p->shared.role == "solid"))
    return p->fail(fmt::format("a {} writes no field \"{}\"", p->shared.role, name));
  const std::size_t size = static_cast<std::size_t>(found->second.components) * p->vertices();
  found->second.values.assign(values, values + size);
  return p->well();
}

int estuary_advance(estuary_participant* p, double dt) {
  Shared& shared = p->shared;
  {
    const std::lock_guard lock(shared.mutex);
    if (!shared.ongoing || shared.turn != Turn::compute)
      return p->fail("nothing is to be computed: the run is over");
    if (shared.write_checkpoint || shared.read_checkpoint)
      shared.failure = fmt::format("{} repeats windows, and never asked estuary_requires_{}_checkpoint",
                                   shared.name, shared.write_checkpoint ? "writing" : "reading");
    if (!shared.steady) {
      const double left = shared.duration - shared.elapsed;
      if (!(dt > 0) || dt > left * (1 + 1e-9))
        return p->fail(fmt::format("a step of {} s, with {} s of the window left", dt, left));
      shared.elapsed += dt;
      if (shared.duration - shared.elapsed > 1e-12 * shared.duration && !shared.failure) return p->well();
    }
    const char* needed = shared.role == "solid" ? "Displacement" : "Pressure";
    if (shared.outputs[needed].values.empty())
      shared.failure = fmt::format("{} wrote no \"{}\"", shared.name, needed);
    shared.give(Turn::coupler);
  }
  p->wait();
  return p->well();
}

int estuary_diverged(estuary_participant* p, const char* what, const char* advice) {
  {
    const std::lock_guard lock(p->shared.mutex);
    if (p->shared.turn != Turn::compute) return p->fail("nothing is being computed");
    p->shared.failure = what;
    p->shared.advice = advice;
    p->shared.give(Turn::coupler);
  }
  p->wait();
  return p->well();
}

int estuary_finalize(estuary_participant* p) {
  {
    // A solver that ends before the run does: the coupler is told at its next request.
    const std::lock_guard lock(p->shared.mutex);
    if (p->shared.ongoing && p->shared.turn == Turn::compute) {
      p->shared.failure = "the program ended before the run did";
      p->shared.give(Turn::coupler);
    }
  }
  p->server.join();
  const int status = p->shared.status;
  delete p;
  return status == 0 ? 0 : -1;
}

const char* estuary_error(const estuary_participant* p) {
  return p->error.c_str();
}
