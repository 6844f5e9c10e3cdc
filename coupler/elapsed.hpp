#pragma once

#include <chrono>

namespace estuary::coupler {

/// Wall time [s].
inline double seconds_since(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

}  // namespace estuary::coupler
