#include "whole_file.hpp"

#include <fmt/format.h>

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace estuary::coupler {

void write_whole(const std::filesystem::path& file, std::string_view text) {
  auto temporary = file;
  temporary += ".part";
  std::ofstream stream(temporary, std::ios::binary);
  stream << text;
  stream.close();
  std::error_code error;
  if (stream) std::filesystem::rename(temporary, file, error);
  if (!stream || error)
    throw std::runtime_error(fmt::format("{} cannot be written: is the disk full?", file.string()));
}

std::string read_whole(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  if (stream) text << stream.rdbuf();
  return text.str();
}

}  // namespace estuary::coupler
