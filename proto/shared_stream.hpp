// Two byte streams between two processes of one machine, one each way, through memory that both have mapped:
// a ring with one writer and one reader for either direction. No call into the system on the way of a byte.
//
// The other process may be faulty: what is read from the memory is copied out before anything is made of it,
// each end keeps its own counters for itself and believes the other's only within the ring's size, and the
// memory can be neither shrunk nor grown by anyone (seals of memfd_create(2)).
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>

namespace estuary {

/// One of the two ends. One thread only.
class SharedStream {
public:
  /// Bytes that can be under way in one direction.
  static constexpr std::size_t capacity = std::size_t{512} * 1024;

  /// Makes the memory. `processor_to_spare`: while any of the processes computes there is a processor that it
  /// does not use, so that somebody awake is not in its way. Nothing where the system gives no memory.
  [[nodiscard]] static std::optional<SharedStream> create(bool processor_to_spare);
  /// Maps what the other end made; takes the descriptor. Throws ChannelError when it is something else.
  [[nodiscard]] static SharedStream map(int descriptor);
  ~SharedStream();
  SharedStream(SharedStream&& other) noexcept;
  SharedStream& operator=(SharedStream&& other) noexcept;

  /// Of the memory, to be given to the other end.
  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// The other end has it, or never will.
  void close_descriptor();

  /// Takes as many bytes as there is room for, and returns their number. Throws ChannelError when the other
  /// end's counter cannot be.
  [[nodiscard]] std::size_t write(const char* bytes, std::size_t size);
  /// Gives as many bytes as are there, `size` at most. Throws ChannelError as `write` does.
  [[nodiscard]] std::size_t read(char* bytes, std::size_t size);
  [[nodiscard]] bool readable() const;

  /// Says that this end is about to sleep until the other rings. To be followed by a last look at `readable`.
  void say_asleep();
  void say_awake();
  /// After a `write`: whether the other end has to be rung. Says so once for each sleep.
  [[nodiscard]] bool must_ring();

  /// What the maker of the memory said.
  [[nodiscard]] bool processor_to_spare() const;
  /// How long ago the other end last wrote.
  [[nodiscard]] std::chrono::nanoseconds age() const;

private:
  struct Memory;
  SharedStream(int descriptor, Memory* memory, bool maker);
  // The directions are numbered by who writes: 0 the end that made the memory.
  [[nodiscard]] unsigned own() const { return maker_ ? 0U : 1U; }
  [[nodiscard]] unsigned others() const { return maker_ ? 1U : 0U; }

  int descriptor_ = -1;
  Memory* memory_ = nullptr;
  bool maker_ = false;
  // Places in the stream of bytes, which skips to the next whole ring when the ring is begun anew.
  std::uint64_t written_ = 0;
  std::uint64_t taken_ = 0;
  std::uint64_t begun_ = 0;  // where it last was
};

}  // namespace estuary
