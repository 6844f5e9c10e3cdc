// What one exchange costs: a request with the wet surface's motion to a participant process and its reply
// with the load, everything included (Protocol Buffers both ways, two threads in the participant, checks),
// beside a bare echo of as many bytes over the same kind of socket in the same run. Medians over the
// repetitions are what to quote.
#include <benchmark/benchmark.h>

#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <thread>

#include "participants.hpp"

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
BENCHMARK(bare_echo)->Arg(100)->Arg(1000)->Arg(10000)->UseRealTime()->Unit(benchmark::kMicrosecond);

}  // namespace
