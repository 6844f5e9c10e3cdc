// The computing thread's way to its next request: what the receiving thread puts here, or what comes straight
// from the coupler over a direct line. The line saves waking two threads for each message; it is there when
// the participant serves a local address and the coupler enters it.
#pragma once

#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "conversation.hpp"
#include "direct_line.hpp"
#include "estuary/v1/protocol.pb.h"
#include "line_watch.hpp"

namespace estuary {

class RequestQueue {
public:
  /// Listens for a direct line beside `endpoint` when there can be one.
  RequestQueue(const std::string& endpoint, Conversation& conversation);
  ~RequestQueue();
  RequestQueue(const RequestQueue&) = delete;
  RequestQueue& operator=(const RequestQueue&) = delete;

  [[nodiscard]] bool offers_direct_line() const { return entrance_.has_value(); }

  // For the receiving thread.
  void put_request(v1::Request request);
  [[nodiscard]] std::shared_ptr<const v1::Reply> take_reply();
  /// The process is to end: `next` returns nothing from now on.
  void close();

  // For the computing thread.
  /// Waits for a request that is to be carried out. Nothing when the process is to end.
  [[nodiscard]] std::optional<v1::Request> next();
  /// Whether the process is to end.
  [[nodiscard]] bool closed() const;
  /// The reply to the last request of `next`. True when the receiving thread has to send it.
  [[nodiscard]] bool reply(std::shared_ptr<const v1::Reply> reply);

private:
  [[nodiscard]] std::optional<v1::Request> from_line();
  [[nodiscard]] std::optional<v1::Request> from_receiver();
  void say(const v1::Reply& reply);

  Conversation& conversation_;
  int arrived_;  // an event descriptor: something was put, or the queue was closed
  std::optional<DirectLineEntrance> entrance_;
  std::optional<DirectLine> line_;
  LineWatch watch_;
  bool came_over_line_ = false;
  mutable std::mutex mutex_;
  std::deque<v1::Request> requests_;
  std::deque<std::shared_ptr<const v1::Reply>> replies_;
  bool closed_ = false;
};

}  // namespace estuary
