// The ZeroMQ channel between the coupler (DEALER) and a participant (ROUTER), over ipc:// or tcp://.
//
// One message is one frame holding a serialised `Request` or `Reply`. Nothing here waits without a deadline,
// and a message larger than `maximum_message_bytes` is refused on the sending side, because the library would
// drop it silently on the receiving one. Heartbeats notice a peer whose machine or network is gone.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include "curve_keys.hpp"
#include "direct_line.hpp"
#include "estuary/v1/protocol.pb.h"

namespace estuary {

inline constexpr std::uint32_t protocol_version = 1;
inline constexpr std::int64_t maximum_message_bytes = std::int64_t{256} * 1024 * 1024;

/// How often a participant reports progress, and the silence after which it counts as lost.
inline constexpr std::chrono::milliseconds progress_interval{200};
inline constexpr std::chrono::milliseconds lost_after{1500};

struct ChannelError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct AddressInUse : ChannelError {
  using ChannelError::ChannelError;
};

/// True for ipc:// and for tcp:// on 127.0.0.0/8, ::1 or localhost.
[[nodiscard]] bool is_local(const std::string& endpoint);

/// How long a coupler that went out of reach may take to come back, before a participant takes it for gone.
/// Between processes of one machine, ipc://, a connection does not break by accident.
inline constexpr std::chrono::milliseconds reconnect_within{3000};

/// The name of the request's phase, for people.
[[nodiscard]] const char* phase_name(const v1::Request& request);

/// The coupler's end of the channel to one participant. One thread only.
class ClientChannel {
public:
  /// Connects in the background; nothing is known about the other side before its first reply.
  /// Throws ChannelError for an endpoint that cannot be understood, or that is not local where there are no
  /// keys and `security` does not say that this is meant.
  explicit ClientChannel(const std::string& endpoint, const ClientSecurity& security = {});
  ~ClientChannel();
  ClientChannel(ClientChannel&&) noexcept;
  ClientChannel& operator=(ClientChannel&&) noexcept;

  /// Enters the participant's direct line when it has one at this endpoint; an Advance and an Accept then go
  /// over it, and their replies come back over it. To be called after its Welcome with the capability
  /// "direct-line"; through memory where it has the capability "shared-ring" too.
  void open_direct_line(DirectLine::Bytes bytes = DirectLine::Bytes::over_socket);

  /// Throws ChannelError when the message is too large.
  void send(const v1::Request& request);
  /// Bytes that need not be a Request, to see what a participant makes of them.
  void send_bytes(std::string_view bytes);
  /// The next message, or nothing when `timeout` passes. Throws ChannelError when it cannot be read as a
  /// Reply.
  [[nodiscard]] std::optional<v1::Reply> receive(std::chrono::milliseconds timeout);
  /// What was not sent yet never will be: for a channel that is given up.
  void drop_unsent();
  /// Waits until one of the channels has a message or `timeout` passes.
  static void wait_for_any(std::span<ClientChannel* const> channels, std::chrono::milliseconds timeout);

  [[nodiscard]] const std::string& endpoint() const { return endpoint_; }
  [[nodiscard]] std::uint64_t bytes_sent() const { return bytes_sent_; }
  [[nodiscard]] std::uint64_t bytes_received() const { return bytes_received_; }
  [[nodiscard]] std::uint64_t messages() const { return messages_; }

private:
  [[nodiscard]] std::optional<v1::Reply> receive_over_line();
  [[nodiscard]] std::string refused_keys() const;
  [[nodiscard]] std::string why_unsent();

  struct Socket;
  std::unique_ptr<Socket> socket_;
  std::string endpoint_;
  std::uint64_t bytes_sent_ = 0;
  std::uint64_t bytes_received_ = 0;
  std::uint64_t messages_ = 0;
};

/// The participant's end. One thread only, apart from `wake`.
class ServerChannel {
public:
  /// Binds. Throws ChannelError when the endpoint is taken or not understood, or is not local and `security`
  /// has neither keys nor says that it is meant to be open. With keys (CurveZMQ) only clients on the list are
  /// let in, before anything of theirs is read. One channel with keys per process.
  ServerChannel(const std::string& endpoint, const ServerSecurity& security);
  ServerChannel(const std::string& endpoint, bool insecure)
      : ServerChannel(endpoint, ServerSecurity{.insecure = insecure}) {}
  ~ServerChannel();
  ServerChannel(const ServerChannel&) = delete;
  ServerChannel& operator=(const ServerChannel&) = delete;

  struct Incoming {
    std::string client;                  // routing identity, to answer to
    std::optional<v1::Request> request;  // nothing when the bytes are not a Request
  };
  /// Waits until a message arrives, `wake` was called, or `timeout` passes.
  [[nodiscard]] std::optional<Incoming> receive(std::chrono::milliseconds timeout);
  /// False when `client` is no longer connected.
  [[nodiscard]] bool send(const std::string& client, const v1::Reply& reply);
  /// Ends the current or next `receive` early. May be called from any thread.
  void wake();
  /// Connections that were not let in: without a key, with another than those on the list, or not speaking
  /// ZeroMQ at all; and what was wrong with the last.
  [[nodiscard]] std::uint64_t refused() const;
  [[nodiscard]] const std::string& last_refusal() const;
  /// The endpoint with the port actually bound, for "tcp://127.0.0.1:*".
  [[nodiscard]] std::string bound_endpoint() const;

private:
  struct Socket;
  std::unique_ptr<Socket> socket_;
};

}  // namespace estuary
