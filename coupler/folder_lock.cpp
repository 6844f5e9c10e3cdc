#include "folder_lock.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

#include <fmt/format.h>

namespace estuary::coupler {

FolderLock::FolderLock(const std::filesystem::path& folder, Kind kind, const char* what) {
  const auto path = folder / "run.lock";
  descriptor_ = ::open(path.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0644);
  if (descriptor_ < 0)
    throw std::runtime_error(fmt::format("cannot write {}: {}", path.string(), std::strerror(errno)));
  if (::flock(descriptor_, (kind == Kind::alone ? LOCK_EX : LOCK_SH) | LOCK_NB) == 0) return;
  ::close(descriptor_);
  throw std::runtime_error(
      fmt::format("another {} writes into {}; give another folder with --out", what, folder.string()));
}

FolderLock::~FolderLock() {
  ::close(descriptor_);
}

}  // namespace estuary::coupler
