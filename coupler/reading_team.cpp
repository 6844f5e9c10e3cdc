#include "reading_team.hpp"

#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <csignal>
#include <exception>

namespace estuary::coupler {
namespace {

int processors_of_this_process() {
  cpu_set_t mask;
  CPU_ZERO(&mask);
  if (::sched_getaffinity(0, sizeof mask, &mask) != 0) return 1;
  return CPU_COUNT(&mask);
}

}  // namespace

ReadingTeam::ReadingTeam(int threads)
    : threads_(threads > 0 ? threads : std::min(4, processors_of_this_process())) {}

ReadingTeam::~ReadingTeam() {
  {
    const std::lock_guard lock(mutex_);
    stop_ = true;
  }
  begin_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

void ReadingTeam::start() {
  sigset_t all, before;
  sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);  // a thread inherits the mask
  try {
    while (helpers_.size() + 1 < static_cast<std::size_t>(threads_))
      helpers_.emplace_back([this] { wait_for_jobs(); });
  } catch (const std::exception&) {
    threads_ = static_cast<int>(helpers_.size()) + 1;  // no thread or no memory for it: fewer will do
  }
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
}

void ReadingTeam::run(const Job& job) {
  if (helpers_.empty()) start();
  {
    const std::lock_guard lock(mutex_);
    job_ = job;
    next_ = 0;
    open_ = true;
    ++jobs_;
  }
  begin_.notify_all();
  take_part(job);
  std::unique_lock lock(mutex_);
  open_ = false;
  end_.wait(lock, [this] { return inside_ == 0; });
}

void ReadingTeam::take_part(const Job& job) {
  for (std::size_t k = next_++; k < job.count; k = next_++) job.call(job.work, k);
}

void ReadingTeam::wait_for_jobs() {
  std::unique_lock lock(mutex_);
  for (unsigned seen = 0;;) {
    begin_.wait(lock, [&] { return stop_ || (open_ && jobs_ != seen); });
    if (stop_) return;
    seen = jobs_;
    const Job job = job_;
    ++inside_;
    lock.unlock();
    take_part(job);
    lock.lock();
    if (--inside_ == 0) end_.notify_one();
  }
}

}  // namespace estuary::coupler
