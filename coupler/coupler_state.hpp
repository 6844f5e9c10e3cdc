// What the coupler itself needs to go on between two windows, bit for bit, and its file.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "interface_state.hpp"
#include "run_record.hpp"

namespace estuary::coupler {

struct CouplerState {
  std::uint64_t window = 0;  // the last accepted
  double time = 0;           // its end [s]
  std::uint64_t total_iterations = 0;
  std::uint64_t frame = 0;  // number of the next
  std::uint64_t care = 0;   // with which the acceleration was made
  InterfaceHistory history;
  std::vector<double> clock, convergence, acceleration;  // as StateWriter wrote them
  std::map<std::string, std::string> messages;           // of the partners, serialised
  RecordPosition record;                                 // of the tables
  std::map<std::string, std::uint64_t> messages_record;  // of the records for a replay, by participant
  double wall_s = 0;                                     // of the run up to here
};

/// HDF5, put in place at once. Both throw std::runtime_error naming the file.
void write_coupler_state(const std::filesystem::path& file, const CouplerState& state);
[[nodiscard]] CouplerState read_coupler_state(const std::filesystem::path& file);

}  // namespace estuary::coupler
