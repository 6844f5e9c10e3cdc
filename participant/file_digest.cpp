#include "file_digest.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <fstream>
#include <stdexcept>
#include <vector>

namespace estuary {

std::uint32_t crc32_of(const void* data, std::size_t size) {
  return static_cast<std::uint32_t>(::crc32_z(0, static_cast<const Bytef*>(data), size));
}

FileSum sum_of_file(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) throw std::runtime_error(fmt::format("{}: cannot be read", file.string()));
  std::vector<char> piece(std::size_t{1} << 20);
  FileSum sum;
  uLong crc = ::crc32_z(0, nullptr, 0);
  while (stream) {
    stream.read(piece.data(), static_cast<std::streamsize>(piece.size()));
    const auto count = static_cast<std::size_t>(stream.gcount());
    crc = ::crc32_z(crc, reinterpret_cast<const Bytef*>(piece.data()), count);
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
