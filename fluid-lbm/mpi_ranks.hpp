// Ranks over MPI. The program fluid-lbm-mpi alone has it in it.
#pragma once

#include <mpi.h>

#include <string>
#include <vector>

#include "ranks.hpp"

namespace estuary::fluid {

/// One for the life of the process: its constructor initialises MPI, its destructor ends it. One thread, the
/// one that made it, calls.
class MpiRanks : public Ranks {
public:
  MpiRanks(int& argc, char**& argv);
  ~MpiRanks() override;

  [[nodiscard]] int rank() const override { return rank_; }
  [[nodiscard]] int count() const override { return count_; }
  /// Ranks on this machine.
  [[nodiscard]] int count_here() const { return count_here_; }
  /// Ends the processes of all ranks, after a line on what happened.
  [[noreturn]] void end_all(const std::string& why) const;

  void exchange(std::span<const Message> outgoing, std::span<const Message> incoming) override;
  void send(int to, std::span<const std::byte> bytes) override;
  void receive(int from, std::span<std::byte> bytes) override;
  void broadcast(int from, std::span<std::byte> bytes) override;
  void combine(std::span<double> values) override;

private:
  int rank_ = 0;
  int count_ = 1;
  int count_here_ = 1;
  std::vector<MPI_Request> requests_;
};

}  // namespace estuary::fluid
