// A participant that computes nothing: it answers as another one did in a recorded run, so that its partner
// can be tested alone.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "participant.hpp"
#include "record_file.hpp"

namespace estuary {

/// What is answered to an iteration that was not recorded.
enum class Beyond {
  refuse,   // an error that names window and iteration
  accepted  // what was accepted in that window; so every iteration of a window gets the same answer
};

class Replay final : public Participant {
public:
  /// Throws std::runtime_error when the file is no record of a run that got as far as Start.
  Replay(const std::filesystem::path& record, Beyond beyond);

  [[nodiscard]] Identity identity() const override;
  Plan configure(Scene& scene, const std::string& role) override;
  /// Throws BadInput when the surface has another number of nodes than the recorded one.
  v1::Exchange start(const v1::Exchange& initial, const std::filesystem::path& folder) override;
  [[nodiscard]] std::optional<double> window_step() const override;
  /// Throws BadInput, naming both, when time, length of the window, or the number of values of an input are
  /// not as recorded; what the recorded participant threw when it failed there.
  AdvanceResult advance(const Window& window, const v1::Exchange& inputs, ProgressBoard& progress) override;
  void accept() override {}
  void save(const std::filesystem::path& file) override;
  void load(const std::filesystem::path& file) override;
  std::vector<std::string> frame(std::uint64_t /*number*/, double /*time*/) override { return {}; }
  /// Says in the log how far the inputs were from the recorded ones.
  void stop() override;

  /// Largest relative L2 difference of an input from the recorded one; 0: the same bits.
  [[nodiscard]] double largest_difference() const { return largest_difference_; }

private:
  [[nodiscard]] RecordReader::Entry entry_of(const Window& window);
  void compare(const Window& window, const v1::Exchange& inputs, const v1::Exchange& recorded);

  RecordReader reader_;
  Beyond beyond_;
  v1::Welcome welcome_;
  std::string role_;
  v1::Configured configured_;
  v1::Start start_;
  v1::Started started_;
  // Window -> where the entries of its iterations begin.
  std::map<std::uint64_t, std::map<std::uint64_t, std::uint64_t>> entries_;
  double largest_difference_ = 0;
  std::uint64_t different_window_ = 0;  // where it was largest
  std::uint64_t answered_ = 0;
};

}  // namespace estuary
