// A few threads for passes over more memory than a cache holds, where one processor waits for it alone. While
// the coupler computes its participants wait for it, so that their processors are free, unless other runs
// have them.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <memory>
#include <mutex>
#include <thread>
#include <vector>

namespace estuary::coupler {

/// Threads that sleep between two calls (not OpenMP's, which would keep a processor from the participants
/// after each). They start with the first call that is worth it, and take no signals.
class ReadingTeam {
public:
  /// 0: as many as this process has processors, but no more than four. 1: the calling thread alone.
  explicit ReadingTeam(int threads);
  ~ReadingTeam();
  ReadingTeam(const ReadingTeam&) = delete;
  ReadingTeam& operator=(const ReadingTeam&) = delete;
  ReadingTeam(ReadingTeam&&) = delete;
  ReadingTeam& operator=(ReadingTeam&&) = delete;

  /// Calls `work(k)` once for each k below `count`, on the calling thread and on others that are free;
  /// returns when all is done. `values` is how many numbers are read in all: few are read by the calling
  /// thread alone. What `work` computes must not depend on the order of the calls; it must not throw.
  template <class Work>
  void for_each(std::size_t count, std::size_t values, const Work& work) {
    if (threads_ <= 1 || count < 2 || values < least_values) {
      for (std::size_t k = 0; k < count; ++k) work(k);
      return;
    }
    run({[](const void* object, std::size_t k) { (*static_cast<const Work*>(object))(k); }, &work, count});
  }

  /// Below this (1 MiB) waking another thread takes as long as reading.
  static constexpr std::size_t least_values = 131072;

private:
  struct Job {
    void (*call)(const void* work, std::size_t k) = nullptr;
    const void* work = nullptr;
    std::size_t count = 0;
  };
  void run(const Job& job);
  void take_part(const Job& job);
  void start();
  void wait_for_jobs();

  int threads_;
  std::vector<std::thread> helpers_;
  std::mutex mutex_;  // for all that follows but `next_`
  std::condition_variable begin_, end_;
  Job job_;
  std::atomic<std::size_t> next_{0};
  unsigned jobs_ = 0;  // begun so far
  bool open_ = false;  // who wakes late takes no part in what is over
  std::size_t inside_ = 0;
  bool stop_ = false;
};

}  // namespace estuary::coupler
