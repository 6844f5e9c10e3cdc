// Which rows of nodes, or groups of blocks (blocks.hpp), a thread steps.
#pragma once

#include <omp.h>

namespace estuary::fluid {

struct RowShare {
  int begin = 0;
  int end = 0;
};

/// Of the calling thread, in its parallel region, of so many rows or groups: as `omp for schedule(static)`
/// shares them out, but known.
[[nodiscard]] inline RowShare row_share(int rows) {
  const int threads = omp_get_num_threads();
  const int thread = omp_get_thread_num();
  const int whole = rows / threads;
  const int more = rows % threads;
  const int begin = thread * whole + (thread < more ? thread : more);
  return {begin, begin + whole + (thread < more ? 1 : 0)};
}

/// Of the rows begin <= row < end.
[[nodiscard]] inline RowShare row_share(int begin, int end) {
  const RowShare share = row_share(end - begin);
  return {begin + share.begin, begin + share.end};
}

}  // namespace estuary::fluid
