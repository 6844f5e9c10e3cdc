#include "image_file.hpp"

#include <fmt/format.h>
#include <png.h>

#include <cstring>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>

namespace estuary {
namespace {

constexpr std::uint64_t most_pixels = 1'000'000'000;

[[noreturn]] void refuse_image(const std::filesystem::path& file, const std::string& what) {
  throw std::runtime_error(fmt::format("{}: {}", file.string(), what));
}

std::string contents_of(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream) refuse_image(file, "cannot be opened");
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

GreyImage read_png(const std::filesystem::path& file, std::string_view bytes) {
  png_image image;
  std::memset(&image, 0, sizeof image);
  image.version = PNG_IMAGE_VERSION;
  if (png_image_begin_read_from_memory(&image, bytes.data(), bytes.size()) == 0)
    refuse_image(file, image.message);
  if (std::uint64_t{image.width} * image.height > most_pixels) {
    png_image_free(&image);
    refuse_image(file, "has too many pixels");
  }
  // Its compression shrinks by a thousand at most, and a pixel has at least one bit: a few bytes that claim
  // more would only make us ask for gigabytes.
  constexpr std::uint64_t most_pixels_per_byte = 8 * 1100;
  if (std::uint64_t{image.width} * image.height > most_pixels_per_byte * bytes.size()) {
    png_image_free(&image);
    refuse_image(file, "ends before its last row");
  }
  image.format = PNG_FORMAT_RGB;
  std::vector<std::uint8_t> colours(PNG_IMAGE_SIZE(image));
  const png_color white{255, 255, 255};  // behind what is transparent
  if (png_image_finish_read(&image, &white, colours.data(), 0, nullptr) == 0)
    refuse_image(file, image.message);
  GreyImage result{static_cast<int>(image.width), static_cast<int>(image.height), {}};
  result.values.reserve(colours.size() / 3);
  for (std::size_t k = 0; k + 2 < colours.size(); k += 3) {
    result.values.push_back(static_cast<std::uint8_t>((colours[k] + colours[k + 1] + colours[k + 2]) / 3));
  }
  return result;
}

class BmpReader {
public:
  BmpReader(const std::filesystem::path& file, std::string_view bytes) : file_(file), bytes_(bytes) {}

  GreyImage read() const {
    const std::uint32_t start = number(10, 4);
    const std::uint32_t header = number(14, 4);
    if (header < 40) refuse_image(file_, "has an old kind of BMP header: save it as a Windows BMP or a PNG");
    const auto width = static_cast<std::int32_t>(number(18, 4));
    const auto signed_height = static_cast<std::int32_t>(number(22, 4));
    const std::uint32_t bits = number(28, 2);
    const std::uint32_t compression = number(30, 4);
    const bool plain = compression == 0 || (compression == 3 && bits == 32);
    if (!plain || (bits != 1 && bits != 4 && bits != 8 && bits != 24 && bits != 32)) {
      refuse_image(
          file_, fmt::format(
                     "compression {} with {} bits per pixel cannot be read: save it uncompressed or as a PNG",
                     compression, bits));
    }
    // Rows from the bottom unless the height is negative.
    const bool from_top = signed_height < 0;
    const std::int64_t height = from_top ? -std::int64_t{signed_height} : std::int64_t{signed_height};
    if (width <= 0 || height <= 0 ||
        static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) > most_pixels) {
      refuse_image(file_, fmt::format("{} x {} pixels cannot be", width, signed_height));
    }
    const std::uint64_t pitch = (std::uint64_t{bits} * static_cast<std::uint64_t>(width) + 31) / 32 * 4;
    if (start + pitch * static_cast<std::uint64_t>(height) > bytes_.size())
      refuse_image(file_, "ends before its last row");
    GreyImage image{width, static_cast<int>(height), {}};
    image.values.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
    for (std::int64_t row = 0; row < height; ++row) {
      const std::int64_t from = from_top ? row : height - 1 - row;
      const std::size_t line = start + pitch * static_cast<std::size_t>(from);
      for (std::int32_t x = 0; x < width; ++x) {
        image.values[static_cast<std::size_t>(row * width + x)] =
            bits > 8 ? mean(line + static_cast<std::size_t>(x) * (bits / 8))
                     : from_palette(line, x, bits, header);
      }
    }
    return image;
  }

private:
  std::uint32_t number(std::size_t at, std::size_t count) const {
    if (at + count > bytes_.size()) refuse_image(file_, "ends inside its header");
    std::uint32_t value = 0;
    for (std::size_t k = 0; k < count; ++k)
      value |= std::uint32_t{static_cast<std::uint8_t>(bytes_[at + k])} << (8 * k);
    return value;
  }
  std::uint8_t mean(std::size_t at) const {
    return static_cast<std::uint8_t>((number(at, 1) + number(at + 1, 1) + number(at + 2, 1)) / 3);
  }
  std::uint8_t from_palette(std::size_t line, std::int32_t x, std::uint32_t bits,
                            std::uint32_t header) const {
    const auto column = static_cast<std::uint32_t>(x);
    const std::uint32_t per_byte = 8 / bits;
    const std::uint32_t byte = number(line + column / per_byte, 1);
    const std::uint32_t entry = (byte >> (8 - bits * (column % per_byte + 1))) & ((1U << bits) - 1);
    return mean(14 + header + 4 * std::size_t{entry});
  }

  const std::filesystem::path& file_;
  std::string_view bytes_;
};

}  // namespace

GreyImage read_grey_image(const std::filesystem::path& file) {
  return grey_image_of(contents_of(file), file);
}

GreyImage grey_image_of(std::string_view bytes, const std::filesystem::path& file) {
  if (bytes.starts_with("\x89PNG")) return read_png(file, bytes);
  if (bytes.starts_with("BM")) return BmpReader(file, bytes).read();
  refuse_image(file, "is neither a PNG nor a BMP");
}

}  // namespace estuary
