// Holds a folder of results for one process, so that two runs do not write over each other.
#pragma once

#include <filesystem>

namespace estuary::coupler {

class FolderLock {
public:
  enum class Kind {
    alone,
    together  // with others of this kind: the tasks of a job array, of which each has its own part of a study
  };

  /// The folder exists. Throws std::runtime_error when another process holds it (`what` is said of it, as in
  /// "another run writes into ..."), or it cannot be written to. The lock ends with the process at the
  /// latest.
  FolderLock(const std::filesystem::path& folder, Kind kind, const char* what);
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;
  ~FolderLock();

private:
  int descriptor_ = -1;
};

}  // namespace estuary::coupler
