// Grey images, as maps of what is solid.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string_view>
#include <vector>

namespace estuary {

/// Brightness 0 to 255, row by row from the top of the picture.
struct GreyImage {
  int width = 0;
  int height = 0;
  std::vector<std::uint8_t> values;
};

/// Reads a PNG (any kind) or a BMP (uncompressed, 1, 4, 8, 24 or 32 bits per pixel); colours become their
/// mean. Throws std::runtime_error naming the file and what is wrong with it.
[[nodiscard]] GreyImage read_grey_image(const std::filesystem::path& file);
/// The same of a file's content, wherever it is; `file` is its name in messages.
[[nodiscard]] GreyImage grey_image_of(std::string_view bytes, const std::filesystem::path& file);

}  // namespace estuary
