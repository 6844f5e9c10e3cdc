// Reads a scene: one TOML file, SI units, snake_case keys.
//
// Every problem is collected with its line and column, so that a person sees all of them at once; nothing is
// thrown for a bad value. A key that nobody read is an error that names the nearest known key.
// A reader asks for each key by name and gets a usable value back even after a problem was noted, so that
// reading can go on; what was read counts only when `problems()` is empty in the end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace estuary {

/// One thing wrong with a scene. Line and column count from 1; 0 when it has no place in the file.
struct SceneProblem {
  std::uint32_t line = 0;
  std::uint32_t column = 0;
  std::string message;
};

/// Allowed range of a number; the bounds themselves are allowed unless `exclusive`.
struct Range {
  double minimum = -std::numeric_limits<double>::infinity();
  double maximum = std::numeric_limits<double>::infinity();
  bool exclusive = false;

  static Range positive() { return {0.0, std::numeric_limits<double>::infinity(), true}; }
  static Range not_negative() { return {0.0, std::numeric_limits<double>::infinity(), false}; }
  static Range any() { return {}; }
};

namespace detail {
struct SceneDocument;  // the parsed file and the problems found so far
struct SceneNode;      // one table of it and the keys asked for
}  // namespace detail

/// One table of a scene. Cheap to copy; all copies note problems and known keys in the same place.
class SceneTable {
public:
  /// Dotted path from the root, "fluid.sides.left"; empty for the root.
  [[nodiscard]] const std::string& path() const;
  [[nodiscard]] bool has(std::string_view key) const;

  // Required values: a missing key is a problem.
  double number(std::string_view key, Range range = Range::any());
  std::int64_t integer(std::string_view key, std::int64_t minimum, std::int64_t maximum);
  std::string text(std::string_view key);
  /// Numbers of an array of exactly `size` entries (any size when 0).
  std::vector<double> numbers(std::string_view key, std::size_t size);
  /// A list of points: an array of arrays of `dimension` numbers each, given back interleaved.
  std::vector<double> points(std::string_view key, std::size_t dimension);
  /// A number, or a string holding a muParser expression; given back as the expression's text.
  std::string expression(std::string_view key);
  std::vector<std::string> expressions(std::string_view key, std::size_t size);
  SceneTable table(std::string_view key);

  // Optional values with their default.
  double number_or(std::string_view key, double fallback, Range range = Range::any());
  std::int64_t integer_or(std::string_view key, std::int64_t fallback, std::int64_t minimum,
                          std::int64_t maximum);
  bool boolean_or(std::string_view key, bool fallback);
  std::string text_or(std::string_view key, std::string_view fallback);
  /// One of `allowed`; the first entry is the default. Another word is a problem that lists them.
  std::string choice(std::string_view key, std::span<const std::string_view> allowed);
  std::vector<std::string> texts_or_empty(std::string_view key);
  /// Name of a file to be read: as it is, or, in a scene whose files are confined, with its folder. Empty
  /// after a problem, which is also what a file outside of that folder is.
  std::string file(std::string_view key);
  std::optional<SceneTable> table_if(std::string_view key);
  /// Entries of an array of tables ([[key]]); empty when absent.
  std::vector<SceneTable> tables(std::string_view key);

  /// Marks keys that another reader reads (the coupler's `solver`, say) as known here.
  void leave_to_others(std::initializer_list<std::string_view> keys);
  /// Notes a problem at the place of `key` (of the table itself when the key is absent or empty).
  void problem(std::string_view key, std::string message);
  /// Notes every key of this table and of all tables below it that was never asked for.
  void refuse_unknown_keys();
  /// Names of the keys present.
  [[nodiscard]] std::vector<std::string> keys() const;

private:
  friend class Scene;
  SceneTable(std::shared_ptr<detail::SceneDocument> document, std::shared_ptr<detail::SceneNode> node);
  std::shared_ptr<detail::SceneDocument> document_;
  std::shared_ptr<detail::SceneNode> node_;
};

/// A parsed scene. Malformed TOML leaves an empty root and one problem.
class Scene {
public:
  /// `name` is used in messages. `overrides` are "key.path=value" with a TOML value (a bare word counts as a
  /// string), applied in order; one that cannot be applied is a problem.
  static Scene parse(std::string_view text, std::string_view name,
                     std::span<const std::string> overrides = {});

  [[nodiscard]] SceneTable root() const;
  [[nodiscard]] const std::string& name() const;
  /// From now on the scene's tables name files below `folder` only, and relative to it: for a scene that
  /// comes from somebody who must not read what this process may read.
  void confine_files(const std::filesystem::path& folder);
  [[nodiscard]] const std::vector<SceneProblem>& problems() const;
  /// The scene with its overrides, as TOML text; the original text when there are none.
  [[nodiscard]] std::string as_run() const;
  /// The same in one canonical form, without the values at these dotted paths: equal for scenes that mean the
  /// same otherwise.
  [[nodiscard]] std::string canonical(std::span<const std::string_view> without) const;

private:
  std::shared_ptr<detail::SceneDocument> document_;
};

/// "scene.toml:12:5: message", without the numbers that are 0.
std::string describe(std::string_view scene_name, const SceneProblem& problem);

/// The entry of `known` nearest to `word` by edit distance, when it is near enough to be a slip.
std::optional<std::string> nearest_name(std::string_view word, std::span<const std::string> known);

}  // namespace estuary
