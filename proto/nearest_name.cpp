#include <algorithm>
#include <cctype>
#include <limits>

#include "scene.hpp"

namespace estuary {

namespace {

std::string folded(std::string_view word) {
  std::string result(word);
  for (char& c : result) c = c == '-' ? '_' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return result;
}

/// Optimal string alignment distance: insertions, deletions, substitutions and swaps of neighbours.
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> before(b.size() + 1), previous(b.size() + 1), current(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) previous[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    current[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = previous[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1);
      current[j] = std::min({previous[j] + 1, current[j - 1] + 1, replaced});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1]) {
        current[j] = std::min(current[j], before[j - 2] + 1);
      }
    }
    std::swap(before, previous);
    std::swap(previous, current);
  }
  return previous[b.size()];
}

}  // namespace

std::optional<std::string> nearest_name(std::string_view word, std::span<const std::string> known) {
  constexpr std::size_t longest = 80;
  if (word.size() > longest) return std::nullopt;
  const std::string asked = folded(word);
  const std::string* best = nullptr;
  std::size_t least = std::numeric_limits<std::size_t>::max();
  for (const auto& name : known) {
    if (name.size() > longest) continue;
    const std::size_t length = std::max(word.size(), name.size());
    const std::size_t allowed = length < 3 ? 0 : std::max<std::size_t>(1, length / 3);
    // What one has more than the other has to be inserted.
    if (length - std::min(word.size(), name.size()) > allowed) continue;
    const std::size_t distance = edit_distance(asked, folded(name));
    if (distance <= allowed && distance < least) {
      least = distance;
      best = &name;
    }
  }
  return best == nullptr ? std::nullopt : std::optional(*best);
}

}  // namespace estuary
