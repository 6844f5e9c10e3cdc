#include "conversation.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "channel.hpp"

namespace estuary {

Conversation::Judgement Conversation::judge(const v1::Request& request) {
  const std::lock_guard lock(mutex_);
  const v1::Header& header = request.header();
  const auto refuse = [](v1::Error::Kind kind, std::string message) {
    return Judgement{.course = Course::refuse, .kind = kind, .message = std::move(message)};
  };
  if (header.protocol_version() != protocol_version) {
    return refuse(v1::Error::VERSION,
                  fmt::format("the request speaks protocol version {}, this participant {}",
                              header.protocol_version(), protocol_version));
  }
  if (header.run_id().empty())
    return refuse(v1::Error::BAD_MESSAGE, "the request belongs to no run (run_id is empty)");
  if (run_id_.empty()) run_id_ = header.run_id();
  if (header.run_id() != run_id_) return refuse(v1::Error::BUSY, fmt::format("busy with run {}", run_id_));
  // One process under two addresses: looked at before the order, because both count their requests from one.
  const std::string& role = request.configure().role();
  if (!role.empty() && !role_.empty() && role != role_)
    return refuse(v1::Error::BUSY, fmt::format("this process is '{}' of the same run; '{}' needs one of its "
                                               "own: launch a second one and connect to that",
                                               role_, role));
  const std::uint64_t sequence = header.sequence();
  if (last_reply_ && sequence == last_answered()) return {.course = Course::repeat};
  if (working_on_ != 0 && sequence == working_on_) return {.course = Course::ignore};
  if (sequence <= std::max(last_answered(), working_on_)) {
    return refuse(v1::Error::OUT_OF_ORDER,
                  fmt::format("request {} is older than request {}", sequence, last_answered()));
  }
  if (working_on_ != 0 && !request.has_stop()) {
    return refuse(v1::Error::OUT_OF_ORDER,
                  fmt::format("request {} came while request {} is being worked on", sequence, working_on_));
  }
  if (request.has_configure()) role_ = role;
  Judgement judgement;
  if (request.has_stop()) {
    stop_sequence_ = sequence;
    judgement.interrupts = working_on_ != 0;
  }
  working_on_ = sequence;
  working_header_ = header;
  return judgement;
}

void Conversation::answered(std::shared_ptr<const v1::Reply> reply) {
  const std::lock_guard lock(mutex_);
  if (reply->header().sequence() == working_on_) working_on_ = 0;
  last_reply_ = std::move(reply);
}

std::shared_ptr<const v1::Reply> Conversation::last_reply() const {
  const std::lock_guard lock(mutex_);
  return last_reply_;
}

std::string Conversation::run_id() const {
  const std::lock_guard lock(mutex_);
  return run_id_;
}

v1::Header Conversation::header_under_way() const {
  const std::lock_guard lock(mutex_);
  v1::Header header;
  if (working_on_ != 0) header = working_header_;
  header.set_protocol_version(protocol_version);
  header.set_run_id(run_id_);
  return header;
}

bool Conversation::ends_with(const v1::Reply& reply) const {
  const std::lock_guard lock(mutex_);
  return stop_sequence_ != 0 && reply.header().sequence() == stop_sequence_;
}

v1::Reply refusal(const v1::Header& header, v1::Error::Kind kind, const std::string& message) {
  v1::Reply reply;
  *reply.mutable_header() = header;
  reply.mutable_header()->set_protocol_version(protocol_version);
  reply.mutable_error()->set_kind(kind);
  reply.mutable_error()->set_message(message);
  return reply;
}

}  // namespace estuary
