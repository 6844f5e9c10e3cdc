#include "line_watch.hpp"

#include <sched.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "channel.hpp"

namespace estuary {
namespace {

using std::chrono::microseconds;
using std::chrono::steady_clock;

// The longest wait that is spent awake: to be woken after it costs a few hundredths of it.
constexpr microseconds stays_awake{1500};
// A processor that was given up for longer than this was wanted by another thread.
constexpr microseconds wanted_by_another{25};
// A message that was there for longer than this before it was seen.
constexpr microseconds late{100};
// How often a wait on memory looks at descriptors.
constexpr microseconds looks_at_descriptors{100};

bool any_arrived(std::span<DirectLine* const> lines) {
  return std::any_of(lines.begin(), lines.end(), [](const DirectLine* line) { return line->has_arrived(); });
}

bool all_through_memory(std::span<DirectLine* const> lines) {
  return !lines.empty() &&
         std::all_of(lines.begin(), lines.end(), [](DirectLine* line) { return line->memory() != nullptr; });
}

bool processor_to_spare(std::span<DirectLine* const> lines) {
  return std::all_of(lines.begin(), lines.end(), [](DirectLine* line) {
    return line->memory() != nullptr && line->memory()->processor_to_spare();
  });
}

bool came_late(std::span<DirectLine* const> lines) {
  return std::any_of(lines.begin(), lines.end(), [](DirectLine* line) {
    return line->memory() != nullptr && line->memory()->readable() && line->memory()->age() > late;
  });
}

bool look(std::span<pollfd> watched, int milliseconds) {
  const int ready = ::poll(watched.data(), watched.size(), milliseconds);
  if (ready < 0 && errno != EINTR) throw ChannelError(std::strerror(errno));
  return ready > 0;
}

}  // namespace

Asleep::Asleep(std::span<DirectLine* const> lines) : lines_(lines) {
  for (DirectLine* line : lines_)
    if (line->memory() != nullptr) line->memory()->say_asleep();
}

Asleep::~Asleep() {
  for (DirectLine* line : lines_)
    if (line->memory() != nullptr) line->memory()->say_awake();
}

void LineWatch::sleep_through_some(const Care& care) {
  sleeps_next_ = std::min(2 * sleeps_next_ + care.first_sleeps, care.most_sleeps);
  sleeps_left_ = sleeps_next_;
}

bool LineWatch::wait_awake(std::span<pollfd> watched, std::span<DirectLine* const> lines,
                           steady_clock::time_point begin) {
  const bool in_memory = all_through_memory(lines);
  // Teams of threads that use all processors lose more by somebody awake than the messages gain. Elsewhere
  // the thread that wants the processor may be the one that is waited for: once in a wait this is no reason.
  const Care care = processor_to_spare(lines)
                        ? Care{.may_be_wanted = 1, .first_sleeps = 2, .most_sleeps = 256}
                        : Care{.may_be_wanted = 0, .first_sleeps = 16, .most_sleeps = 2000};
  int wanted = 0;
  auto looked = begin;
  for (auto now = begin; now - begin < stays_awake;) {
    const auto before = now;
    ::sched_yield();
    now = steady_clock::now();
    if (any_arrived(lines)) {
      if (came_late(lines)) sleep_through_some(care);
      return true;
    }
    if (!in_memory || now - looked > looks_at_descriptors) {
      if (look(watched, 0)) return true;
      looked = now;
    }
    if (now - before > wanted_by_another && ++wanted > care.may_be_wanted) {
      sleep_through_some(care);
      return false;
    }
  }
  return false;
}

bool LineWatch::wait(std::span<pollfd> watched, std::span<DirectLine* const> lines,
                     std::optional<std::chrono::milliseconds> timeout) {
  for (pollfd& each : watched) each.revents = 0;
  const auto begin = steady_clock::now();
  bool ready = any_arrived(lines);
  if (!ready && !all_through_memory(lines)) ready = look(watched, 0);
  if (!ready && last_ <= stays_awake && sleeps_left_ == 0) {
    ready = wait_awake(watched, lines, begin);
    if (ready && sleeps_left_ == 0) sleeps_next_ = 0;
  } else if (sleeps_left_ > 0) {
    --sleeps_left_;
  }
  if (!ready) {
    const Asleep asleep(lines);
    ready = any_arrived(lines) || look(watched, timeout ? static_cast<int>(timeout->count()) : -1);
    for (DirectLine* line : lines) {
      const bool rung = std::any_of(watched.begin(), watched.end(), [&](const pollfd& each) {
        return each.fd == line->descriptor() && each.revents != 0;
      });
      if (rung && line->memory() != nullptr) line->take_rings();
    }
  }
  last_ = steady_clock::now() - begin;
  return ready;
}

}  // namespace estuary
