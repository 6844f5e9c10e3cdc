// The one conversation that a participant has: which request may be carried out, which was already answered,
// and with what. Requests come over ZeroMQ to one thread and over a direct line to another; both ask here.
#pragma once

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

#include "estuary/v1/protocol.pb.h"

namespace estuary {

class Conversation {
public:
  enum class Course {
    carry_out,  // and it counts as being worked on from now on
    repeat,     // the reply was lost: say `last_reply` again, do nothing twice
    ignore,     // a retry of what is being worked on
    refuse
  };
  struct Judgement {
    Course course = Course::carry_out;
    v1::Error::Kind kind = v1::Error::UNSPECIFIED;  // of a refusal
    std::string message = {};
    bool interrupts = false;  // a Stop while another request is being worked on
  };
  /// Any request but Hello.
  [[nodiscard]] Judgement judge(const v1::Request& request);
  /// To be called before the reply is sent: the next request may follow at once.
  void answered(std::shared_ptr<const v1::Reply> reply);

  [[nodiscard]] std::shared_ptr<const v1::Reply> last_reply() const;
  /// Empty while free.
  [[nodiscard]] std::string run_id() const;
  /// Of the request being worked on; else with version and run only.
  [[nodiscard]] v1::Header header_under_way() const;
  /// The reply to the Stop of this run?
  [[nodiscard]] bool ends_with(const v1::Reply& reply) const;

private:
  [[nodiscard]] std::uint64_t last_answered() const {
    return last_reply_ ? last_reply_->header().sequence() : 0;
  }

  mutable std::mutex mutex_;
  std::string run_id_;
  std::string role_;  // of the first Configure
  std::shared_ptr<const v1::Reply> last_reply_;
  v1::Header working_header_;
  std::uint64_t working_on_ = 0;  // sequence; 0: nothing
  std::uint64_t stop_sequence_ = 0;
};

/// The reply that refuses a request.
[[nodiscard]] v1::Reply refusal(const v1::Header& header, v1::Error::Kind kind, const std::string& message);

}  // namespace estuary
