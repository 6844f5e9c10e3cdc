#include "scene_override.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include "scene_values.hpp"

namespace estuary::detail {

namespace {

std::vector<std::string> key_parts(std::string_view path) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin <= path.size();) {
    const std::size_t end = std::min(path.find('.', begin), path.size());
    const auto part = path.substr(begin, end - begin);
    const bool bare = !part.empty() && std::all_of(part.begin(), part.end(), [](unsigned char c) {
      return std::isalnum(c) != 0 || c == '_' || c == '-';
    });
    if (!bare)
      throw OverrideError(fmt::format("'{}' is not a key path like fluid.viscosity", shortened(path)));
    parts.emplace_back(part);
    begin = end + 1;
  }
  return parts;
}

/// Gives a one-entry table `value = ...`, whose nodes carry the override's text as their source.
toml::table override_value(std::string_view value, const std::string& whole) {
  if (value.find_first_not_of(" \t") == std::string_view::npos) throw OverrideError("has no value after '='");
  try {
    toml::table table = toml::parse(fmt::format("value = {}", value), std::string_view(whole));
    if (table.size() != 1 || !table.contains("value")) throw OverrideError("holds more than one value");
    return table;
  } catch (const toml::parse_error& error) {
    const auto first = value[value.find_first_not_of(" \t")];
    const bool control = std::any_of(value.begin(), value.end(), [](unsigned char c) { return c < 0x20; });
    if (std::string_view("\"'[{").find(first) != std::string_view::npos || control) {
      throw OverrideError(fmt::format("has a value that is not TOML: {}", error.description()));
    }
  }
  const auto begin = value.find_first_not_of(" \t");
  std::string quoted;
  for (const char c : value.substr(begin, value.find_last_not_of(" \t") - begin + 1)) {
    if (c == '"' || c == '\\') quoted += '\\';
    quoted += c;
  }
  try {
    return toml::parse(fmt::format("value = \"{}\"", quoted), std::string_view(whole));
  } catch (const toml::parse_error& error) {
    throw OverrideError(fmt::format("has a value that is not TOML: {}", error.description()));
  }
}

std::size_t array_index(const toml::array& array, const std::string& part, std::string_view path) {
  std::size_t index = 0;
  const auto* end = part.data() + part.size();
  const auto [stop, error] = std::from_chars(part.data(), end, index);
  if (error != std::errc{} || stop != end) {
    throw OverrideError(fmt::format("'{}' is an array; '{}' is not an index into it", path, part));
  }
  if (index >= array.size()) {
    throw OverrideError(
        fmt::format("there is no entry {} in '{}'; it has {}, counted from 0", index, path, array.size()));
  }
  return index;
}

// Removes the entries of the array of tables `name` for which `unwanted` holds.
template <typename Predicate>
void erase_tables(toml::table& root, std::string_view name, const Predicate& unwanted) {
  auto* array = root.get_as<toml::array>(name);
  if (array == nullptr) return;
  for (auto entry = array->cbegin(); entry != array->cend();) {
    const auto* table = entry->as_table();
    entry = table != nullptr && unwanted(*table) ? array->erase(entry) : std::next(entry);
  }
  if (array->empty()) root.erase(name);
}

// A participant, what watches it and what checks those watches.
void switch_off(toml::table& root, const std::string& participant) {
  root.erase(participant);
  std::vector<std::string> watches;
  erase_tables(root, "watch", [&](const toml::table& watch) {
    if (watch["participant"].value<std::string>() != participant) return false;
    watches.push_back(watch["name"].value_or(std::string()) + ".");
    return true;
  });
  erase_tables(root, "check", [&](const toml::table& check) {
    const std::string quantity = check["quantity"].value_or(std::string());
    return std::any_of(watches.begin(), watches.end(),
                       [&](const std::string& watch) { return quantity.starts_with(watch); });
  });
}

}  // namespace

void apply_override(toml::table& root, const std::string& text) {
  const auto equals = text.find('=');
  if (equals == std::string::npos) throw OverrideError("is not of the form key.path=value");
  std::string_view path = std::string_view(text).substr(0, equals);
  while (!path.empty() && path.back() == ' ') path.remove_suffix(1);
  const auto parts = key_parts(path);
  toml::table value = override_value(std::string_view(text).substr(equals + 1), text);

  if (parts.size() == 1 && root[parts.front()].is_table() && value["value"].value<std::string>() == "off") {
    switch_off(root, parts.front());
    return;
  }
  toml::node* at = &root;
  std::string walked;
  for (std::size_t i = 0; i < parts.size(); ++i) {
    const bool last = i + 1 == parts.size();
    toml::node* next = nullptr;
    if (auto* table = at->as_table()) {
      if (last) {
        toml::node& entry = *value.get("value");
        std::move(entry).visit(
            [&](auto&& v) { table->insert_or_assign(parts[i], std::forward<decltype(v)>(v)); });
        return;
      }
      next = table->get(parts[i]);
      if (next == nullptr) next = &table->insert(parts[i], toml::table{}).first->second;
    } else if (auto* array = at->as_array()) {
      const std::size_t index = array_index(*array, parts[i], walked);
      if (last) {
        toml::node& entry = *value.get("value");
        std::move(entry).visit([&](auto&& v) {
          array->replace(array->cbegin() + static_cast<std::ptrdiff_t>(index), std::forward<decltype(v)>(v));
        });
        return;
      }
      next = array->get(index);
    } else {
      throw OverrideError(fmt::format("'{}' is {}, so it has no key '{}'", walked, found(*at), parts[i]));
    }
    walked += (walked.empty() ? "" : ".") + parts[i];
    at = next;
  }
}

}  // namespace estuary::detail
