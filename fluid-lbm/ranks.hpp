// The processes that share a lattice, as the solver sees them: how values get from one to the others.
//
// All ranks carry out the same requests and know the whole geometry; each holds the populations of a slab of
// layers (grid.hpp). So every rank comes to every call here in the same order. A lattice that one process
// holds has no Ranks (a null pointer), and nothing of this happens.
//
// Results have to be those of one process, to the last bit. Values are therefore never added up in an order
// that depends on the ranks: they are shared as they are (`share`), or sums go from rank to rank and each
// adds its layers' in the order of the layers (`in_turn`).
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <new>
#include <span>
#include <type_traits>
#include <vector>

namespace estuary::fluid {

/// Known to all ranks, unlike memory that ends on one of them later.
struct LackOfMemory : std::bad_alloc {};

class Ranks {
public:
  Ranks() = default;
  Ranks(const Ranks&) = delete;
  Ranks& operator=(const Ranks&) = delete;
  Ranks(Ranks&&) = delete;
  Ranks& operator=(Ranks&&) = delete;
  virtual ~Ranks() = default;

  [[nodiscard]] virtual int rank() const = 0;
  [[nodiscard]] virtual int count() const = 0;

  /// Between this rank and another; messages of one pair are told apart by `tag`.
  struct Message {
    int partner = 0;
    int tag = 0;
    std::span<std::byte> bytes;
  };
  /// Sends and receives all of them at once.
  virtual void exchange(std::span<const Message> outgoing, std::span<const Message> incoming) = 0;
  virtual void send(int to, std::span<const std::byte> bytes) = 0;
  virtual void receive(int from, std::span<std::byte> bytes) = 0;
  virtual void broadcast(int from, std::span<std::byte> bytes) = 0;
  /// Gives every rank the bitwise or of all ranks' values, taken as words of 64 bits.
  virtual void combine(std::span<double> values) = 0;
  /// Whether any rank says so; returns on all of them once the last has come here.
  [[nodiscard]] bool any(bool here) {
    double word = std::bit_cast<double>(std::uint64_t{here ? 1U : 0U});
    combine({&word, 1});
    return std::bit_cast<std::uint64_t>(word) != 0;
  }
};

/// Values that one rank each knows, the others having +0 there: every rank gets all, bit for bit.
inline void share(Ranks* ranks, std::span<double> values) {
  if (ranks != nullptr && !values.empty()) ranks->combine(values);
}

/// Calls `add_own(sums)` on one rank after the other, each going on with the sums of the rank before, so that
/// what is added layer by layer is added in the order of the layers. All ranks get the result.
template <class Sums, class AddOwn>
void in_turn(Ranks* ranks, Sums& sums, const AddOwn& add_own) {
  static_assert(std::is_trivially_copyable_v<Sums>);
  if (ranks == nullptr) {
    add_own(sums);
    return;
  }
  const std::span<std::byte> bytes(reinterpret_cast<std::byte*>(&sums), sizeof sums);
  if (ranks->rank() > 0) ranks->receive(ranks->rank() - 1, bytes);
  add_own(sums);
  if (ranks->rank() + 1 < ranks->count()) ranks->send(ranks->rank() + 1, bytes);
  ranks->broadcast(ranks->count() - 1, bytes);
}

/// Rank 0's value on all ranks: what depends on its clock, or on the coupler that it alone hears.
template <class Value>
[[nodiscard]] Value as_first_rank(Ranks* ranks, Value value) {
  static_assert(std::is_trivially_copyable_v<Value>);
  if (ranks != nullptr) ranks->broadcast(0, {reinterpret_cast<std::byte*>(&value), sizeof value});
  return value;
}

/// Rank 0's values on all ranks, however many there are.
inline void broadcast_values(Ranks* ranks, std::vector<double>& values) {
  if (ranks == nullptr) return;
  values.resize(as_first_rank(ranks, values.size()));
  if (!values.empty()) ranks->broadcast(0, std::as_writable_bytes(std::span(values)));
}

}  // namespace estuary::fluid
