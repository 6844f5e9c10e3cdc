#include "atomic_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>

namespace estuary {

namespace {

[[noreturn]] void fail(const std::filesystem::path& file, const char* what, int error) {
  throw std::runtime_error(
      fmt::format("{}: {}: {}", file.string(), what, std::generic_category().message(error)));
}

/// A new file that disappears again unless it was kept.
class TemporaryFile {
public:
  explicit TemporaryFile(std::filesystem::path path)
      : path_(std::move(path)),
        descriptor_(::open(path_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666)) {
    if (descriptor_ < 0) fail(path_, "cannot be created", errno);
  }
  TemporaryFile(const TemporaryFile&) = delete;
  TemporaryFile& operator=(const TemporaryFile&) = delete;
  ~TemporaryFile() {
    if (descriptor_ >= 0) ::close(descriptor_);
    std::error_code ignored;
    if (!kept_) std::filesystem::remove(path_, ignored);
  }

  void write(std::span<const std::byte> content) {
    constexpr std::size_t largest_piece = std::size_t{1} << 30;  // Linux writes no more than 2 GB at once
    while (!content.empty()) {
      const auto written = ::write(descriptor_, content.data(), std::min(content.size(), largest_piece));
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) fail(path_, "cannot be written", errno);
      content = content.subspan(static_cast<std::size_t>(written));
    }
    if (::fsync(descriptor_) != 0) fail(path_, "cannot be brought to the disk", errno);
    if (::close(std::exchange(descriptor_, -1)) != 0) fail(path_, "cannot be closed", errno);
  }

  void keep_as(const std::filesystem::path& file) {
    std::error_code error;
    std::filesystem::rename(path_, file, error);
    if (error) fail(file, "cannot be put in place", error.value());
    kept_ = true;
    // The new name is on the disk too once its folder is.
    const auto folder = file.has_parent_path() ? file.parent_path() : std::filesystem::path(".");
    const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor < 0) return;
    ::fsync(descriptor);
    ::close(descriptor);
  }

private:
  std::filesystem::path path_;
  int descriptor_;
  bool kept_ = false;
};

}  // namespace

void write_atomically(const std::filesystem::path& file, std::span<const std::byte> content) {
  auto temporary_name = file;
  temporary_name += ".part";
  TemporaryFile temporary(temporary_name);
  temporary.write(content);
  temporary.keep_as(file);
}

}  // namespace estuary
