#include <algorithm>

#include "sparse_solver.hpp"

namespace estuary::solid {

SparseMatrix assemble_sparse(std::size_t columns, std::span<const SparseEntry> entries) {
  std::vector<std::size_t> start(columns + 1, 0);
  for (const SparseEntry& entry : entries) ++start[static_cast<std::size_t>(entry.column) + 1];
  for (std::size_t c = 0; c < columns; ++c) start[c + 1] += start[c];
  std::vector<SparseEntry> sorted(entries.size());
  std::vector<std::size_t> next(start.begin(), start.end() - 1);
  for (const SparseEntry& entry : entries) sorted[next[static_cast<std::size_t>(entry.column)]++] = entry;
  SparseMatrix result;
  for (std::size_t c = 0; c < columns; ++c) {
    const auto begin = sorted.begin() + static_cast<std::ptrdiff_t>(start[c]),
               end = sorted.begin() + static_cast<std::ptrdiff_t>(start[c + 1]);
    std::stable_sort(begin, end, [](const SparseEntry& a, const SparseEntry& b) { return a.row < b.row; });
    for (auto entry = begin; entry != end; ++entry) {
      if (entry != begin && entry->row == result.row.back()) {
        result.value.back() += entry->value;
      } else {
        result.row.push_back(entry->row);
        result.value.push_back(entry->value);
      }
    }
    result.first.push_back(static_cast<std::int32_t>(result.row.size()));
  }
  return result;
}

}  // namespace estuary::solid
