#include "direct_line.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sched.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string_view>
#include <utility>

#include "channel.hpp"

namespace estuary {
namespace {

constexpr int taken_within_ms = 2000;
// The longest wait that is spent awake: to be woken after it costs a few hundredths of it.
constexpr std::chrono::microseconds stays_awake{1500};
// A processor that was given up for longer than this was wanted by another thread.
constexpr std::chrono::microseconds wanted_by_another{25};
constexpr unsigned most_sleeps = 2000;
constexpr std::size_t length_bytes = sizeof(std::uint64_t);

std::optional<sockaddr_un> address_of(const std::string& path) {
  sockaddr_un address{};
  if (path.empty() || path.size() >= sizeof address.sun_path) return std::nullopt;
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

const sockaddr* plain(const sockaddr_un& address) {
  return reinterpret_cast<const sockaddr*>(&address);
}

int local_stream() {
  return ::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
}

}  // namespace

std::string direct_line_path(const std::string& endpoint) {
  constexpr std::string_view scheme = "ipc://";
  if (!endpoint.starts_with(scheme)) return {};
  std::string path = endpoint.substr(scheme.size()) + ".line";
  return address_of(path) ? path : std::string();
}

std::optional<DirectLine> DirectLine::connect(const std::string& path) {
  const auto address = address_of(path);
  if (!address) return std::nullopt;
  DirectLine line(local_stream());
  if (line.descriptor_ < 0) return std::nullopt;
  if (::connect(line.descriptor_, plain(*address), sizeof *address) != 0) return std::nullopt;
  return line;
}

DirectLine::DirectLine(int descriptor) : descriptor_(descriptor) {}

DirectLine::~DirectLine() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

DirectLine::DirectLine(DirectLine&& other) noexcept {
  *this = std::move(other);
}

DirectLine& DirectLine::operator=(DirectLine&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  outgoing_ = std::move(other.outgoing_);
  incoming_ = std::move(other.incoming_);
  have_ = std::exchange(other.have_, 0);
  size_of_last_ = other.size_of_last_;
  return *this;
}

std::size_t DirectLine::send(const google::protobuf::MessageLite& message) {
  const std::uint64_t size = message.ByteSizeLong();
  if (size > static_cast<std::uint64_t>(maximum_message_bytes)) {
    throw ChannelError(fmt::format("a message of {} bytes is larger than the {} bytes allowed", size,
                                   maximum_message_bytes));
  }
  outgoing_.resize(length_bytes + size);
  std::memcpy(outgoing_.data(), &size, length_bytes);
  message.SerializeToArray(outgoing_.data() + length_bytes, static_cast<int>(size));
  std::size_t sent = 0;
  while (sent < outgoing_.size()) {
    const ssize_t taken =
        ::send(descriptor_, outgoing_.data() + sent, outgoing_.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (taken > 0) {
      sent += static_cast<std::size_t>(taken);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      pollfd room{descriptor_, POLLOUT, 0};
      const int ready = ::poll(&room, 1, taken_within_ms);
      if (ready == 0)
        throw ChannelError(fmt::format("a message was not taken within {} ms", taken_within_ms));
      if (ready < 0 && errno != EINTR) return 0;
    } else if (errno != EINTR) {
      return 0;
    }
  }
  return sent;
}

DirectLine::Received DirectLine::fill(std::size_t wanted) {
  if (incoming_.size() < wanted) incoming_.resize(wanted);
  while (have_ < wanted) {
    const ssize_t came = ::recv(descriptor_, incoming_.data() + have_, wanted - have_, MSG_DONTWAIT);
    if (came > 0) {
      have_ += static_cast<std::size_t>(came);
    } else if (came == 0) {
      return Received::closed;
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      return Received::nothing;
    } else if (errno != EINTR) {
      return Received::closed;
    }
  }
  return Received::message;
}

DirectLine::Received DirectLine::receive(google::protobuf::MessageLite& message) {
  if (have_ < length_bytes) {
    if (const Received state = fill(length_bytes); state != Received::message) return state;
  }
  std::uint64_t size = 0;
  std::memcpy(&size, incoming_.data(), length_bytes);
  if (size > static_cast<std::uint64_t>(maximum_message_bytes)) {
    throw ChannelError(
        fmt::format("a message of {} bytes was announced; {} are allowed", size, maximum_message_bytes));
  }
  if (const Received state = fill(length_bytes + size); state != Received::message) return state;
  have_ = 0;
  size_of_last_ = length_bytes + size;
  if (!message.ParseFromArray(incoming_.data() + length_bytes, static_cast<int>(size)))
    throw ChannelError(fmt::format("{} bytes that are not a message of this protocol", size));
  return Received::message;
}

bool LineWatch::wait(std::span<pollfd> watched, std::optional<std::chrono::milliseconds> timeout) {
  using std::chrono::steady_clock;
  const auto look = [&](int milliseconds) {
    const int ready = ::poll(watched.data(), watched.size(), milliseconds);
    if (ready < 0 && errno != EINTR) throw ChannelError(std::strerror(errno));
    return ready > 0;
  };
  const auto begin = steady_clock::now();
  bool ready = look(0);
  if (!ready && last_ <= stays_awake && sleeps_left_ == 0) {
    for (auto now = begin; !ready && now - begin < stays_awake;) {
      ::sched_yield();
      const auto after = steady_clock::now();
      if (after - now > wanted_by_another) {
        sleeps_next_ = std::min(2 * sleeps_next_ + 16, most_sleeps);
        sleeps_left_ = sleeps_next_;
        break;
      }
      now = after;
      ready = look(0);
    }
    if (ready) sleeps_next_ = 0;
  } else if (sleeps_left_ > 0) {
    --sleeps_left_;
  }
  if (!ready) ready = look(timeout ? static_cast<int>(timeout->count()) : -1);
  last_ = steady_clock::now() - begin;
  return ready;
}

DirectLineEntrance::DirectLineEntrance(std::string path)
    : path_(std::move(path)), descriptor_(local_stream()) {
  const auto fail = [this] {
    const std::string why = std::strerror(errno);
    if (descriptor_ >= 0) ::close(descriptor_);
    throw ChannelError(fmt::format("cannot listen at '{}': {}", path_, why));
  };
  const auto address = address_of(path_);
  if (!address || descriptor_ < 0) fail();
  ::unlink(path_.c_str());  // left by a process that was killed; the lock of the channel beside it is ours
  // Nobody can connect before `listen`, so nobody slips in before the permission is taken from others.
  if (::bind(descriptor_, plain(*address), sizeof *address) != 0) fail();
  if (::chmod(path_.c_str(), S_IRUSR | S_IWUSR) != 0 || ::listen(descriptor_, 1) != 0) fail();
}

DirectLineEntrance::~DirectLineEntrance() {
  ::unlink(path_.c_str());
  ::close(descriptor_);
}

std::optional<DirectLine> DirectLineEntrance::accept() {
  const int connected = ::accept4(descriptor_, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (connected < 0) return std::nullopt;
  return DirectLine(connected);
}

}  // namespace estuary
