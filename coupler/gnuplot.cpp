#include "gnuplot.hpp"

#include <fmt/format.h>

#include <stdexcept>
#include <utility>

#include "child_process.hpp"

namespace estuary::coupler {

std::optional<Gnuplot> Gnuplot::find() {
  auto program = find_program("gnuplot");
  if (!program) return std::nullopt;
  return Gnuplot(std::move(*program));
}

std::string Gnuplot::quoted(std::string_view text) {
  std::string result = "'";
  for (const char c : text) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7f) {
      result += ' ';
    } else {
      result += c;
      if (c == '\'') result += c;
    }
  }
  return result + "'";
}

void Gnuplot::draw(const std::filesystem::path& picture, const std::string& terminal,
                   const std::string& script) const {
  constexpr double patience_s = 60;
  // Names and titles are shown as they are: without "noenhanced" an underscore would make a subscript.
  const auto whole =
      fmt::format("set encoding utf8\nset terminal {} noenhanced\nset output {}\n{}\nunset output\n",
                  terminal, quoted(picture.string()), script);
  const auto finished = run_program({program_.string(), "-d"}, whole, patience_s);
  std::error_code error;
  if (finished.status != 0 || std::filesystem::file_size(picture, error) == 0 || error) {
    std::filesystem::remove(picture, error);
    throw std::runtime_error(fmt::format("gnuplot could not draw {}: {}", picture.filename().string(),
                                         finished.errors.empty() ? "it left no picture" : finished.errors));
  }
}

}  // namespace estuary::coupler
