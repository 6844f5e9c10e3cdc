#include "wall_memory.hpp"

#include <algorithm>

namespace estuary::fluid {
void WallMemory::clear() {
  kept_.clear();
  for (std::size_t n = 0; n < links_.size(); ++n)
    if (links_[n].key != 0) kept_.push_back({links_[n].key, values_[n]});
  links_.clear();
  values_.clear();
}

std::size_t WallMemory::add(std::ptrdiff_t node, int i, const Populations& layout, bool own) {
  const int o = layout.lattice().opposite[i];
  Link link;
  if (own) link.key = static_cast<std::int64_t>(layout.number_in_grid(node)) * most_velocities + i;
  for (const Parity parity : parities) {
    const std::size_t k = parity == Parity::even ? 0 : 1;
    link.leaving[k] = layout.post_collision(parity, i, node);
    link.leaving_back[k] = layout.post_collision(parity, o, node);
    link.incoming[k] = layout.incoming(parity, i, node);
    link.incoming_back[k] = layout.incoming(parity, o, node);
  }
  links_.push_back(link);
  values_.emplace_back();
  return links_.size() - 1;
}

void WallMemory::finish() {
  give_back(std::move(kept_));
  kept_.clear();
}

void WallMemory::give_back(std::vector<Kept> kept) {
  if (kept.empty() || links_.empty()) return;
  std::sort(kept.begin(), kept.end(), [](const Kept& a, const Kept& b) { return a.key < b.key; });
  for (std::size_t n = 0; n < links_.size(); ++n) {
    const auto found = std::lower_bound(kept.begin(), kept.end(), links_[n].key,
                                        [](const Kept& a, std::int64_t key) { return a.key < key; });
    if (found != kept.end() && found->key == links_[n].key) values_[n] = found->values;
  }
}

void WallMemory::note(const Populations& populations, Parity parity) {
  const std::size_t k = parity == Parity::even ? 0 : 1;
#pragma omp for schedule(static)
  for (std::size_t n = 0; n < links_.size(); ++n) {
    if (links_[n].key == 0) continue;
    Values& now = values_[n][k];
    now.along = populations[links_[n].incoming[k]];
    now.against = populations[links_[n].incoming_back[k]];
    now.known = true;
  }
}

std::vector<double> WallMemory::save() const {
  std::vector<double> saved;
  for (std::size_t n = 0; n < links_.size(); ++n) {
    saved.push_back(static_cast<double>(links_[n].key));
    for (const Values& v : values_[n])
      saved.insert(saved.end(), {v.along, v.against, v.mean_excess, v.known ? 1.0 : 0.0});
  }
  return saved;
}

void WallMemory::restore(const std::vector<double>& saved) {
  constexpr std::size_t entries = 9;
  std::vector<Kept> kept;
  for (std::size_t n = 0; n + entries <= saved.size(); n += entries) {
    Kept one{static_cast<std::int64_t>(saved[n]), {}};
    for (std::size_t k = 0; k < 2; ++k) {
      const double* from = &saved[n + 4 * k + 1];
      one.values[k] = {from[0], from[1], from[2], from[3] != 0};
    }
    kept.push_back(one);
  }
  for (auto& values : values_) values = {};
  give_back(std::move(kept));
}

}  // namespace estuary::fluid
