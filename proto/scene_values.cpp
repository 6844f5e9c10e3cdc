#include "scene_values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace estuary::detail {

std::string shortened(std::string_view text) {
  constexpr std::size_t longest = 60;
  if (text.size() <= longest) return std::string(text);
  std::size_t end = longest;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U)
    --end;  // whole UTF-8 characters
  return std::string(text.substr(0, end)) + "...";
}

std::string found(const toml::node& node) {
  if (const auto* text = node.as_string()) return fmt::format("the string \"{}\"", shortened(text->get()));
  if (const auto* integer = node.as_integer()) return fmt::format("the integer {}", integer->get());
  if (const auto* number = node.as_floating_point()) return fmt::format("the number {}", number->get());
  if (const auto* boolean = node.as_boolean()) return fmt::format("the boolean {}", boolean->get());
  if (const auto* array = node.as_array()) {
    return fmt::format("an array of {} {}{}", array->size(), array->is_array_of_tables() ? "table" : "value",
                       array->size() == 1 ? "" : "s");
  }
  return node.is_table() ? "a table" : "a date or time";
}

std::string in_table(const SceneNode& node) {
  return node.path.empty() ? std::string("at the top of the scene") : fmt::format("in [{}]", node.path);
}

void note(SceneDocument& document, SceneProblem problem) {
  const auto order = [](const SceneProblem& a) {
    return a.line == 0 ? std::pair{UINT32_MAX, UINT32_MAX} : std::pair{a.line, a.column};
  };
  const auto same = [&](const SceneProblem& other) {
    return other.line == problem.line && other.column == problem.column && other.message == problem.message;
  };
  auto& all = document.problems;
  if (std::any_of(all.begin(), all.end(), same)) return;
  const auto place =
      std::upper_bound(all.begin(), all.end(), problem,
                       [&](const SceneProblem& a, const SceneProblem& b) { return order(a) < order(b); });
  all.insert(place, std::move(problem));
}

void note_at(SceneDocument& document, const toml::source_region& region, std::string message) {
  if (region.path && region.path == document.source) {
    note(document, {.line = region.begin.line, .column = region.begin.column, .message = std::move(message)});
  } else if (region.path) {
    note(document, {.message = fmt::format("{} (set by the override '{}')", message, *region.path)});
  } else {
    note(document, {.message = std::move(message)});
  }
}

void note_at(SceneDocument& document, const SceneNode& node, std::string message) {
  const bool has_place = node.table != nullptr && node.table != &document.root;
  note_at(document, has_place ? node.table->source() : toml::source_region{}, std::move(message));
}

const toml::node* ask(SceneNode& node, std::string_view key) {
  if (std::find(node.known.begin(), node.known.end(), key) == node.known.end()) node.known.emplace_back(key);
  return node.table == nullptr ? nullptr : node.table->get(key);
}

const toml::node* require(SceneDocument& document, SceneNode& node, std::string_view key,
                          std::string_view expected) {
  const toml::node* value = ask(node, key);
  if (value == nullptr && node.table != nullptr) {
    note_at(document, node, fmt::format("missing key '{}' {}; expected {}", key, in_table(node), expected));
  }
  return value;
}

void wrong_type(SceneDocument& document, const toml::node& value, std::string_view what,
                const SceneNode& node, std::string_view expected) {
  note_at(document, value.source(),
          fmt::format("'{}' {} is {}; expected {}", what, in_table(node), found(value), expected));
}

double usable(Range range) {
  const auto inside = [&](double value) {
    return range.exclusive ? value > range.minimum && value < range.maximum
                           : value >= range.minimum && value <= range.maximum;
  };
  if (inside(1.0)) return 1.0;
  if (std::isfinite(range.minimum) && std::isfinite(range.maximum)) {
    return 0.5 * (range.minimum + range.maximum);
  }
  return std::isfinite(range.minimum) ? range.minimum + 1.0 : range.maximum - 1.0;
}

namespace {

std::string allowed_values(Range range) {
  const bool below = std::isfinite(range.maximum);
  const bool above = std::isfinite(range.minimum);
  if (above && below) {
    return range.exclusive ? fmt::format("between {} and {}, both excluded", range.minimum, range.maximum)
                           : fmt::format("from {} to {}", range.minimum, range.maximum);
  }
  if (above) return fmt::format("{} {}", range.exclusive ? "greater than" : "at least", range.minimum);
  return fmt::format("{} {}", range.exclusive ? "less than" : "at most", range.maximum);
}

}  // namespace

std::optional<double> finite_number(SceneDocument& document, const toml::node& value, std::string_view what,
                                    const SceneNode& node, std::string_view expected) {
  double number = 0.0;
  if (const auto* integer = value.as_integer()) {
    number = static_cast<double>(integer->get());
  } else if (const auto* floating = value.as_floating_point()) {
    number = floating->get();
  } else {
    wrong_type(document, value, what, node, expected);
    return std::nullopt;
  }
  if (!std::isfinite(number)) {
    note_at(document, value.source(),
            fmt::format("'{}' {} is {}; expected a finite number", what, in_table(node), number));
    return std::nullopt;
  }
  return number;
}

double number_in(SceneDocument& document, const toml::node& value, std::string_view key,
                 const SceneNode& node, Range range) {
  const auto number = finite_number(document, value, key, node, "a number");
  if (!number) return usable(range);
  const bool inside = range.exclusive ? *number > range.minimum && *number < range.maximum
                                      : *number >= range.minimum && *number <= range.maximum;
  if (inside) return *number;
  note_at(document, value.source(),
          fmt::format("'{}' {} is {}; must be {}", key, in_table(node), *number, allowed_values(range)));
  return usable(range);
}

std::int64_t integer_in(SceneDocument& document, const toml::node& value, std::string_view key,
                        const SceneNode& node, std::int64_t minimum, std::int64_t maximum) {
  const auto go_on_with = std::clamp<std::int64_t>(1, minimum, maximum);
  const auto* integer = value.as_integer();
  if (integer == nullptr) {
    wrong_type(document, value, key, node, "an integer, written without a decimal point");
    return go_on_with;
  }
  if (integer->get() >= minimum && integer->get() <= maximum) return integer->get();
  const bool open = maximum == std::numeric_limits<std::int64_t>::max();
  note_at(document, value.source(),
          fmt::format(
              "'{}' {} is {}; must be {}", key, in_table(node), integer->get(),
              open ? fmt::format("at least {}", minimum) : fmt::format("from {} to {}", minimum, maximum)));
  return go_on_with;
}

const toml::array* array_of(SceneDocument& document, const toml::node& value, std::string_view what,
                            const SceneNode& node, std::size_t size, std::string_view expected) {
  const auto* array = value.as_array();
  if (array == nullptr) {
    wrong_type(document, value, what, node, expected);
  } else if (size != 0 && array->size() != size) {
    note_at(document, value.source(),
            fmt::format("'{}' {} has {} {}; expected {}", what, in_table(node), array->size(),
                        array->size() == 1 ? "entry" : "entries", expected));
    return nullptr;
  }
  return array;
}

std::string expression_in(SceneDocument& document, const toml::node& value, std::string_view what,
                          const SceneNode& node) {
  if (const auto* text = value.as_string()) {
    if (text->get().find_first_not_of(" \t") != std::string::npos) return text->get();
    note_at(document, value.source(), fmt::format("'{}' {} is an empty expression", what, in_table(node)));
    return "0";
  }
  const auto number =
      finite_number(document, value, what, node, "a number or a string with an expression of x, y, z, t");
  return number ? fmt::format("{}", *number) : "0";
}

}  // namespace estuary::detail
