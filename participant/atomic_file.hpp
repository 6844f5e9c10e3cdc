// Puts a whole file in place at once: whoever looks at its name sees the older file or the newer one, never a
// part.
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>

namespace estuary {

/// Writes `content` under a temporary name next to `file` (which gets ".part" appended), brings it to the
/// disk and renames it. Throws std::runtime_error naming the file and the system's reason; the older file
/// then stays, and nothing temporary is left.
void write_atomically(const std::filesystem::path& file, std::span<const std::byte> content);

}  // namespace estuary
