// Work for a team of threads, or for the calling thread alone.
#pragma once

#include <omp.h>

#include <cassert>

namespace estuary {

/// Calls `work` once on each thread of a team of `threads`, or, when that is one, once, right here, outside
/// any team. Inside, `#pragma omp for` shares a loop out; counts are added by `omp atomic`
/// (clang takes no reduction on what a lambda captured). A team of one, or an `if` clause that is false, is
/// not the same: its barriers each call into the system (libgomp wakes nobody), which costs a small body as
/// much time as its step. Not for use inside a team: `omp for` would share the loop out among that one.
template <class Work>
void on_team_of(int threads, Work&& work) {
  assert(!omp_in_parallel());
  if (threads <= 1) {
    work();
    return;
  }
#pragma omp parallel num_threads(threads)
  work();
}

/// The same with all threads where `worth_a_team`, else with one.
template <class Work>
void on_team(bool worth_a_team, Work&& work) {
  on_team_of(worth_a_team ? omp_get_max_threads() : 1, work);
}

}  // namespace estuary
