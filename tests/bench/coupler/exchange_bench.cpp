// What one exchange costs: a request with the wet surface's motion to a participant process and its reply
// with the load, everything included (Protocol Buffers both ways, two threads in the participant, checks),
// beside a bare echo of as many bytes over the same kind of socket in the same run; and one whole coupling
// iteration: motion to a fluid, its pressures to nodal forces, these to a solid, its answer to IQN-ILS with
// the columns of eight windows of four iterations. Medians over the repetitions are what to quote
// (--benchmark_repetitions=9).
#include <benchmark/benchmark.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "interface_state.hpp"
#include "participants.hpp"
#include "partners.hpp"
#include "quasi_newton.hpp"

namespace {

using namespace estuary;
using namespace estuary::coupler;

class RunFolder {
public:
  RunFolder() {
    std::string name = (std::filesystem::temp_directory_path() / "estuary-bench-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
    std::filesystem::create_directories(path_ / "log");
  }
  ~RunFolder() { std::filesystem::remove_all(path_); }
  const std::filesystem::path& path() const { return path_; }

private:
  std::filesystem::path path_;
};

v1::Displacements motion(int nodes) {
  v1::Displacements message;
  message.set_surface(77);
  message.mutable_displacement()->Resize(2 * nodes, 0.1);
  message.mutable_velocity()->Resize(2 * nodes, 0.2);
  return message;
}

void exchange_with_a_process(benchmark::State& state) {
  const int nodes = static_cast<int>(state.range(0));
  const RunFolder folder;
  CouplingScene scene;
  scene.participants.push_back(
      {.role = "fluid", .command = {LINEAR_PARTICIPANT}, .endpoint = {}, .threads = 1});
  const std::atomic<int> interrupts{0};
  Participants participants(scene, folder.path(), false, interrupts, {});
  RemoteParticipant& fluid = *participants.find("fluid");
  v1::Request configure;
  configure.mutable_configure()->set_role("fluid");
  configure.mutable_configure()->set_scene("[fluid]\npressure = 1.0\nslope = 0.5\n");
  participants.ask(fluid, configure, {});
  v1::Request start;
  auto& surface = *start.mutable_start()->mutable_initial()->mutable_wet_surface();
  surface.set_identity(77);
  surface.set_dimension(2);
  for (std::uint32_t i = 0; i < static_cast<std::uint32_t>(nodes); ++i) {
    surface.add_reference_positions(i);
    surface.add_reference_positions(0);
    if (i == 0) continue;
    surface.add_connectivity(i - 1);
    surface.add_connectivity(i);
  }
  participants.ask(fluid, start, {});
  v1::Request advance;
  advance.mutable_advance()->set_duration(1.0);
  *advance.mutable_advance()->mutable_inputs()->mutable_displacements() = motion(nodes);
  Position position{.window = 1, .iteration = 0};
  for (auto step : state) {
    ++position.iteration;
    benchmark::DoNotOptimize(participants.ask(fluid, advance, position));
  }
  state.counters["bytes"] =
      static_cast<double>(fluid.channel().bytes_sent() + fluid.channel().bytes_received()) /
      static_cast<double>(state.iterations());
  participants.stop(1.0);
}

// Both solvers answer at once, so this is what the coupler and the messages cost.
void whole_iteration(benchmark::State& state) {
  const auto nodes = static_cast<std::size_t>(state.range(0));
  const RunFolder folder;
  CouplingScene scene;
  scene.mode = CouplingMode::transient;
  scene.window = 0.1;
  for (const char* role : {"fluid", "solid"})
    scene.participants.push_back(
        {.role = role, .command = {LINEAR_PARTICIPANT}, .endpoint = {}, .threads = 1});
  const std::atomic<int> interrupts{0};
  Participants participants(scene, folder.path(), false, interrupts, {});
  for (const auto& participant : participants.all()) {
    v1::Request configure;
    configure.mutable_configure()->set_role(participant->role());
    configure.mutable_configure()->set_scene(
        "[fluid]\npressure = 1.0\nslope = 0.5\n[solid]\nstiffness = 1.0\nnodes = " + std::to_string(nodes) +
        "\n");
    participants.ask(*participant, configure, {});
  }
  Partners partners(scene, participants);
  partners.start();
  const auto acceleration = make_acceleration(
      {.kind = AccelerationKind::iqn_ils, .windows_reused = 8, .filter_limit = 1e-6, .fields = {}});
  InterfaceState x = partners.initial();
  AccelerationVectors vectors;
  Position position{.window = 0, .iteration = 4};
  std::uint64_t number = 1;
  for (auto step : state) {
    if (position.iteration == 4) {
      position = {.window = position.window + 1, .iteration = 0};
      acceleration->begin_window();
    }
    ++position.iteration;
    IterationRow row;
    InterfaceState answer = partners.answer(x, {.begin = 0, .duration = scene.window}, position, row);
    // Independent columns, as surfaces with many degrees of freedom give them.
    for (std::size_t k = 1; k < answer.motion.displacement.size(); k += 2) {
      number = number * 6364136223846793005U + 1442695040888963407U;
      answer.motion.displacement[k] += 1e-3 * (static_cast<double>(number >> 33U) / 2147483648.0 - 1);
    }
    accelerate(*acceleration, x, answer, scene.window, true, false, vectors);
  }
  state.counters["columns"] = static_cast<double>(dynamic_cast<QuasiNewton&>(*acceleration).columns());
  participants.stop(1.0);
}

void bare_echo(benchmark::State& state) {
  const int nodes = static_cast<int>(state.range(0));
  const RunFolder folder;
  ServerChannel server("ipc://" + (folder.path() / "echo").string(), false);
  std::atomic<bool> stop{false};
  std::thread echo([&] {
    v1::Reply reply;
    reply.mutable_advanced()->mutable_outputs()->mutable_pressures()->mutable_pressure()->Resize(nodes, 1.0);
    while (!stop) {
      if (const auto incoming = server.receive(std::chrono::milliseconds(100)))
        (void)server.send(incoming->client, reply);
    }
  });
  ClientChannel client(server.bound_endpoint());
  v1::Request request;
  *request.mutable_advance()->mutable_inputs()->mutable_displacements() = motion(nodes);
  for (auto step : state) {
    client.send(request);
    benchmark::DoNotOptimize(client.receive(std::chrono::milliseconds(5000)));
  }
  stop = true;
  echo.join();
}

BENCHMARK(exchange_with_a_process)
    ->Arg(100)
    ->Arg(1000)
    ->Arg(10000)
    ->UseRealTime()
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(whole_iteration)->Arg(1000)->Arg(10000)->UseRealTime()->Unit(benchmark::kMicrosecond);
BENCHMARK(bare_echo)->Arg(100)->Arg(1000)->Arg(10000)->UseRealTime()->Unit(benchmark::kMicrosecond);

}  // namespace
