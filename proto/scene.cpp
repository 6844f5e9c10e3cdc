#include "scene.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>
#include <utility>

#include "scene_override.hpp"
#include "scene_values.hpp"

namespace estuary {

using namespace detail;  // NOLINT: this file is the outside of what lies in there

namespace {

constexpr std::size_t largest_text = std::size_t{64} << 20;
// All but tabulator and ends of lines.
constexpr std::string_view control_characters(
    "\0\1\2\3\4\5\6\7\10\13\14\16\17\20\21\22\23\24\25\26\27\30\31\32\33\34\35\36\37\177", 30);

std::shared_ptr<SceneNode> child(SceneNode& node, const std::string& key, const toml::table* table) {
  auto& entry = node.children[key];
  if (!entry) {
    entry = std::make_shared<SceneNode>();
    entry->path = node.path.empty() ? key : node.path + "." + key;
    entry->table = table;
  }
  return entry;
}

// toml++ (3.3) writes such keys without the quotes that they need, so that what a run keeps of its scene
// could not be read again.
void refuse_unwritable_keys(SceneDocument& document, const toml::node& node) {
  if (const auto* array = node.as_array()) {
    for (const auto& entry : *array) refuse_unwritable_keys(document, entry);
  } else if (const auto* table = node.as_table()) {
    for (auto&& [key, value] : *table) {
      if (key.str().find_first_of("'\t\n") != std::string_view::npos)
        note_at(document, key.source(), "a key has no apostrophes, tabulators and line breaks");
      refuse_unwritable_keys(document, value);
    }
  }
}

// Strings in quotation marks and on one line: of those that toml++ (3.3) writes over several lines it loses a
// line break at the beginning.
std::string text_of(const toml::table& root) {
  constexpr auto flags =
      toml::toml_formatter::default_flags &
      ~(toml::format_flags::allow_literal_strings | toml::format_flags::allow_multi_line_strings);
  std::ostringstream stream;
  stream << toml::toml_formatter(root, flags) << '\n';
  return stream.str();
}

void refuse_unknown(SceneDocument& document, const SceneNode& node) {
  if (node.table == nullptr) return;
  for (auto&& [key, value] : *node.table) {
    if (std::find(node.known.begin(), node.known.end(), key.str()) != node.known.end()) continue;
    std::string message = fmt::format("unknown key '{}' {}", key.str(), in_table(node));
    if (const auto near = nearest_name(key.str(), node.known)) {
      message += fmt::format("; did you mean '{}'?", *near);
    } else if (!node.known.empty() && node.known.size() <= 24) {
      message += fmt::format("; known here: {}", fmt::join(node.known, ", "));
    }
    note_at(document, key.source().path ? key.source() : value.source(), std::move(message));
  }
  for (const auto& [name, below] : node.children) {
    const auto key = std::string_view(name).substr(0, name.find('.'));
    if (!node.left_to_others.contains(key)) refuse_unknown(document, *below);
  }
}

}  // namespace

SceneTable::SceneTable(std::shared_ptr<detail::SceneDocument> document,
                       std::shared_ptr<detail::SceneNode> node)
    : document_(std::move(document)), node_(std::move(node)) {}

const std::string& SceneTable::path() const {
  return node_->path;
}

bool SceneTable::has(std::string_view key) const {
  return ask(*node_, key) != nullptr;
}

double SceneTable::number(std::string_view key, Range range) {
  const auto* value = require(*document_, *node_, key, "a number");
  return value == nullptr ? usable(range) : number_in(*document_, *value, key, *node_, range);
}

double SceneTable::number_or(std::string_view key, double fallback, Range range) {
  const auto* value = ask(*node_, key);
  return value == nullptr ? fallback : number_in(*document_, *value, key, *node_, range);
}

std::int64_t SceneTable::integer(std::string_view key, std::int64_t minimum, std::int64_t maximum) {
  const auto* value = require(*document_, *node_, key, "an integer");
  return value == nullptr ? std::clamp<std::int64_t>(1, minimum, maximum)
                          : integer_in(*document_, *value, key, *node_, minimum, maximum);
}

std::int64_t SceneTable::integer_or(std::string_view key, std::int64_t fallback, std::int64_t minimum,
                                    std::int64_t maximum) {
  const auto* value = ask(*node_, key);
  return value == nullptr ? fallback : integer_in(*document_, *value, key, *node_, minimum, maximum);
}

std::string SceneTable::text(std::string_view key) {
  const auto* value = require(*document_, *node_, key, "a string");
  if (value == nullptr) return {};
  if (const auto* text = value->as_string()) return text->get();
  wrong_type(*document_, *value, key, *node_, "a string");
  return {};
}

std::string SceneTable::text_or(std::string_view key, std::string_view fallback) {
  return ask(*node_, key) == nullptr ? std::string(fallback) : text(key);
}

bool SceneTable::boolean_or(std::string_view key, bool fallback) {
  const auto* value = ask(*node_, key);
  if (value == nullptr) return fallback;
  if (const auto* boolean = value->as_boolean()) return boolean->get();
  wrong_type(*document_, *value, key, *node_, "true or false");
  return fallback;
}

std::string SceneTable::choice(std::string_view key, std::span<const std::string_view> allowed) {
  const auto* value = ask(*node_, key);
  std::string first = allowed.empty() ? std::string() : std::string(allowed.front());
  if (value == nullptr) return first;
  const auto list = fmt::format("one of {}", fmt::join(allowed, ", "));
  const auto* text = value->as_string();
  if (text == nullptr) {
    wrong_type(*document_, *value, key, *node_, list);
    return first;
  }
  if (std::find(allowed.begin(), allowed.end(), text->get()) != allowed.end()) return text->get();
  const std::vector<std::string> names(allowed.begin(), allowed.end());
  const auto near = nearest_name(text->get(), names);
  wrong_type(*document_, *value, key, *node_,
             near ? fmt::format("{}; did you mean \"{}\"?", list, *near) : list);
  return first;
}

std::vector<double> SceneTable::numbers(std::string_view key, std::size_t size) {
  const auto expected =
      size == 0 ? std::string("an array of numbers") : fmt::format("an array of {} numbers", size);
  std::vector<double> result(size, 0.0);
  const auto* value = require(*document_, *node_, key, expected);
  const auto* array = value == nullptr ? nullptr : array_of(*document_, *value, key, *node_, size, expected);
  if (array == nullptr) return result;
  result.assign(array->size(), 0.0);
  for (std::size_t i = 0; i < array->size(); ++i) {
    result[i] = finite_number(*document_, *array->get(i), fmt::format("{}[{}]", key, i), *node_, "a number")
                    .value_or(0.0);
  }
  return result;
}

std::vector<double> SceneTable::points(std::string_view key, std::size_t dimension) {
  const auto expected = fmt::format("an array of points of {} numbers each", dimension);
  std::vector<double> result;
  const auto* value = require(*document_, *node_, key, expected);
  const auto* array = value == nullptr ? nullptr : array_of(*document_, *value, key, *node_, 0, expected);
  if (array == nullptr) return result;
  const auto one_point = fmt::format("a point of {} numbers", dimension);
  result.reserve(array->size() * dimension);
  for (std::size_t i = 0; i < array->size(); ++i) {
    const auto what = fmt::format("{}[{}]", key, i);
    const auto* point = array_of(*document_, *array->get(i), what, *node_, dimension, one_point);
    for (std::size_t c = 0; c < dimension; ++c) {
      result.push_back(point == nullptr ? 0.0
                                        : finite_number(*document_, *point->get(c),
                                                        fmt::format("{}[{}]", what, c), *node_, "a number")
                                              .value_or(0.0));
    }
  }
  return result;
}

std::string SceneTable::expression(std::string_view key) {
  const auto* value = require(*document_, *node_, key, "a number or an expression");
  return value == nullptr ? "0" : expression_in(*document_, *value, key, *node_);
}

std::vector<std::string> SceneTable::expressions(std::string_view key, std::size_t size) {
  const auto expected = size == 0 ? std::string("an array of numbers or expressions")
                                  : fmt::format("an array of {} numbers or expressions", size);
  std::vector<std::string> result(size, "0");
  const auto* value = require(*document_, *node_, key, expected);
  const auto* array = value == nullptr ? nullptr : array_of(*document_, *value, key, *node_, size, expected);
  if (array == nullptr) return result;
  result.resize(array->size());
  for (std::size_t i = 0; i < array->size(); ++i) {
    result[i] = expression_in(*document_, *array->get(i), fmt::format("{}[{}]", key, i), *node_);
  }
  return result;
}

std::vector<std::string> SceneTable::texts_or_empty(std::string_view key) {
  std::vector<std::string> result;
  const auto* value = ask(*node_, key);
  const auto* array =
      value == nullptr ? nullptr : array_of(*document_, *value, key, *node_, 0, "an array of strings");
  if (array == nullptr) return result;
  for (std::size_t i = 0; i < array->size(); ++i) {
    if (const auto* text = array->get_as<std::string>(i)) {
      result.push_back(text->get());
    } else {
      wrong_type(*document_, *array->get(i), fmt::format("{}[{}]", key, i), *node_, "a string");
    }
  }
  return result;
}

SceneTable SceneTable::table(std::string_view key) {
  const auto* value = require(*document_, *node_, key, "a table");
  const auto* table = value == nullptr ? nullptr : value->as_table();
  if (value != nullptr && table == nullptr) wrong_type(*document_, *value, key, *node_, "a table");
  return {document_, child(*node_, std::string(key), table)};
}

std::string SceneTable::file(std::string_view key) {
  std::string name = text(key);
  if (name.empty() || !document_->files_below) return name;
  // With every symbolic link followed: one may lead out again.
  std::error_code error;
  const auto folder = std::filesystem::weakly_canonical(*document_->files_below, error);
  if (!error) {
    const auto path = std::filesystem::weakly_canonical(folder / name, error);
    const auto [end, rest] = std::mismatch(folder.begin(), folder.end(), path.begin(), path.end());
    if (!error && end == folder.end() && rest != path.end()) return path.string();
  }
  problem(key,
          fmt::format("'{}' is not in the working folder of the participant ({}), the only place where a "
                      "scene that came over the network may name files: put it there",
                      detail::shortened(name), document_->files_below->string()));
  return {};
}

std::optional<SceneTable> SceneTable::table_if(std::string_view key) {
  if (ask(*node_, key) == nullptr) return std::nullopt;
  return table(key);
}

std::vector<SceneTable> SceneTable::tables(std::string_view key) {
  std::vector<SceneTable> result;
  const auto* value = ask(*node_, key);
  if (value == nullptr) return result;
  const auto expected =
      fmt::format("an array of tables, written [[{}]]",
                  node_->path.empty() ? std::string(key) : fmt::format("{}.{}", node_->path, key));
  const auto* array = array_of(*document_, *value, key, *node_, 0, expected);
  if (array == nullptr) return result;
  for (std::size_t i = 0; i < array->size(); ++i) {
    if (const auto* table = array->get_as<toml::table>(i)) {
      result.push_back(SceneTable(document_, child(*node_, fmt::format("{}.{}", key, i), table)));
    } else {
      wrong_type(*document_, *array->get(i), fmt::format("{}[{}]", key, i), *node_, "a table");
    }
  }
  return result;
}

void SceneTable::leave_to_others(std::initializer_list<std::string_view> keys) {
  for (const auto key : keys) {
    ask(*node_, key);
    node_->left_to_others.emplace(key);
  }
}

void SceneTable::problem(std::string_view key, std::string message) {
  const auto* value = key.empty() || node_->table == nullptr ? nullptr : node_->table->get(key);
  if (value != nullptr) {
    note_at(*document_, value->source(), std::move(message));
  } else {
    note_at(*document_, *node_, std::move(message));
  }
}

void SceneTable::refuse_unknown_keys() {
  refuse_unknown(*document_, *node_);
}

std::vector<std::string> SceneTable::keys() const {
  std::vector<std::string> result;
  if (node_->table == nullptr) return result;
  for (auto&& [key, value] : *node_->table) result.emplace_back(key.str());
  return result;
}

Scene Scene::parse(std::string_view text, std::string_view name, std::span<const std::string> overrides) {
  Scene scene;
  scene.document_ = std::make_shared<SceneDocument>();
  auto& document = *scene.document_;
  document.name = name.empty() ? "scene" : name;  // toml++ keeps no places for a nameless source
  document.text = text;
  document.root_node = std::make_shared<SceneNode>();
  document.root_node->table = &document.root;
  if (text.size() > largest_text) {
    note(document,
         {.message = fmt::format("the scene has {} bytes; at most {} are read", text.size(), largest_text)});
    return scene;
  }
  // TOML has none of them, and the library that reads it says of most only that something else was expected.
  if (const auto at = text.find_first_of(control_characters); at != std::string_view::npos) {
    const std::string_view before = text.substr(0, at);
    const auto line_begin = before.rfind('\n') + 1;  // 0 when there is none
    note(document, {.line = static_cast<std::uint32_t>(1 + std::count(before.begin(), before.end(), '\n')),
                    .column = static_cast<std::uint32_t>(1 + at - line_begin),
                    .message = fmt::format("not valid TOML: a control character (code {})",
                                           static_cast<unsigned char>(text[at]))});
    return scene;
  }
  try {
    document.root = toml::parse(text, std::string_view(document.name));
    document.source = document.root.source().path;
  } catch (const toml::parse_error& error) {
    note(document, {.line = error.source().begin.line,
                    .column = error.source().begin.column,
                    .message = fmt::format("not valid TOML: {}", error.description())});
    return scene;
  }
  for (const auto& text_of_override : overrides) {
    if (text_of_override.find_first_of(control_characters) != std::string::npos) {
      note(document,
           {.message = fmt::format("override '{}': has a control character", shortened(text_of_override))});
      continue;
    }
    try {
      apply_override(document.root, text_of_override);
      document.overrides.push_back(text_of_override);
    } catch (const OverrideError& error) {
      note(document,
           {.message = fmt::format("override '{}': {}", shortened(text_of_override), error.what())});
    }
  }
  refuse_unwritable_keys(document, document.root);
  return scene;
}

SceneTable Scene::root() const {
  return {document_, document_->root_node};
}

void Scene::confine_files(const std::filesystem::path& folder) {
  document_->files_below = std::filesystem::absolute(folder);
}

const std::string& Scene::name() const {
  return document_->name;
}

const std::vector<SceneProblem>& Scene::problems() const {
  return document_->problems;
}

std::string Scene::as_run() const {
  return document_->overrides.empty() ? document_->text : text_of(document_->root);
}

std::string Scene::canonical(std::span<const std::string_view> without) const {
  toml::table root = document_->root;
  for (const std::string_view path : without) {
    const std::size_t dot = path.rfind('.');
    toml::table* table = dot == std::string_view::npos ? &root : root.at_path(path.substr(0, dot)).as_table();
    if (table != nullptr) table->erase(path.substr(dot == std::string_view::npos ? 0 : dot + 1));
  }
  return text_of(root);
}

std::string describe(std::string_view scene_name, const SceneProblem& problem) {
  std::string place(scene_name);
  if (problem.line > 0) place += fmt::format(":{}", problem.line);
  if (problem.line > 0 && problem.column > 0) place += fmt::format(":{}", problem.column);
  return place.empty() ? problem.message : fmt::format("{}: {}", place, problem.message);
}

}  // namespace estuary
