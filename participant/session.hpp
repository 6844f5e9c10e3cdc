// One run as a participant sees it: answers requests by calling the phase methods in their legal order.
// Knows no socket and no thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "estuary/v1/protocol.pb.h"
#include "participant.hpp"

namespace estuary {

/// The most memory this process has held. Asked of the system at most every tenth of a second: a window may
/// last no longer than the question.
class PeakMemory {
public:
  [[nodiscard]] std::uint64_t bytes();

private:
  std::chrono::steady_clock::time_point asked_;
  std::uint64_t bytes_ = 0;
};

class Session {
public:
  /// `confined`: scenes may name files below `folder` only, because they come from elsewhere.
  Session(Participant& participant, std::filesystem::path folder, ProgressBoard& board,
          bool confined = false);

  /// Carries out one request (any but Hello) and says how it went. Never throws: whatever the phase method
  /// throws becomes an Error.
  v1::Reply answer(const v1::Request& request);

  [[nodiscard]] bool stopped() const { return stopped_; }

private:
  v1::Reply carry_out(const v1::Request& request);
  void advance(const v1::Request& request, v1::Reply& reply);
  void save(const std::string& name, v1::Done& done);
  void load(const v1::Load& request);
  void require_started(const char* phase) const;
  [[nodiscard]] std::filesystem::path inside_folder(const std::string& file) const;

  Participant& participant_;
  std::filesystem::path folder_;
  ProgressBoard& board_;
  bool confined_;
  bool configured_ = false;
  bool started_ = false;
  bool advanced_ = false;  // since the last accept
  bool stopped_ = false;
  double compute_seconds_ = 0;
  PeakMemory peak_memory_;
};

/// The answer to Configure, also used by --check. Files that the scene names lie below `files_below`, where
/// there is such a folder.
v1::Configured configure(Participant& participant, const v1::Configure& request,
                         const std::optional<std::filesystem::path>& files_below = {});

}  // namespace estuary
