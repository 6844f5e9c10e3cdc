// Inside of the scene reader: the parsed document, and the checks on one value of it. Each check notes what
// is wrong, with its place, and gives back something to go on with.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "scene.hpp"
#include "toml.hpp"

namespace estuary::detail {

struct SceneNode {
  std::string path;
  const toml::table* table = nullptr;  // null when the scene lacks it
  std::vector<std::string> known;      // keys asked for, in that order
  std::set<std::string, std::less<>> left_to_others;
  std::map<std::string, std::shared_ptr<SceneNode>, std::less<>> children;  // "key" or "key.3"
};

struct SceneDocument {
  std::string name;
  std::string text;
  std::vector<std::string> overrides;  // those that were applied
  toml::table root;
  toml::source_path_ptr source;  // tells nodes of the file from those of overrides
  std::shared_ptr<SceneNode> root_node;
  std::optional<std::filesystem::path> files_below;  // the only folder whose files may be read
  std::vector<SceneProblem> problems;                // in the order of the file, those without a place last
};

/// What a value is, in words: "the integer 3", "an array of 2 values".
std::string found(const toml::node& node);
/// At most sixty bytes of `text`, without cutting a character in two.
std::string shortened(std::string_view text);
/// "in [fluid.sides]" or "at the top of the scene".
std::string in_table(const SceneNode& node);

/// Adds a problem in the order of the file, once.
void note(SceneDocument& document, SceneProblem problem);
/// The same at a place of the file or of an override.
void note_at(SceneDocument& document, const toml::source_region& region, std::string message);
void note_at(SceneDocument& document, const SceneNode& node, std::string message);
/// Notes that the value called `what` is of another type than `expected`.
void wrong_type(SceneDocument& document, const toml::node& value, std::string_view what,
                const SceneNode& node, std::string_view expected);

/// The value of `key`, which is known from now on; null when absent.
const toml::node* ask(SceneNode& node, std::string_view key);
/// As `ask`, and notes a problem when the key is absent. Silent in a table that is itself absent, because
/// that was noted already.
const toml::node* require(SceneDocument& document, SceneNode& node, std::string_view key,
                          std::string_view expected);

/// A value in `range` to go on with after a problem was noted.
double usable(Range range);
std::optional<double> finite_number(SceneDocument& document, const toml::node& value, std::string_view what,
                                    const SceneNode& node, std::string_view expected);
double number_in(SceneDocument& document, const toml::node& value, std::string_view key,
                 const SceneNode& node, Range range);
std::int64_t integer_in(SceneDocument& document, const toml::node& value, std::string_view key,
                        const SceneNode& node, std::int64_t minimum, std::int64_t maximum);
/// The array in `value` when it has `size` entries (any number when 0), else null.
const toml::array* array_of(SceneDocument& document, const toml::node& value, std::string_view what,
                            const SceneNode& node, std::size_t size, std::string_view expected);
std::string expression_in(SceneDocument& document, const toml::node& value, std::string_view what,
                          const SceneNode& node);

}  // namespace estuary::detail
