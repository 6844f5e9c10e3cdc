#include "dialogue.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <random>

#include "elapsed.hpp"

namespace estuary::coupler {

using std::chrono::steady_clock;

namespace {
constexpr std::chrono::milliseconds look_round{20};
}

Dialogue::Dialogue(const std::string& endpoint, std::unique_ptr<ChildProcess> child, double timeout,
                   const std::atomic<int>& interrupt)
    : channel_(endpoint), child_(std::move(child)), timeout_(timeout), interrupt_(interrupt) {
  std::random_device random;
  header_.set_protocol_version(protocol_version);
  header_.set_run_id(fmt::format("conform-{:08x}", random()));
}

void Dialogue::at(std::uint64_t window, std::uint64_t iteration) {
  header_.set_window(window);
  header_.set_iteration(iteration);
}

v1::Header Dialogue::next_header() {
  header_.set_sequence(++sequence_);
  return header_;
}

void Dialogue::heard() {
  const auto now = steady_clock::now();
  if (last_heard_)
    longest_silence_ = std::max(longest_silence_, std::chrono::duration<double>(now - *last_heard_).count());
  last_heard_ = now;
}

std::optional<v1::Reply> Dialogue::receive(std::chrono::milliseconds timeout) {
  try {
    auto reply = channel_.receive(timeout);
    if (reply) heard();
    return reply;
  } catch (const ChannelError& error) {
    throw NoAnswer(error.what());
  }
}

v1::Reply Dialogue::reply_to(std::uint64_t sequence) {
  const auto begin = steady_clock::now();
  while (seconds_since(begin) < timeout_) {
    if (interrupt_) throw NoAnswer("interrupted");
    auto reply = receive(look_round);
    if (reply && !reply->has_progress() && reply->header().sequence() == sequence) {
      longest_answer_ = std::max(longest_answer_, seconds_since(begin));
      return std::move(*reply);
    }
    if (!reply && child_) {
      if (const auto how = child_->ended()) throw NoAnswer(*how);
    }
  }
  throw NoAnswer(fmt::format("no answer within {:g} s", timeout_));
}

v1::Reply Dialogue::ask(v1::Request request) {
  tell(std::move(request));
  return reply_to(sequence_);
}

void Dialogue::tell(v1::Request request) {
  *request.mutable_header() = next_header();
  // From its first request on a participant reports progress.
  if (!request.has_hello() && !last_heard_) last_heard_ = steady_clock::now();
  channel_.send(request);
}

v1::Reply Dialogue::ask_as_it_is(const v1::Request& request) {
  channel_.send(request);
  return reply_to(request.header().sequence());
}

int Dialogue::listen(double seconds) {
  const auto begin = steady_clock::now();
  int reports = 0;
  while (seconds_since(begin) < seconds) {
    const auto reply = receive(look_round);
    if (reply && reply->has_progress()) ++reports;
  }
  return reports;
}

std::optional<bool> Dialogue::ends_within(double seconds) {
  if (!child_) return std::nullopt;
  const auto begin = steady_clock::now();
  while (seconds_since(begin) < seconds) {
    if (child_->ended()) return true;
    (void)receive(look_round);
  }
  return false;
}

}  // namespace estuary::coupler
