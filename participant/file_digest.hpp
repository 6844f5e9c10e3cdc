// Size and checksum of a file, to tell later whether it is still the same.
#pragma once

#include <cstdint>
#include <filesystem>

namespace estuary {

struct FileSum {
  std::uint64_t bytes = 0;
  std::uint32_t crc32 = 0;  // that of zlib
  bool operator==(const FileSum&) const = default;
};

/// Reads the whole file. Throws std::runtime_error naming it when it cannot be read.
[[nodiscard]] FileSum sum_of_file(const std::filesystem::path& file);
[[nodiscard]] std::uint32_t crc32_of(const void* data, std::size_t size);

/// Throws std::runtime_error saying what is wrong when the file is not what it was.
void require_sum(const std::filesystem::path& file, const FileSum& expected);

}  // namespace estuary
