// Small files, read and written whole.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>

namespace estuary::coupler {

/// Writes beside and renames, so that nobody reads half a file. Throws std::runtime_error when it cannot.
void write_whole(const std::filesystem::path& file, std::string_view text);

/// The content of a file; empty when it cannot be read.
std::string read_whole(const std::filesystem::path& file);

}  // namespace estuary::coupler
