#include "gatekeeper.hpp"

#include <fmt/format.h>
#include <sys/eventfd.h>
#include <unistd.h>
#include <zmq.h>

#include <algorithm>
#include <array>

#include "channel.hpp"

namespace estuary {
namespace {

// Frames of a request: version, number, domain, address, identity, mechanism, then the credentials.
constexpr std::size_t mechanism_frame = 5;
constexpr std::size_t key_frame = 6;

}  // namespace

Gatekeeper::Gatekeeper(void* context, const std::vector<std::string>& allowed)
    : socket_(::zmq_socket(context, ZMQ_REP)), stop_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  for (const auto& key : allowed) {
    constexpr std::size_t bytes_of_key = 32;
    std::string bytes(bytes_of_key, '\0');
    ::zmq_z85_decode(reinterpret_cast<std::uint8_t*>(bytes.data()), key.c_str());
    allowed_.push_back(std::move(bytes));
  }
  const int at_once = 0;
  if (socket_ == nullptr || stop_ < 0 ||
      ::zmq_setsockopt(socket_, ZMQ_LINGER, &at_once, sizeof at_once) != 0 ||
      ::zmq_bind(socket_, "inproc://zeromq.zap.01") != 0) {
    const std::string why = ::zmq_strerror(::zmq_errno());
    if (socket_ != nullptr) ::zmq_close(socket_);
    if (stop_ >= 0) ::close(stop_);
    throw ChannelError(fmt::format("keys cannot be checked: {}", why));
  }
  thread_ = std::thread([this] { answer(); });
}

Gatekeeper::~Gatekeeper() {
  ::eventfd_write(stop_, 1);
  thread_.join();
  ::zmq_close(socket_);
  ::close(stop_);
}

void Gatekeeper::answer() {
  while (true) {
    std::array<zmq_pollitem_t, 2> items{{{socket_, 0, ZMQ_POLLIN, 0}, {nullptr, stop_, ZMQ_POLLIN, 0}}};
    if (::zmq_poll(items.data(), static_cast<int>(items.size()), -1) < 0 || items[1].revents != 0) {
      if (items[1].revents != 0 || ::zmq_errno() != EINTR) return;
      continue;
    }
    std::vector<std::string> frames;
    int more = 1;
    while (more != 0) {
      zmq_msg_t message;
      ::zmq_msg_init(&message);
      if (::zmq_msg_recv(&message, socket_, ZMQ_DONTWAIT) < 0) {
        ::zmq_msg_close(&message);
        break;
      }
      frames.emplace_back(static_cast<const char*>(::zmq_msg_data(&message)), ::zmq_msg_size(&message));
      more = ::zmq_msg_more(&message);
      ::zmq_msg_close(&message);
    }
    if (frames.size() < 2) continue;
    const bool known = frames.size() > key_frame && frames[mechanism_frame] == "CURVE" &&
                       std::find(allowed_.begin(), allowed_.end(), frames[key_frame]) != allowed_.end();
    const std::array<std::string, 6> reply = {
        frames[0], frames[1], known ? "200" : "400", known ? "OK" : "this key is not on the list", "", ""};
    for (std::size_t k = 0; k < reply.size(); ++k)
      ::zmq_send(socket_, reply[k].data(), reply[k].size(), k + 1 < reply.size() ? ZMQ_SNDMORE : 0);
  }
}

}  // namespace estuary
