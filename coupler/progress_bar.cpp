#include "progress_bar.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace estuary::coupler {
namespace {

using std::chrono::steady_clock;
constexpr int bar_width = 20;
constexpr double say_who_after = 5.0;  // [s]

std::string duration_text(double seconds) {
  if (!std::isfinite(seconds) || seconds > 360000) return "?";
  const auto whole = static_cast<long>(std::lround(seconds));
  if (whole < 60) return fmt::format("{} s", whole);
  if (whole < 3600) return fmt::format("{}:{:02} min", whole / 60, whole % 60);
  return fmt::format("{}:{:02} h", whole / 3600, whole / 60 % 60);
}

}  // namespace

ProgressBar::ProgressBar(const CouplingScene& scene)
    : scene_(scene),
      terminal_(::isatty(STDERR_FILENO) != 0),
      begin_(steady_clock::now()),
      last_drawn_(begin_) {}

ProgressBar::~ProgressBar() {
  clear();
}

void ProgressBar::clear() {
  if (terminal_ && drawn_) fmt::print(stderr, "\r\033[K");
  drawn_ = false;
}

void ProgressBar::residual(double value) {
  if (position_.iteration <= 1) first_residual_ = value;
  last_residual_ = value;
}

double ProgressBar::fraction_done(double inside) const {
  if (scene_.mode == CouplingMode::transient) {
    if (position_.window == 0) return 0;  // still starting
    return (static_cast<double>(position_.window) - 1 + std::clamp(inside, 0.0, 1.0) * 0.5) /
           static_cast<double>(scene_.windows);
  }
  if (scene_.participants.size() == 1) return std::clamp(inside, 0.0, 1.0);
  // The residual falls about geometrically: the part done of its way down to the tolerance.
  double limit = 0;
  for (const Measure& measure : scene_.measures) {
    if (measure.field == Field::displacement && measure.kind == MeasureKind::relative) limit = measure.limit;
  }
  if (position_.iteration < 2 || !(last_residual_ > 0) || !(limit > 0 && first_residual_ > limit)) return 0;
  return std::clamp(std::log(first_residual_ / last_residual_) / std::log(first_residual_ / limit), 0.0, 1.0);
}

void ProgressBar::waiting(const RemoteParticipant& participant, const char* phase, double seconds) {
  const auto now = steady_clock::now();
  const auto pause = terminal_ ? std::chrono::milliseconds(200) : std::chrono::milliseconds(10000);
  if (now - last_drawn_ < pause) return;
  last_drawn_ = now;
  const double inside = participant.progress().fraction();
  const double done = fraction_done(inside);
  const double elapsed = std::chrono::duration<double>(now - begin_).count();
  std::string line =
      fmt::format("[{:<{}}] {:3.0f} %", std::string(static_cast<std::size_t>(done * bar_width), '='),
                  bar_width, 100 * done);
  line += fmt::format("  ETA {}", done > 0.02 ? duration_text(elapsed * (1 - done) / done) : "?");
  if (scene_.mode == CouplingMode::transient)
    line += fmt::format("  window {}/{}", position_.window, scene_.windows);
  if (scene_.participants.size() > 1) line += fmt::format("  iteration {}", position_.iteration);
  if (last_residual_ > 0) line += fmt::format("  residual {:.1e}", last_residual_);
  line += fmt::format("  {}: {}", participant.role(), phase);
  if (inside >= 0 && inside <= 1) line += fmt::format(" {:.0f} %", 100 * inside);
  if (!participant.progress().note().empty()) line += fmt::format(" ({})", participant.progress().note());
  if (seconds > say_who_after) {
    line += fmt::format("  waiting for {} at {} for {}", participant.role(), participant.channel().endpoint(),
                        duration_text(seconds));
  }
  fmt::print(stderr, "{}{}{}", terminal_ ? "\r\033[K" : "", line, terminal_ ? "" : "\n");
  std::fflush(stderr);
  drawn_ = true;
}

}  // namespace estuary::coupler
