// Work for a team of threads, or for the calling thread alone.
#pragma once

namespace estuary {

/// Calls `work` once on each thread of a team where `worth_a_team`, else once, right here, outside any team.
/// Inside, `#pragma omp for` shares a loop out. An `if` clause that is false, or a team of one, is not the
/// same: it makes a team all the same, whose barriers each call into the system (libgomp wakes nobody), which
/// costs a small body as much time as its step.
template <class Work>
void on_team(bool worth_a_team, Work&& work) {
  if (!worth_a_team) {
    work();
    return;
  }
#pragma omp parallel
  work();
}

/// The same with a team of `threads`.
template <class Work>
void on_team_of(int threads, Work&& work) {
  if (threads <= 1) {
    work();
    return;
  }
#pragma omp parallel num_threads(threads)
  work();
}

}  // namespace estuary
