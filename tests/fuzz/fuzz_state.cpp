// What the coupler goes on from, behind HDF5: any description and any numbers in the arrays of a checkpoint,
// read as the coupler reads them, given to the clock, the measures and the acceleration, which then go on for
// two windows.
//
// Input: kind of the acceleration, length of the unknown, the description up to a 0, then arrays in the order
// in which they are asked for: their length in a byte, then numbers: a byte below 200 is that whole number,
// others are followed by the eight bytes of any.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "acceleration.hpp"
#include "checkpoint.hpp"
#include "convergence.hpp"
#include "coupler_state.hpp"
#include "window_clock.hpp"

namespace {

std::string_view rest;  // of the input

unsigned byte() {
  if (rest.empty()) throw std::runtime_error("there is no more");
  const auto value = static_cast<unsigned char>(rest.front());
  rest.remove_prefix(1);
  return value;
}

double number() {
  constexpr unsigned largest_small = 199;
  const unsigned code = byte();
  if (code <= largest_small) return code;
  if (rest.size() < sizeof(double)) throw std::runtime_error("there is no more");
  double value = 0;
  std::memcpy(&value, rest.data(), sizeof value);
  rest.remove_prefix(sizeof value);
  return value;
}

}  // namespace

// In the place of the one that reads HDF5, which promises the same: whatever length, and finite.
namespace estuary {
// Nothing is written here.
CheckpointWriter::CheckpointWriter(std::filesystem::path /*file*/) {
  std::abort();
}
CheckpointWriter::~CheckpointWriter() = default;
void CheckpointWriter::add(const std::string& /*name*/, std::span<const double> /*values*/) {}
void CheckpointWriter::add_bytes(const std::string& /*name*/, std::string_view /*bytes*/) {}
void CheckpointWriter::commit() {}

CheckpointReader::CheckpointReader(const std::filesystem::path& /*file*/) {}
CheckpointReader::~CheckpointReader() = default;
std::string CheckpointReader::read_bytes(const std::string& /*name*/) const {
  const auto end = std::min(rest.find('\0'), rest.size());
  std::string bytes(rest.substr(0, end));
  rest.remove_prefix(std::min(end + 1, rest.size()));
  return bytes;
}
std::vector<double> CheckpointReader::read_all(const std::string& /*name*/) const {
  std::vector<double> values(byte());
  for (double& value : values) {
    value = number();
    if (!std::isfinite(value)) throw std::runtime_error("is not finite");
  }
  return values;
}
}  // namespace estuary

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace estuary::coupler;
  static const std::filesystem::path file = "state";
  rest = {reinterpret_cast<const char*>(data), size};
  try {
    const unsigned kind = byte();
    const std::size_t length = 1 + byte() % 8;
    const CouplerState state = read_coupler_state(file);
    const auto take = [](const std::vector<double>& values, auto& object) {
      StateReader reader(values);
      object.load(reader);
      reader.require_end();
    };
    WindowClock clock(0.5, 10);
    if (kind >= 128) clock.allow_shorter(0.1, 0.05);
    take(state.clock, clock);
    const CouplingScene scene;
    Convergence convergence(scene, 1.0);
    take(state.convergence, convergence);
    AccelerationSettings settings{.kind = static_cast<AccelerationKind>(kind % 5)};
    settings.windows_reused = kind / 5 % 4;
    settings.most_columns = 6;
    settings.filter = static_cast<ColumnFilter>(kind / 20 % 4);
    if (kind >= 128 && length > 1) settings.fields = {1, length - 1};
    const auto acceleration = make_acceleration(settings);
    take(state.acceleration, *acceleration);
    std::vector<double> iterate(length), residual(length);
    for (int window = 0; window < 2; ++window) {
      if (!clock.at_end() && clock.span().duration < 0) std::abort();
      acceleration->begin_window();
      convergence.begin_window();
      for (int iteration = 0; iteration < 3; ++iteration) {
        for (std::size_t i = 0; i < length; ++i)
          residual[i] = 0.1 * static_cast<double>(i + 1) - 0.5 * iterate[i];
        acceleration->update(residual, iterate);
        if (iterate.size() != length) std::abort();
        (void)convergence.judge({.displacement_increment = std::abs(residual[0]), .displacement = 1},
                                static_cast<std::uint64_t>(iteration) + 1);
      }
      clock.accept();
    }
  } catch (const std::runtime_error&) {
  }
  return 0;
}
