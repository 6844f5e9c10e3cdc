#include "channel.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/eventfd.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zmq.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstring>
#include <random>
#include <vector>
#include <zmq.hpp>

#include "direct_line.hpp"
#include "gatekeeper.hpp"
#include "line_watch.hpp"

namespace estuary {
namespace {

constexpr int heartbeat_interval_ms = 300;
// Between machines only heartbeats tell that the other one is gone. On one machine the end of a process
// closes its socket, and a late heartbeat means that the machine is busy.
// Networks stand still for seconds: a connection that is closed for it can be opened again, but costs time.
constexpr int remote_heartbeat_timeout_ms = 5000;
constexpr int connect_timeout_ms = 2000;  // the kernel would go on for minutes
constexpr int handshake_timeout_ms = 5000;
constexpr int local_heartbeat_timeout_ms = 15000;
constexpr std::size_t longest_ipc_path = 107;  // sun_path

zmq::context_t& context() {
  static zmq::context_t shared(1);
  return shared;
}

void set_limits(zmq::socket_t& socket, const std::string& endpoint) {
  socket.set(zmq::sockopt::linger, 500);
  socket.set(zmq::sockopt::maxmsgsize, maximum_message_bytes);
  socket.set(zmq::sockopt::heartbeat_ivl, heartbeat_interval_ms);
  socket.set(zmq::sockopt::heartbeat_timeout,
             is_local(endpoint) ? local_heartbeat_timeout_ms : remote_heartbeat_timeout_ms);
  socket.set(zmq::sockopt::sndtimeo, 2000);
  socket.set(zmq::sockopt::connect_timeout, connect_timeout_ms);
  socket.set(zmq::sockopt::handshake_ivl, handshake_timeout_ms);
}

std::string ipc_path(const std::string& endpoint) {
  constexpr std::string_view scheme = "ipc://";
  return endpoint.starts_with(scheme) ? endpoint.substr(scheme.size()) : std::string();
}

void check_endpoint(const std::string& endpoint) {
  if (!endpoint.starts_with("ipc://") && !endpoint.starts_with("tcp://")) {
    throw ChannelError(fmt::format("'{}' is not an address: use ipc:///path or tcp://host:port", endpoint));
  }
  if (ipc_path(endpoint).size() > longest_ipc_path) {
    throw ChannelError(
        fmt::format("the path in '{}' is longer than the {} characters a local socket may have; "
                    "set TMPDIR to a shorter folder",
                    endpoint, longest_ipc_path));
  }
}

// A path made now can be entered by this user only.
class PrivateFiles {
public:
  PrivateFiles() : before_(::umask(S_IRWXG | S_IRWXO)) {}
  PrivateFiles(const PrivateFiles&) = delete;
  PrivateFiles& operator=(const PrivateFiles&) = delete;
  ~PrivateFiles() { ::umask(before_); }

private:
  mode_t before_;
};

void give_keys(zmq::socket_t& socket, const CurvePair& own) {
  socket.set(zmq::sockopt::curve_publickey, own.public_key);
  socket.set(zmq::sockopt::curve_secretkey, own.secret_key);
}

zmq::message_t serialise(const google::protobuf::MessageLite& message) {
  const std::size_t size = message.ByteSizeLong();
  if (static_cast<std::int64_t>(size) > maximum_message_bytes) {
    throw ChannelError(fmt::format("a message of {} bytes is larger than the {} bytes allowed", size,
                                   maximum_message_bytes));
  }
  zmq::message_t frame(size);
  message.SerializeToArray(frame.data(), static_cast<int>(size));
  return frame;
}

}  // namespace

// Hears of connections that fail before a message can pass.
class Doorkeeper {
public:
  void watch(zmq::socket_t& socket) {
    static std::atomic<int> number{0};
    const std::string address = fmt::format("inproc://door-{}", number++);
    constexpr int failures = ZMQ_EVENT_HANDSHAKE_FAILED_NO_DETAIL | ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL |
                             ZMQ_EVENT_HANDSHAKE_FAILED_AUTH | ZMQ_EVENT_HANDSHAKE_SUCCEEDED;
    if (::zmq_socket_monitor(socket.handle(), address.c_str(), failures) != 0)
      throw ChannelError(::zmq_strerror(::zmq_errno()));
    events_ = zmq::socket_t(context(), zmq::socket_type::pair);
    events_.set(zmq::sockopt::linger, 0);
    events_.connect(address);
  }
  [[nodiscard]] bool watches() const { return events_.handle() != nullptr; }
  [[nodiscard]] void* handle() { return events_.handle(); }
  void look() {
    zmq::message_t event;
    while (watches() && events_.recv(event, zmq::recv_flags::dontwait)) {
      std::uint16_t kind = 0;
      std::memcpy(&kind, event.data(), sizeof kind);
      zmq::message_t address;
      while (events_.get(zmq::sockopt::rcvmore))
        if (!events_.recv(address, zmq::recv_flags::dontwait)) break;
      if (kind == ZMQ_EVENT_HANDSHAKE_SUCCEEDED) {
        in_a_row_ = 0;
        was_let_in_ = true;
        continue;
      }
      ++refused_;
      // Who was let in before has the right key: a connection that breaks off is the network's doing.
      if (!was_let_in_ || kind == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH) ++in_a_row_;
      last_ = kind == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH       ? "its key is not on the list"
              : kind == ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL ? "it speaks without a key, or not as it should"
                                                            : "it was made for another key, or broke off";
      last_for_client_ =
          kind == ZMQ_EVENT_HANDSHAKE_FAILED_AUTH
              ? "the public key of this run's own pair (hosts.coupler.key) is not among those the "
                "participant was given with --allow"
          : kind == ZMQ_EVENT_HANDSHAKE_FAILED_PROTOCOL
              ? "the participant serves without a key (it was started with --insecure, or is no "
                "participant)"
              : "the participant holds another key than public_key says, or something else serves there";
    }
  }
  [[nodiscard]] std::uint64_t refused() const { return refused_; }
  [[nodiscard]] std::uint64_t in_a_row() const { return in_a_row_; }
  [[nodiscard]] const std::string& last() const { return last_; }
  [[nodiscard]] const std::string& last_for_client() const { return last_for_client_; }

private:
  zmq::socket_t events_;
  std::uint64_t refused_ = 0;
  std::uint64_t in_a_row_ = 0;
  bool was_let_in_ = false;
  std::string last_;  // in the words of who was asked
  std::string last_for_client_;
};

bool is_local(const std::string& endpoint) {
  if (endpoint.starts_with("ipc://")) return true;
  constexpr std::string_view scheme = "tcp://";
  if (!endpoint.starts_with(scheme)) return false;
  const std::string host = endpoint.substr(scheme.size(), endpoint.rfind(':') - scheme.size());
  return host == "localhost" || host == "[::1]" || host.starts_with("127.");
}

const char* phase_name(const v1::Request& request) {
  switch (request.phase_case()) {
    case v1::Request::kHello:
      return "hello";
    case v1::Request::kConfigure:
      return "configure";
    case v1::Request::kStart:
      return "start";
    case v1::Request::kAdvance:
      return "advance";
    case v1::Request::kAccept:
      return "accept";
    case v1::Request::kSave:
      return "save";
    case v1::Request::kLoad:
      return "load";
    case v1::Request::kFrame:
      return "frame";
    case v1::Request::kStop:
      return "stop";
    case v1::Request::PHASE_NOT_SET:
      break;
  }
  return "nothing";
}

namespace {

// A name that nobody else has: with it a connection that broke and was made anew is known as the same.
std::string new_routing_id() {
  std::random_device random;
  return fmt::format("c{:08x}{:08x}{:08x}", random(), random(), random());
}

}  // namespace

struct ClientChannel::Socket {
  zmq::socket_t socket{context(), zmq::socket_type::dealer};
  Doorkeeper door;  // with keys
  std::optional<DirectLine> line;
  LineWatch watch;
  bool reply_over_line = false;  // the reply awaited
};

ClientChannel::ClientChannel(const std::string& endpoint, const ClientSecurity& security)
    : socket_(std::make_unique<Socket>()), endpoint_(endpoint) {
  check_endpoint(endpoint);
  if (!is_local(endpoint) && !security.has_keys() && !security.insecure) {
    throw ChannelError(
        fmt::format("'{}' is not on this machine and no keys are given: whoever is in between could read and "
                    "change everything",
                    endpoint));
  }
  set_limits(socket_->socket, endpoint);
  socket_->socket.set(zmq::sockopt::routing_id, new_routing_id());
  if (security.has_keys()) {
    give_keys(socket_->socket, security.own);
    socket_->socket.set(zmq::sockopt::curve_serverkey, security.server_key);
    socket_->door.watch(socket_->socket);
  }
  // A participant that is still starting binds a little later; try again often.
  socket_->socket.set(zmq::sockopt::reconnect_ivl, 10);
  socket_->socket.set(zmq::sockopt::reconnect_ivl_max, 200);
  try {
    socket_->socket.connect(endpoint);
  } catch (const zmq::error_t& error) {
    throw ChannelError(fmt::format("cannot connect to '{}': {}", endpoint, error.what()));
  }
}

ClientChannel::~ClientChannel() = default;
ClientChannel::ClientChannel(ClientChannel&&) noexcept = default;
ClientChannel& ClientChannel::operator=(ClientChannel&&) noexcept = default;

void ClientChannel::open_direct_line(DirectLine::Bytes bytes) {
  if (const std::string path = direct_line_path(endpoint_); !path.empty())
    socket_->line = DirectLine::connect(path, bytes);
}

void ClientChannel::send(const v1::Request& request) {
  socket_->reply_over_line = false;
  if (socket_->line && (request.has_advance() || request.has_accept())) {
    if (const std::size_t size = socket_->line->send(request); size != 0) {
      socket_->reply_over_line = true;
      bytes_sent_ += size;
      ++messages_;
      return;
    }
    socket_->line.reset();
  }
  zmq::message_t frame = serialise(request);
  const std::size_t size = frame.size();
  if (!socket_->socket.send(frame, zmq::send_flags::none)) {
    throw ChannelError(why_unsent());
  }
  bytes_sent_ += size;
  ++messages_;
}

std::string ClientChannel::refused_keys() const {
  return fmt::format("'{}' and this run do not know each other's keys: {}", endpoint_,
                     socket_->door.last_for_client());
}

// A connection that is turned away takes no messages.
std::string ClientChannel::why_unsent() {
  socket_->door.look();
  if (socket_->door.in_a_row() > 0) return refused_keys();
  return fmt::format(
      "'{}' takes no messages{}", endpoint_,
      socket_->door.watches() || endpoint_.starts_with("ipc://") ? "" : "; does it want a key?");
}

void ClientChannel::send_bytes(std::string_view bytes) {
  zmq::message_t frame(bytes.data(), bytes.size());
  if (!socket_->socket.send(frame, zmq::send_flags::none)) throw ChannelError(why_unsent());
}

// A line that is closed says nothing about why: the channel, the process and its progress do. A reply that
// was lost with it is asked for again.
std::optional<v1::Reply> ClientChannel::receive_over_line() {
  v1::Reply reply;
  switch (socket_->line->receive(reply)) {
    case DirectLine::Received::nothing:
      return std::nullopt;
    case DirectLine::Received::closed:
      socket_->line.reset();
      return std::nullopt;
    case DirectLine::Received::message:
      break;
  }
  socket_->reply_over_line = false;
  bytes_received_ += socket_->line->bytes_received();
  ++messages_;
  return reply;
}

std::optional<v1::Reply> ClientChannel::receive(std::chrono::milliseconds timeout) {
  if (socket_->line) {
    if (auto reply = receive_over_line()) return reply;
  }
  socket_->door.look();
  constexpr std::uint64_t no_accident = 3;
  if (socket_->door.in_a_row() >= no_accident) throw ChannelError(refused_keys());
  zmq::pollitem_t item{socket_->socket.handle(), 0, ZMQ_POLLIN, 0};
  try {
    zmq::poll(&item, 1, timeout);
  } catch (const zmq::error_t& error) {
    if (error.num() == EINTR) return std::nullopt;  // a signal: let the caller look at its flags
    throw;
  }
  if ((item.revents & ZMQ_POLLIN) == 0) return std::nullopt;
  zmq::message_t frame;
  if (!socket_->socket.recv(frame, zmq::recv_flags::dontwait)) return std::nullopt;
  v1::Reply reply;
  if (frame.more() || !reply.ParseFromArray(frame.data(), static_cast<int>(frame.size()))) {
    while (socket_->socket.get(zmq::sockopt::rcvmore)) {
      if (!socket_->socket.recv(frame, zmq::recv_flags::dontwait)) break;
    }
    throw ChannelError(
        fmt::format("'{}' sent {} bytes that are not a message of this protocol", endpoint_, frame.size()));
  }
  bytes_received_ += frame.size();
  ++messages_;
  return reply;
}

void ClientChannel::drop_unsent() {
  socket_->socket.set(zmq::sockopt::linger, 0);
}

void ClientChannel::wait_for_any(std::span<ClientChannel* const> channels,
                                 std::chrono::milliseconds timeout) {
  // What else comes over a channel, reports of progress, can wait for the timeout.
  std::vector<DirectLine*> lines;
  for (ClientChannel* channel : channels)
    if (channel->socket_->line && channel->socket_->reply_over_line)
      lines.push_back(&*channel->socket_->line);
  if (!lines.empty() && lines.size() == channels.size()) {
    std::vector<pollfd> watched;
    for (const DirectLine* line : lines) watched.push_back({line->descriptor(), POLLIN, 0});
    (void)channels.front()->socket_->watch.wait(watched, lines, timeout);
    return;
  }
  std::vector<zmq::pollitem_t> items;
  items.reserve(channels.size());
  for (const DirectLine* line : lines) items.push_back({nullptr, line->descriptor(), ZMQ_POLLIN, 0});
  for (ClientChannel* channel : channels) {
    if (!channel->socket_->line || !channel->socket_->reply_over_line)
      items.push_back({channel->socket_->socket.handle(), 0, ZMQ_POLLIN, 0});
  }
  const Asleep asleep(lines);
  if (std::any_of(lines.begin(), lines.end(), [](const DirectLine* line) { return line->has_arrived(); }))
    return;
  try {
    zmq::poll(items, timeout);
  } catch (const zmq::error_t& error) {
    if (error.num() != EINTR) throw;
  }
}

struct ServerChannel::Socket {
  std::optional<Gatekeeper> gate;  // with keys
  zmq::socket_t socket{context(), zmq::socket_type::router};
  Doorkeeper door;  // with keys
  int wake = ::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  int lock = -1;
  std::string lock_path;

  Socket() = default;
  Socket(const Socket&) = delete;
  Socket& operator=(const Socket&) = delete;
  ~Socket() {
    if (wake >= 0) ::close(wake);
    if (lock >= 0) {
      ::unlink(lock_path.c_str());
      ::close(lock);
    }
  }
};

ServerChannel::ServerChannel(const std::string& endpoint, const ServerSecurity& security)
    : socket_(std::make_unique<Socket>()) {
  check_endpoint(endpoint);
  if (!is_local(endpoint) && !security.has_keys() && !security.insecure) {
    throw ChannelError(
        fmt::format("'{}' can be reached from other machines: give --key and --allow (`coupler keys` makes "
                    "them), bind to 127.0.0.1, or pass --insecure on a network you trust",
                    endpoint));
  }
  if (socket_->wake < 0) throw ChannelError(std::strerror(errno));
  // A second bind on an ipc path succeeds and steals it from the first, so the path is locked by a file
  // beside it.
  if (const std::string path = ipc_path(endpoint); !path.empty()) {
    socket_->lock_path = path + ".lock";
    socket_->lock = ::open(socket_->lock_path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0600);
    if (socket_->lock < 0) {
      throw ChannelError(fmt::format("cannot bind '{}': {}", endpoint, std::strerror(errno)));
    }
    if (::flock(socket_->lock, LOCK_EX | LOCK_NB) != 0) {
      ::close(socket_->lock);
      socket_->lock = -1;
      throw ChannelError(fmt::format("'{}' is in use by another participant", endpoint));
    }
  }
  set_limits(socket_->socket, endpoint);
  // Sending to a client that went away must fail: this is how a participant notices that the coupler is gone.
  socket_->socket.set(zmq::sockopt::router_mandatory, true);
  // One that comes back before its broken connection was noticed takes the place of it.
  socket_->socket.set(zmq::sockopt::router_handover, true);
  if (security.has_keys()) {
    socket_->gate.emplace(context().handle(), security.allowed);
    give_keys(socket_->socket, security.own);
    socket_->socket.set(zmq::sockopt::curve_server, true);
    socket_->socket.set(zmq::sockopt::zap_domain, "estuary");
    socket_->door.watch(socket_->socket);
  }
  try {
    const PrivateFiles only_for_this_user;
    socket_->socket.bind(endpoint);
  } catch (const zmq::error_t& error) {
    const std::string line = fmt::format("cannot bind '{}': {}", endpoint, error.what());
    if (error.num() == EADDRINUSE) throw AddressInUse(line);
    throw ChannelError(line);
  }
}

ServerChannel::~ServerChannel() = default;

std::optional<ServerChannel::Incoming> ServerChannel::receive(std::chrono::milliseconds timeout) {
  std::array<zmq::pollitem_t, 3> items{{{socket_->socket.handle(), 0, ZMQ_POLLIN, 0},
                                        {nullptr, socket_->wake, ZMQ_POLLIN, 0},
                                        {socket_->door.handle(), 0, ZMQ_POLLIN, 0}}};
  const std::size_t waited_for = socket_->door.watches() ? 3 : 2;
  try {
    zmq::poll(items.data(), waited_for, timeout);
  } catch (const zmq::error_t& error) {
    if (error.num() == EINTR) return std::nullopt;
    throw;
  }
  if ((items[1].revents & ZMQ_POLLIN) != 0) {
    std::uint64_t count = 0;
    [[maybe_unused]] const auto ignored = ::read(socket_->wake, &count, sizeof count);
  }
  socket_->door.look();
  if ((items[0].revents & ZMQ_POLLIN) == 0) return std::nullopt;
  zmq::message_t identity;
  if (!socket_->socket.recv(identity, zmq::recv_flags::dontwait)) return std::nullopt;
  Incoming incoming{.client = identity.to_string(), .request = std::nullopt};
  zmq::message_t payload;
  std::size_t frames = 0;
  while (socket_->socket.get(zmq::sockopt::rcvmore)) {
    if (!socket_->socket.recv(payload, zmq::recv_flags::dontwait)) break;
    ++frames;
  }
  v1::Request request;
  if (frames == 1 && request.ParseFromArray(payload.data(), static_cast<int>(payload.size()))) {
    incoming.request = std::move(request);
  }
  return incoming;
}

bool ServerChannel::send(const std::string& client, const v1::Reply& reply) {
  zmq::message_t payload = serialise(reply);
  try {
    if (!socket_->socket.send(zmq::buffer(client), zmq::send_flags::sndmore)) return false;
    return socket_->socket.send(payload, zmq::send_flags::none).has_value();
  } catch (const zmq::error_t& error) {
    if (error.num() == EHOSTUNREACH) return false;
    throw;
  }
}

void ServerChannel::wake() {
  const std::uint64_t one = 1;
  [[maybe_unused]] const auto ignored = ::write(socket_->wake, &one, sizeof one);
}

std::uint64_t ServerChannel::refused() const {
  return socket_->door.refused();
}

const std::string& ServerChannel::last_refusal() const {
  return socket_->door.last();
}

std::string ServerChannel::bound_endpoint() const {
  return socket_->socket.get(zmq::sockopt::last_endpoint);
}

}  // namespace estuary
