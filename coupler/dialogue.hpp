// Talking to one participant without the manners of a run: any request with any header, to see what it does
// with it. For the examination of participants (conform.hpp).
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>

#include "channel.hpp"
#include "child_process.hpp"

namespace estuary::coupler {

/// The participant gave no answer: it ended, is silent, or sends what cannot be read.
struct NoAnswer : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class Dialogue {
public:
  /// `child` runs the participant, null when it was started elsewhere. `timeout`: the longest wait for an
  /// answer [s].
  Dialogue(const std::string& endpoint, std::unique_ptr<ChildProcess> child, double timeout,
           const std::atomic<int>& interrupt);

  /// Where the run is said to be in the header of the requests to come.
  void at(std::uint64_t window, std::uint64_t iteration);

  /// Numbers the request, sends it and waits for the reply to it. Throws NoAnswer.
  v1::Reply ask(v1::Request request);
  /// The same without waiting.
  void tell(v1::Request request);
  /// Sends it with the header it has, and waits for a reply with the sequence number in it.
  v1::Reply ask_as_it_is(const v1::Request& request);
  void send_bytes(std::string_view bytes) { channel_.send_bytes(bytes); }
  /// The reply to a request sent before.
  v1::Reply reply_to(std::uint64_t sequence);
  /// Listens for `seconds`; how many reports of progress came.
  int listen(double seconds);
  /// Whether the process ended within `seconds`; nothing when it was started elsewhere.
  std::optional<bool> ends_within(double seconds);

  [[nodiscard]] v1::Header next_header();
  [[nodiscard]] std::uint64_t sequence() const { return sequence_; }
  /// Longest time without any message since the first request of the run [s]: while one was being worked on,
  /// and in all.
  [[nodiscard]] double longest_silence() const { return longest_silence_; }
  [[nodiscard]] double longest_answer() const { return longest_answer_; }
  [[nodiscard]] bool launched() const { return child_ != nullptr; }

private:
  std::optional<v1::Reply> receive(std::chrono::milliseconds timeout);
  void heard();

  ClientChannel channel_;
  std::unique_ptr<ChildProcess> child_;
  double timeout_;
  const std::atomic<int>& interrupt_;
  v1::Header header_;
  std::uint64_t sequence_ = 0;
  std::optional<std::chrono::steady_clock::time_point> last_heard_;
  double longest_silence_ = 0;
  double longest_answer_ = 0;
};

}  // namespace estuary::coupler
