#include "shared_stream.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <new>
#include <utility>

#include "channel.hpp"

namespace estuary {

// Writer's and reader's words lie on cache lines of their own. Another layout needs another capability: both
// ends may come from different builds, and the size does not tell.
struct SharedStream::Memory {
  struct Direction {
    alignas(64) std::atomic<std::uint64_t> written;  // by the writer
    std::atomic<std::uint64_t> begun;              // where the writer last went back to the ring's beginning
    std::atomic<std::int64_t> written_at;          // by the clock of the machine [ns]
    alignas(64) std::atomic<std::uint64_t> taken;  // by the reader
    alignas(64) std::atomic<std::uint32_t> reader_sleeps;
    alignas(64) std::array<char, capacity> bytes;
  };
  std::array<Direction, 2> direction;
  std::atomic<std::uint32_t> processor_to_spare;
};

namespace {

constexpr int fixed_size = F_SEAL_SHRINK | F_SEAL_GROW;

static_assert(std::atomic<std::uint64_t>::is_always_lock_free &&
                  std::atomic<std::uint32_t>::is_always_lock_free,
              "only such atomics work between processes");

// The same for all processes.
std::int64_t machine_clock() {
  return std::chrono::nanoseconds(std::chrono::steady_clock::now().time_since_epoch()).count();
}

ChannelError impossible(std::uint64_t bytes) {
  return ChannelError(fmt::format("the memory of a direct line holds a counter that is {} bytes off", bytes));
}

std::uint64_t within_ring(std::uint64_t bytes) {
  if (bytes > SharedStream::capacity) throw impossible(bytes);
  return bytes;
}

}  // namespace

std::optional<SharedStream> SharedStream::create(bool processor_to_spare) {
  const int descriptor = ::memfd_create("estuary-line", MFD_CLOEXEC | MFD_ALLOW_SEALING);
  if (descriptor < 0) return std::nullopt;
  void* place = MAP_FAILED;
  if (::ftruncate(descriptor, sizeof(Memory)) == 0 &&
      ::fcntl(descriptor, F_ADD_SEALS, fixed_size | F_SEAL_SEAL) == 0)
    place = ::mmap(nullptr, sizeof(Memory), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  if (place == MAP_FAILED) {
    ::close(descriptor);
    return std::nullopt;
  }
  auto* memory = new (place) Memory;  // a file's first bytes are zero
  // The other end has to be told of the first message: nobody looks there yet.
  memory->direction[0].reader_sleeps.store(1);
  memory->processor_to_spare.store(processor_to_spare ? 1 : 0);
  return SharedStream(descriptor, memory, true);
}

SharedStream SharedStream::map(int descriptor) {
  struct stat entry {};
  const int seals = ::fcntl(descriptor, F_GET_SEALS);
  void* place = MAP_FAILED;
  if (seals >= 0 && (seals & fixed_size) == fixed_size && ::fstat(descriptor, &entry) == 0 &&
      entry.st_size == static_cast<off_t>(sizeof(Memory)))
    place = ::mmap(nullptr, sizeof(Memory), PROT_READ | PROT_WRITE, MAP_SHARED, descriptor, 0);
  ::close(descriptor);
  if (place == MAP_FAILED)
    throw ChannelError("what was given as the memory of a direct line has another size or can change it");
  return SharedStream(-1, static_cast<Memory*>(place), false);
}

SharedStream::SharedStream(int descriptor, Memory* memory, bool maker)
    : descriptor_(descriptor), memory_(memory), maker_(maker) {}

SharedStream::~SharedStream() {
  close_descriptor();
  if (memory_ != nullptr) ::munmap(memory_, sizeof(Memory));
}

SharedStream::SharedStream(SharedStream&& other) noexcept {
  *this = std::move(other);
}

SharedStream& SharedStream::operator=(SharedStream&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(memory_, other.memory_);
  maker_ = other.maker_;
  written_ = other.written_;
  taken_ = other.taken_;
  begun_ = other.begun_;
  return *this;
}

void SharedStream::close_descriptor() {
  if (descriptor_ >= 0) ::close(std::exchange(descriptor_, -1));
}

std::size_t SharedStream::write(const char* bytes, std::size_t size) {
  auto& way = memory_->direction[own()];
  const std::uint64_t taken = way.taken.load(std::memory_order_acquire);
  // A reader that has not read yet stands where the ring was empty, before the writer went to its beginning.
  if (begun_ > taken) within_ring(begun_ - taken);
  const std::uint64_t under_way = within_ring(written_ - std::max(begun_, taken));
  // An empty ring is begun anew: small messages stay in the same lines of the caches, and in pages that were
  // touched before, each of which costs more for the first time than the messages in it.
  if (under_way == 0 && size > 0 && written_ % capacity != 0) {
    written_ = begun_ = (written_ / capacity + 1) * capacity;
    way.begun.store(begun_, std::memory_order_relaxed);
  }
  const std::size_t fitting = std::min(size, capacity - static_cast<std::size_t>(under_way));
  const std::size_t at = written_ % capacity;
  const std::size_t to_end = std::min(fitting, capacity - at);
  std::memcpy(way.bytes.data() + at, bytes, to_end);
  std::memcpy(way.bytes.data(), bytes + to_end, fitting - to_end);
  written_ += fitting;
  way.written_at.store(machine_clock(), std::memory_order_relaxed);
  // In one order with `reader_sleeps`: either the reader's last look sees the bytes, or we see that it
  // sleeps.
  way.written.store(written_, std::memory_order_seq_cst);
  return fitting;
}

bool SharedStream::readable() const {
  return memory_->direction[others()].written.load(std::memory_order_seq_cst) != taken_;
}

std::size_t SharedStream::read(char* bytes, std::size_t size) {
  auto& way = memory_->direction[others()];
  const std::uint64_t written = way.written.load(std::memory_order_acquire);
  // Only what precedes the bytes seen: the writer may be about to begin anew with the next ones.
  const std::uint64_t begun = way.begun.load(std::memory_order_relaxed);
  if (begun > taken_ && begun <= written) {
    if (begun % capacity != 0) throw impossible(begun % capacity);
    taken_ += within_ring(begun - taken_);
  }
  const std::uint64_t there = within_ring(written - taken_);
  const std::size_t given = std::min(size, static_cast<std::size_t>(there));
  const std::size_t at = taken_ % capacity;
  const std::size_t to_end = std::min(given, capacity - at);
  std::memcpy(bytes, way.bytes.data() + at, to_end);
  std::memcpy(bytes + to_end, way.bytes.data(), given - to_end);
  taken_ += given;
  way.taken.store(taken_, std::memory_order_release);
  return given;
}

bool SharedStream::processor_to_spare() const {
  return memory_->processor_to_spare.load(std::memory_order_relaxed) != 0;
}

std::chrono::nanoseconds SharedStream::age() const {
  const auto& way = memory_->direction[others()];
  return std::chrono::nanoseconds(machine_clock() - way.written_at.load(std::memory_order_relaxed));
}

void SharedStream::say_asleep() {
  memory_->direction[others()].reader_sleeps.store(1, std::memory_order_seq_cst);
}

void SharedStream::say_awake() {
  memory_->direction[others()].reader_sleeps.store(0, std::memory_order_relaxed);
}

bool SharedStream::must_ring() {
  auto& sleeps = memory_->direction[own()].reader_sleeps;
  return sleeps.load(std::memory_order_seq_cst) != 0 && sleeps.exchange(0) != 0;
}

}  // namespace estuary
