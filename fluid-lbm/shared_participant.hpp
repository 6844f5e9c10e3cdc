// A participant that several processes carry out together: the first one speaks to the coupler, the others do
// what it is told, call by call.
//
// Errors that follow from the input (a flow that diverged, a message that cannot be used) are the same on all
// ranks: they meet again at the next call, and the first rank's goes to the coupler. After any other, like
// memory that ended on one rank, the others may wait for what never comes: that rank says what happened and
// ends all processes, and the coupler sees a participant that was lost, with this line.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "participant.hpp"
#include "ranks.hpp"

namespace estuary::fluid {

/// Says why and ends the processes of all ranks.
using EndAll = std::function<void(const std::string& why)>;

/// The first rank's: tells the others of every call before it carries it out.
class SharedParticipant : public Participant {
public:
  /// `files_below`: the only folder whose files a scene may name, where it comes over the network.
  SharedParticipant(std::unique_ptr<Participant> own, Ranks& ranks, EndAll end_all,
                    const std::optional<std::filesystem::path>& files_below);
  ~SharedParticipant() override;

  void report_to(ProgressBoard& board) override { own_->report_to(board); }
  [[nodiscard]] Identity identity() const override { return own_->identity(); }
  Plan configure(Scene& scene, const std::string& role) override;
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& folder) override;
  [[nodiscard]] std::optional<double> window_step() const override { return own_->window_step(); }
  AdvanceResult advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) override;
  void accept() override;
  void save(const std::filesystem::path& file) override;
  void load(const std::filesystem::path& file) override;
  std::vector<std::string> frame(std::uint64_t number, double time) override;
  void stop() override;

private:
  // Carries out a call that files belong to.
  template <class Carry>
  void with_files(const Carry& carry);

  std::unique_ptr<Participant> own_;
  Ranks& ranks_;
  EndAll end_all_;
  std::string files_below_;  // empty: files may lie anywhere
  bool stopped_ = false;
};

/// Any other rank's: carries out what the first one tells, until it says that all is done.
void follow_first_rank(Participant& participant, Ranks& ranks, const EndAll& end_all);

}  // namespace estuary::fluid
