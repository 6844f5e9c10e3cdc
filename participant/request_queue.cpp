#include "request_queue.hpp"

#include <poll.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <span>

#include "channel.hpp"

namespace estuary {

RequestQueue::RequestQueue(const std::string& endpoint, Conversation& conversation)
    : conversation_(conversation), arrived_(::eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC)) {
  if (arrived_ < 0) throw ChannelError(std::strerror(errno));
  if (const std::string path = direct_line_path(endpoint); !path.empty()) entrance_.emplace(path);
}

RequestQueue::~RequestQueue() {
  ::close(arrived_);
}

void RequestQueue::put_request(v1::Request request) {
  const std::lock_guard lock(mutex_);
  requests_.push_back(std::move(request));
  ::eventfd_write(arrived_, 1);
}

std::shared_ptr<const v1::Reply> RequestQueue::take_reply() {
  const std::lock_guard lock(mutex_);
  if (replies_.empty()) return nullptr;
  auto reply = std::move(replies_.front());
  replies_.pop_front();
  return reply;
}

void RequestQueue::close() {
  const std::lock_guard lock(mutex_);
  closed_ = true;
  ::eventfd_write(arrived_, 1);
}

bool RequestQueue::closed() const {
  const std::lock_guard lock(mutex_);
  return closed_;
}

std::optional<v1::Request> RequestQueue::next() {
  while (true) {
    std::array<pollfd, 3> wait{{{arrived_, POLLIN, 0},
                                {line_ ? line_->descriptor() : -1, POLLIN, 0},
                                {entrance_ ? entrance_->descriptor() : -1, POLLIN, 0}}};
    const std::array<DirectLine*, 1> lines{line_ ? &*line_ : nullptr};
    if (!watch_.wait(wait, std::span(lines).first(line_ ? 1 : 0), std::nullopt)) continue;  // a signal
    if (closed()) return std::nullopt;  // what is asked in the same moment is lost with this process
    if (line_ && (line_->has_arrived() || wait[1].revents != 0)) {
      if (auto request = from_line()) return request;
    }
    if (wait[2].revents != 0) {
      // Two lines at a time have nobody to belong to.
      if (auto line = entrance_->accept(); line && !line_) line_ = std::move(line);
    }
    if (wait[0].revents != 0) {
      if (auto request = from_receiver()) return request;
    }
  }
}

std::optional<v1::Request> RequestQueue::from_receiver() {
  const std::lock_guard lock(mutex_);
  if (requests_.empty()) {
    eventfd_t ignored = 0;
    ::eventfd_read(arrived_, &ignored);
    if (closed_) ::eventfd_write(arrived_, 1);
    return std::nullopt;
  }
  v1::Request request = std::move(requests_.front());
  requests_.pop_front();
  came_over_line_ = false;
  return request;
}

std::optional<v1::Request> RequestQueue::from_line() {
  v1::Request request;
  try {
    switch (line_->receive(request)) {
      case DirectLine::Received::nothing:
        return std::nullopt;
      case DirectLine::Received::closed:
        line_.reset();  // whether the coupler is gone shows on the channel
        return std::nullopt;
      case DirectLine::Received::message:
        break;
    }
  } catch (const ChannelError& error) {
    spdlog::warn("direct line closed: {}", error.what());
    line_.reset();
    return std::nullopt;
  }
  const Conversation::Judgement judgement = conversation_.judge(request);
  switch (judgement.course) {
    case Conversation::Course::carry_out:
      came_over_line_ = true;
      return request;
    case Conversation::Course::repeat:
      say(*conversation_.last_reply());
      break;
    case Conversation::Course::ignore:
      break;
    case Conversation::Course::refuse:
      spdlog::warn("refused a request: {}", judgement.message);
      say(refusal(request.header(), judgement.kind, judgement.message));
      break;
  }
  return std::nullopt;
}

void RequestQueue::say(const v1::Reply& reply) {
  try {
    if (line_->send(reply) != 0) return;
  } catch (const ChannelError& error) {
    spdlog::warn("direct line closed: {}", error.what());
  }
  line_.reset();
}

bool RequestQueue::reply(std::shared_ptr<const v1::Reply> reply) {
  conversation_.answered(reply);
  if (came_over_line_) {
    // When the line is closed meanwhile the coupler asks again over the channel, and hears it there.
    if (line_) say(*reply);
    return false;
  }
  const std::lock_guard lock(mutex_);
  replies_.push_back(std::move(reply));
  return true;
}

}  // namespace estuary
