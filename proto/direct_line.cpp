#include "direct_line.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <ctime>
#include <string_view>
#include <utility>

#include "channel.hpp"

namespace estuary {
namespace {

constexpr std::chrono::milliseconds taken_within{2000};
constexpr std::size_t length_bytes = sizeof(std::uint64_t);
// In place of the first message's length: memory comes along.
constexpr std::uint64_t memory_offered = ~std::uint64_t{0};

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

ChannelError not_taken() {
  return ChannelError(fmt::format("a message was not taken within {} ms", taken_within.count()));
}

}  // namespace

std::string direct_line_path(const std::string& endpoint) {
  constexpr std::string_view scheme = "ipc://";
  if (!endpoint.starts_with(scheme)) return {};
  std::string path = endpoint.substr(scheme.size()) + ".line";
  return address_of(path) ? path : std::string();
}

std::optional<DirectLine> DirectLine::connect(const std::string& path, Bytes bytes) {
  const auto address = address_of(path);
  if (!address) return std::nullopt;
  DirectLine line(local_stream());
  if (line.descriptor_ < 0) return std::nullopt;
  if (::connect(line.descriptor_, plain(*address), sizeof *address) != 0) return std::nullopt;
  line.may_be_offered_ = false;
  if (bytes != Bytes::over_socket) {
    line.memory_ = SharedStream::create(bytes == Bytes::through_memory_with_processor_to_spare);
    if (line.memory_ && !line.offer_memory()) return std::nullopt;
  }
  return line;
}

DirectLine::DirectLine(int descriptor) : descriptor_(descriptor) {}

DirectLine::~DirectLine() {
  if (descriptor_ >= 0) ::close(descriptor_);
  if (offered_ >= 0) ::close(offered_);
}

DirectLine::DirectLine(DirectLine&& other) noexcept {
  *this = std::move(other);
}

DirectLine& DirectLine::operator=(DirectLine&& other) noexcept {
  std::swap(descriptor_, other.descriptor_);
  std::swap(offered_, other.offered_);
  std::swap(memory_, other.memory_);
  may_be_offered_ = other.may_be_offered_;
  closed_ = other.closed_;
  outgoing_ = std::move(other.outgoing_);
  incoming_ = std::move(other.incoming_);
  have_ = std::exchange(other.have_, 0);
  size_of_last_ = other.size_of_last_;
  return *this;
}

bool DirectLine::offer_memory() {
  std::uint64_t said = memory_offered;
  iovec bytes{&said, sizeof said};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> extra{};
  msghdr message{};
  message.msg_iov = &bytes;
  message.msg_iovlen = 1;
  message.msg_control = extra.data();
  message.msg_controllen = extra.size();
  cmsghdr* head = CMSG_FIRSTHDR(&message);
  head->cmsg_level = SOL_SOCKET;
  head->cmsg_type = SCM_RIGHTS;
  head->cmsg_len = CMSG_LEN(sizeof(int));
  const int given = memory_->descriptor();
  std::memcpy(CMSG_DATA(head), &given, sizeof given);
  // Nothing was sent before: so few bytes have room.
  const bool sent = ::sendmsg(descriptor_, &message, MSG_NOSIGNAL | MSG_DONTWAIT) == sizeof said;
  memory_->close_descriptor();
  return sent;
}

ssize_t DirectLine::take(char* bytes, std::size_t size) {
  if (!may_be_offered_) return ::recv(descriptor_, bytes, size, MSG_DONTWAIT);
  iovec place{bytes, size};
  alignas(cmsghdr) std::array<char, CMSG_SPACE(sizeof(int))> extra{};
  msghdr message{};
  message.msg_iov = &place;
  message.msg_iovlen = 1;
  message.msg_control = extra.data();
  message.msg_controllen = extra.size();  // the system closes what does not fit
  const ssize_t came = ::recvmsg(descriptor_, &message, MSG_DONTWAIT | MSG_CMSG_CLOEXEC);
  if (came <= 0) return came;
  const cmsghdr* head = CMSG_FIRSTHDR(&message);
  if (head != nullptr && head->cmsg_level == SOL_SOCKET && head->cmsg_type == SCM_RIGHTS &&
      head->cmsg_len == CMSG_LEN(sizeof(int))) {
    if (offered_ >= 0) ::close(offered_);
    std::memcpy(&offered_, CMSG_DATA(head), sizeof offered_);
  }
  return came;
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
  return memory_ ? send_through_memory() : send_over_socket();
}

std::size_t DirectLine::send_over_socket() {
  std::size_t sent = 0;
  while (sent < outgoing_.size()) {
    const ssize_t taken =
        ::send(descriptor_, outgoing_.data() + sent, outgoing_.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (taken > 0) {
      sent += static_cast<std::size_t>(taken);
    } else if (errno == EAGAIN || errno == EWOULDBLOCK) {
      pollfd room{descriptor_, POLLOUT, 0};
      const int ready = ::poll(&room, 1, static_cast<int>(taken_within.count()));
      if (ready == 0) throw not_taken();
      if (ready < 0 && errno != EINTR) return 0;
    } else if (errno != EINTR) {
      return 0;
    }
  }
  return sent;
}

std::size_t DirectLine::send_through_memory() {
  using std::chrono::steady_clock;
  if (closed_) return 0;
  std::size_t sent = 0;
  auto last_taken = steady_clock::now();
  while (true) {
    const std::size_t taken = memory_->write(outgoing_.data() + sent, outgoing_.size() - sent);
    sent += taken;
    if (memory_->must_ring() && !ring()) return 0;
    if (sent == outgoing_.size()) return sent;
    const auto now = steady_clock::now();
    if (taken > 0) last_taken = now;
    if (now - last_taken > taken_within) throw not_taken();
    // The reader makes room while this one is away; that it is gone shows on the socket.
    constexpr timespec look_again{0, 50'000};
    pollfd gone{descriptor_, 0, 0};
    if (::ppoll(&gone, 1, &look_again, nullptr) > 0) return 0;
  }
}

bool DirectLine::ring() {
  constexpr char anything = 0;
  while (::send(descriptor_, &anything, 1, MSG_NOSIGNAL | MSG_DONTWAIT) < 0) {
    // A socket that is full of rings wakes its reader as well.
    if (errno == EAGAIN || errno == EWOULDBLOCK) return true;
    if (errno != EINTR) return false;
  }
  return true;
}

void DirectLine::take_rings() {
  std::array<char, 64> rings{};
  ssize_t came = 0;
  while ((came = ::recv(descriptor_, rings.data(), rings.size(), MSG_DONTWAIT)) < 0 && errno == EINTR) {
  }
  if (came == 0 || (came < 0 && errno != EAGAIN && errno != EWOULDBLOCK)) closed_ = true;
}

DirectLine::Received DirectLine::fill(std::size_t wanted) {
  if (incoming_.size() < wanted) incoming_.resize(wanted);
  if (memory_) return fill_from_memory(wanted);
  while (have_ < wanted) {
    const ssize_t came = take(incoming_.data() + have_, wanted - have_);
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

DirectLine::Received DirectLine::fill_from_memory(std::size_t wanted) {
  have_ += memory_->read(incoming_.data() + have_, wanted - have_);
  if (have_ == wanted) return Received::message;
  if (!closed_) take_rings();
  // What was written before the other end went is taken first.
  have_ += memory_->read(incoming_.data() + have_, wanted - have_);
  if (have_ == wanted) return Received::message;
  return closed_ ? Received::closed : Received::nothing;
}

DirectLine::Received DirectLine::receive(google::protobuf::MessageLite& message) {
  if (have_ < length_bytes) {
    if (const Received state = fill(length_bytes); state != Received::message) return state;
  }
  std::uint64_t size = 0;
  std::memcpy(&size, incoming_.data(), length_bytes);
  if (std::exchange(may_be_offered_, false) && offered_ >= 0) {
    const int offered = std::exchange(offered_, -1);
    if (size == memory_offered) {
      memory_ = SharedStream::map(offered);
      have_ = 0;
      if (const Received state = fill(length_bytes); state != Received::message) return state;
      std::memcpy(&size, incoming_.data(), length_bytes);
    } else {
      ::close(offered);
    }
  }
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
