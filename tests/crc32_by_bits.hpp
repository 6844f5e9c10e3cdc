// The checksum as ISO-HDLC defines it (reflected polynomial 0xedb88320), bit by bit and without zlib: what
// the readers' own, which is zlib's, is compared with.
#pragma once

#include <cstdint>
#include <string_view>

namespace estuary {

inline std::uint32_t crc32_by_bits(std::string_view bytes) {
  std::uint32_t crc = 0xffffffffU;
  for (const char byte : bytes) {
    crc ^= static_cast<unsigned char>(byte);
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1U) ^ ((crc & 1U) != 0 ? 0xedb88320U : 0U);
  }
  return ~crc;
}

}  // namespace estuary
