// A byte stream between two threads of one machine, beside their ZeroMQ channel, for the messages of every
// window.
//
// ZeroMQ hands each message to a thread of its own on either side: three threads are woken one after the
// other before a reader has it. Here the writer wakes the reader, which is what a window of a few hundred
// microseconds asks for. The messages are the same, each preceded by its length in bytes (eight bytes, the
// machine's order: both ends are on the same machine). Nothing waits without a deadline.
#pragma once

#include <google/protobuf/message_lite.h>
#include <poll.h>

#include <chrono>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace estuary {

/// Where the line of a participant at `endpoint` is entered: a path beside that of an ipc:// endpoint. Empty
/// when there can be none (another kind of endpoint, or a path too long for a local socket).
[[nodiscard]] std::string direct_line_path(const std::string& endpoint);

/// One connected end. One thread only.
class DirectLine {
public:
  /// Nothing when nobody listens at `path`.
  [[nodiscard]] static std::optional<DirectLine> connect(const std::string& path);
  /// Takes a connected stream socket.
  explicit DirectLine(int descriptor);
  ~DirectLine();
  DirectLine(DirectLine&& other) noexcept;
  DirectLine& operator=(DirectLine&& other) noexcept;

  /// Bytes written; 0 when the other end is gone. Throws ChannelError when the message is too large, or no
  /// byte of it is taken for two seconds.
  [[nodiscard]] std::size_t send(const google::protobuf::MessageLite& message);

  enum class Received { nothing, message, closed };
  /// Takes what has arrived, without waiting. Throws ChannelError when it is not a message of the given kind.
  [[nodiscard]] Received receive(google::protobuf::MessageLite& message);

  /// To wait on.
  [[nodiscard]] int descriptor() const { return descriptor_; }
  /// Of the message last received.
  [[nodiscard]] std::size_t bytes_received() const { return size_of_last_; }

private:
  // Reads until `wanted` bytes are there; false when they have not all come yet.
  [[nodiscard]] Received fill(std::size_t wanted);

  int descriptor_ = -1;
  std::vector<char> outgoing_;
  std::vector<char> incoming_;
  std::size_t have_ = 0;  // bytes of the message under way, its length included
  std::size_t size_of_last_ = 0;
};

/// Waits on descriptors, awake at first: waking a thread on an idle processor takes longer than a message,
/// and as long as a small window. It stays awake when the last wait was short enough for it, and only while
/// no other thread wants its processor. One thread only.
class LineWatch {
public:
  /// Fills in `revents` as poll(2) does; false when `timeout` passes (none: never) or a signal came.
  [[nodiscard]] bool wait(std::span<pollfd> watched, std::optional<std::chrono::milliseconds> timeout);

private:
  std::chrono::nanoseconds last_{0};            // length of the last wait
  unsigned sleeps_left_ = 0, sleeps_next_ = 0;  // waits to sleep through since a processor was wanted
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
