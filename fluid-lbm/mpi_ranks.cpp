#include "mpi_ranks.hpp"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>

namespace estuary::fluid {
namespace {

// Counts of MPI are ints.
constexpr std::size_t most_at_once = std::size_t{1} << 30;

template <class Bytes, class Pass>
void in_pieces(const Bytes& bytes, const Pass& pass) {
  for (std::size_t begin = 0; begin < bytes.size(); begin += most_at_once) {
    const std::size_t size = std::min(most_at_once, bytes.size() - begin);
    pass(bytes.data() + begin, static_cast<int>(size));
  }
}

std::string host_name() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "?";
  return name.data();
}

}  // namespace

MpiRanks::MpiRanks(int& argc, char**& argv) {
  // Another thread answers the coupler, but only one knows of MPI.
  int provided = MPI_THREAD_SINGLE;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
  MPI_Comm_size(MPI_COMM_WORLD, &count_);
  MPI_Comm here = MPI_COMM_NULL;
  MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &here);
  MPI_Comm_size(here, &count_here_);
  MPI_Comm_free(&here);
  if (provided < MPI_THREAD_FUNNELED) end_all("this MPI cannot run in a process with several threads");
}

MpiRanks::~MpiRanks() {
  MPI_Finalize();
}

void MpiRanks::end_all(const std::string& why) const {
  std::fprintf(stderr, "rank %d of %d on %s: %s\n", rank_, count_, host_name().c_str(), why.c_str());
  std::fflush(stderr);
  MPI_Abort(MPI_COMM_WORLD, 1);
  std::abort();
}

void MpiRanks::exchange(std::span<const Message> outgoing, std::span<const Message> incoming) {
  requests_.clear();
  for (const Message& message : incoming)
    in_pieces(message.bytes, [&](std::byte* at, int size) {
      MPI_Irecv(at, size, MPI_BYTE, message.partner, message.tag, MPI_COMM_WORLD, &requests_.emplace_back());
    });
  for (const Message& message : outgoing)
    in_pieces(message.bytes, [&](std::byte* at, int size) {
      MPI_Isend(at, size, MPI_BYTE, message.partner, message.tag, MPI_COMM_WORLD, &requests_.emplace_back());
    });
  MPI_Waitall(static_cast<int>(requests_.size()), requests_.data(), MPI_STATUSES_IGNORE);
}

void MpiRanks::send(int to, std::span<const std::byte> bytes) {
  in_pieces(bytes,
            [&](const std::byte* at, int size) { MPI_Send(at, size, MPI_BYTE, to, 2, MPI_COMM_WORLD); });
}

void MpiRanks::receive(int from, std::span<std::byte> bytes) {
  in_pieces(bytes, [&](std::byte* at, int size) {
    MPI_Recv(at, size, MPI_BYTE, from, 2, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  });
}

void MpiRanks::broadcast(int from, std::span<std::byte> bytes) {
  in_pieces(bytes, [&](std::byte* at, int size) { MPI_Bcast(at, size, MPI_BYTE, from, MPI_COMM_WORLD); });
}

void MpiRanks::combine(std::span<double> values) {
  static_assert(sizeof(double) == sizeof(std::uint64_t));
  for (std::size_t begin = 0; begin < values.size(); begin += most_at_once / sizeof(double)) {
    const std::size_t size = std::min(most_at_once / sizeof(double), values.size() - begin);
    MPI_Allreduce(MPI_IN_PLACE, values.data() + begin, static_cast<int>(size), MPI_UINT64_T, MPI_BOR,
                  MPI_COMM_WORLD);
  }
}

}  // namespace estuary::fluid
