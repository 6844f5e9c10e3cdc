// The plotting program, run as a process of its own that is given a script on its standard input.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>

namespace estuary::coupler {

class Gnuplot {
public:
  /// Nothing when the program is not installed.
  static std::optional<Gnuplot> find();

  /// Draws `picture` with a script that has set neither terminal nor output; `terminal` is gnuplot's
  /// description of the kind and size of the picture. Throws std::runtime_error with gnuplot's own words when
  /// it fails.
  void draw(const std::filesystem::path& picture, const std::string& terminal,
            const std::string& script) const;

  /// `text` as a string in a script: quoted, without control characters.
  static std::string quoted(std::string_view text);

private:
  explicit Gnuplot(std::filesystem::path program) : program_(std::move(program)) {}
  std::filesystem::path program_;
};

}  // namespace estuary::coupler
