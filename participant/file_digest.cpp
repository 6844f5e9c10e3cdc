#include "file_digest.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <fstream>
#include <memory>
#include <stdexcept>

namespace estuary {

std::uint32_t crc32_of(const void* data, std::size_t size) {
  return static_cast<std::uint32_t>(::crc32_z(0, static_cast<const Bytef*>(data), size));
}

FileSum sum_of_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error(fmt::format("{}: cannot be read", file.string()));
  constexpr std::size_t most = std::size_t{1} << 16;
  const auto piece = std::make_unique_for_overwrite<char[]>(most);
  FileSum sum;
  uLong crc = ::crc32_z(0, nullptr, 0);
  while (stream) {
    stream.read(piece.get(), std::streamsize{most});
    const auto count = static_cast<std::size_t>(stream.gcount());
    crc = ::crc32_z(crc, reinterpret_cast<const Bytef*>(piece.get()), count);
    sum.bytes += count;
  }
  if (stream.bad()) throw std::runtime_error(fmt::format("{}: cannot be read to its end", file.string()));
  sum.crc32 = static_cast<std::uint32_t>(crc);
  return sum;
}

void require_sum(const std::filesystem::path& file, const FileSum& expected) {
  const FileSum found = sum_of_file(file);
  if (found.bytes != expected.bytes)
    throw std::runtime_error(fmt::format("{}: is damaged: {} bytes where {} were written", file.string(),
                                         found.bytes, expected.bytes));
  if (found.crc32 != expected.crc32)
    throw std::runtime_error(fmt::format("{}: is damaged: its checksum is {:08x}, not {:08x}", file.string(),
                                         found.crc32, expected.crc32));
}

}  // namespace estuary
