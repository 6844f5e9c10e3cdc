#include "participant.hpp"

namespace estuary {

void ProgressBoard::report(double fraction, std::string_view note) {
  const std::lock_guard lock(mutex_);
  last_.fraction = fraction;
  last_.note = note;
  ++last_.counter;
}

ProgressBoard::Snapshot ProgressBoard::snapshot() const {
  const std::lock_guard lock(mutex_);
  return last_;
}

void ProgressBoard::begin_phase(std::string_view phase) {
  const std::lock_guard lock(mutex_);
  last_.phase = phase;
  last_.fraction = -1;
  last_.note.clear();
  ++last_.counter;
}

}  // namespace estuary
