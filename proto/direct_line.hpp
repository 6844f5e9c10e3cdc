// A byte stream between two threads of one machine, beside their ZeroMQ channel, for the messages of every
// window.
//
// ZeroMQ hands each message to a thread of its own on either side: three threads are woken one after the
// other before a reader has it. Here the writer wakes the reader, which is what a window of a few hundred
// microseconds asks for. The messages are the same, each preceded by its length in bytes (eight bytes, the
// machine's order: both ends are on the same machine). Nothing waits without a deadline.
//
// Where both ends can, the bytes go through memory that they share (shared_stream.hpp): whoever is awake sees
// them at once, whoever sleeps is woken by a byte on the socket, which also tells when the other end is gone.
// Who connects says so by eight bytes of ones, a length that no message has, with the memory's descriptor.
#pragma once

#include <google/protobuf/message_lite.h>
#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "shared_stream.hpp"

namespace estuary {

/// Where the line of a participant at `endpoint` is entered: a path beside that of an ipc:// endpoint. Empty
/// when there can be none (another kind of endpoint, or a path too long for a local socket).
[[nodiscard]] std::string direct_line_path(const std::string& endpoint);

/// One connected end. One thread only.
class DirectLine {
public:
  /// Through memory with what SharedStream::create wants to know of the processors.
  enum class Bytes { over_socket, through_memory, through_memory_with_processor_to_spare };
  /// Nothing when nobody listens at `path`. Through memory only where the other end is known to understand
  /// it; over the socket all the same when the system gives none.
  [[nodiscard]] static std::optional<DirectLine> connect(const std::string& path, Bytes bytes);
  /// Takes a connected stream socket.
  explicit DirectLine(int descriptor);
  ~DirectLine();
  DirectLine(DirectLine&& other) noexcept;
  DirectLine& operator=(DirectLine&& other) noexcept;

  /// Bytes written; 0 when the other end is seen to be gone, which through memory is not looked for while
  /// there is room. Throws ChannelError when the message is too large, or no byte of it is taken for two
  /// seconds.
  [[nodiscard]] std::size_t send(const google::protobuf::MessageLite& message);

  enum class Received { nothing, message, closed };
  /// Takes what has arrived, without waiting. Throws ChannelError when it is not a message of the given kind.
  [[nodiscard]] Received receive(google::protobuf::MessageLite& message);

  /// To wait on, after `say_asleep` where there is memory.
  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// Whether there are bytes in memory, or the end of the line was seen; without memory only the descriptor
  /// tells.
  [[nodiscard]] bool has_arrived() const { return closed_ || (memory_ && memory_->readable()); }
  /// The memory, null where the bytes go over the socket.
  [[nodiscard]] SharedStream* memory() { return memory_ ? &*memory_ : nullptr; }
  /// Takes from the socket what the other end rang with.
  void take_rings();
  /// Of the message last received.
  [[nodiscard]] std::size_t bytes_received() const { return size_of_last_; }

private:
  // Reads until `wanted` bytes are there.
  [[nodiscard]] Received fill(std::size_t wanted);
  [[nodiscard]] Received fill_from_memory(std::size_t wanted);
  // As recv(2), keeping a descriptor that comes along with the first bytes of the line.
  [[nodiscard]] ssize_t take(char* bytes, std::size_t size);
  [[nodiscard]] std::size_t send_over_socket();
  [[nodiscard]] std::size_t send_through_memory();
  // False when the other end is gone.
  [[nodiscard]] bool ring();
  [[nodiscard]] bool offer_memory();

  int descriptor_ = -1;
  int offered_ = -1;            // the descriptor of memory that came with the first bytes
  bool may_be_offered_ = true;  // nothing was received yet
  bool closed_ = false;         // seen while rings were taken
  std::optional<SharedStream> memory_;
  std::vector<char> outgoing_;
  std::vector<char> incoming_;
  std::size_t have_ = 0;  // bytes of the message under way, its length included
  std::size_t size_of_last_ = 0;
};

/// The participant's entrance. One thread only.
class DirectLineEntrance {
public:
  /// Listens at `path`, for this user only. Throws ChannelError when it cannot.
  explicit DirectLineEntrance(std::string path);
  ~DirectLineEntrance();
  DirectLineEntrance(const DirectLineEntrance&) = delete;
  DirectLineEntrance& operator=(const DirectLineEntrance&) = delete;

  /// Who stands at the entrance, without waiting.
  [[nodiscard]] std::optional<DirectLine> accept();
  /// To wait on.
  [[nodiscard]] int descriptor() const { return descriptor_; }

private:
  std::string path_;
  int descriptor_ = -1;
};

}  // namespace estuary
