#include "walls.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <optional>
#include <stdexcept>
#include <utility>

namespace estuary::grains {

namespace {

// Groups the facets by what they meet at: those at entry k are `who` from start[k] to start[k + 1].
void group_facets(const std::vector<std::uint32_t>& entry, std::size_t per_facet, std::size_t entries,
                  std::vector<std::uint32_t>& start, std::vector<std::uint32_t>& who) {
  start.assign(entries + 1, 0);
  for (const std::uint32_t k : entry) ++start[k + 1];
  for (std::size_t k = 0; k < entries; ++k) start[k + 1] += start[k];
  who.resize(entry.size());
  std::vector<std::uint32_t> next(start.begin(), start.end() - 1);
  for (std::size_t m = 0; m < entry.size(); ++m)
    who[next[entry[m]]++] = static_cast<std::uint32_t>(m / per_facet);
}

// Length of a segment, twice the area of a triangle.
template <int D>
double extent_of(const Wall<D>& wall, std::size_t f) {
  const Vector<D> a = load<D>(wall.node.data(), wall.facet[D * f]);
  const Vector<D> t = load<D>(wall.node.data(), wall.facet[D * f + 1]) - a;
  if constexpr (D == 2)
    return norm(t);
  else
    return norm(arm_times_force(t, load<D>(wall.node.data(), wall.facet[D * f + 2]) - a));
}

// Which facets may be within reach, by the cell that a grain's centre lies in.
template <int D>
class FacetGrid {
public:
  FacetGrid(const Wall<D>& wall, double reach) {
    low_.fill(std::numeric_limits<double>::infinity());
    Vector<D> high;
    high.fill(-low_[0]);
    for (std::size_t k = 0; k < wall.node.size(); ++k) {
      low_[k % D] = std::min(low_[k % D], wall.node[k] - reach);
      high[k % D] = std::max(high[k % D], wall.node[k] + reach);
    }
    // Not many more cells than facets, and none smaller than a grain.
    double volume = 1;
    for (std::size_t c = 0; c < kAxes; ++c) volume *= high[c] - low_[c];
    const double most = 64 + 4 * static_cast<double>(wall.facets());
    const double edge = std::max(2 * reach, std::pow(volume / most, 1.0 / D));
    std::size_t cells = 1;
    for (std::size_t c = 0; c < kAxes; ++c) {
      const double count = std::max(1.0, std::floor((high[c] - low_[c]) / edge));
      cell_[c] = (high[c] - low_[c]) / count;
      count_[c] = static_cast<std::size_t>(count);
      cells *= count_[c];
    }
    std::vector<std::pair<std::size_t, std::uint32_t>> entries;
    for (std::size_t f = 0; f < wall.facets(); ++f) {
      Vector<D> first = load<D>(wall.node.data(), wall.facet[D * f]), last = first;
      for (std::size_t k = 1; k < kAxes; ++k) {
        const Vector<D> p = load<D>(wall.node.data(), wall.facet[D * f + k]);
        for (std::size_t c = 0; c < kAxes; ++c) {
          first[c] = std::min(first[c], p[c]);
          last[c] = std::max(last[c], p[c]);
        }
      }
      std::array<std::size_t, kAxes> from{}, to{}, at{};
      for (std::size_t c = 0; c < kAxes; ++c) {
        at[c] = from[c] = coordinate(first[c] - reach, c);
        to[c] = coordinate(last[c] + reach, c);
      }
      for (std::size_t c = 0; c < kAxes;) {
        entries.emplace_back(number(at), static_cast<std::uint32_t>(f));
        for (c = 0; c < kAxes && ++at[c] > to[c]; ++c) at[c] = from[c];
      }
    }
    start_.assign(cells + 1, 0);
    for (const auto& [cell, f] : entries) ++start_[cell + 1];
    for (std::size_t k = 0; k < cells; ++k) start_[k + 1] += start_[k];
    facet_.resize(entries.size());
    std::vector<std::size_t> next(start_.begin(), start_.end() - 1);
    for (const auto& [cell, f] : entries) facet_[next[cell]++] = f;
  }

  /// In ascending order.
  [[nodiscard]] std::span<const std::uint32_t> near(const Vector<D>& x) const {
    std::array<std::size_t, kAxes> at{};
    for (std::size_t c = 0; c < kAxes; ++c) {
      const double place = (x[c] - low_[c]) / cell_[c];
      if (!(place >= 0 && place <= static_cast<double>(count_[c]))) return {};
      at[c] = coordinate(x[c], c);
    }
    const std::size_t cell = number(at);
    return {facet_.data() + start_[cell], start_[cell + 1] - start_[cell]};
  }

private:
  static constexpr auto kAxes = static_cast<std::size_t>(D);

  [[nodiscard]] std::size_t coordinate(double x, std::size_t c) const {
    const double place = std::floor((x - low_[c]) / cell_[c]);
    return static_cast<std::size_t>(std::clamp(place, 0.0, static_cast<double>(count_[c] - 1)));
  }
  [[nodiscard]] std::size_t number(const std::array<std::size_t, kAxes>& at) const {
    std::size_t cell = 0;
    for (std::size_t c = kAxes; c-- > 0;) cell = cell * count_[c] + at[c];
    return cell;
  }

  Vector<D> low_{}, cell_{};
  std::array<std::size_t, kAxes> count_{};
  std::vector<std::size_t> start_;
  std::vector<std::uint32_t> facet_;
};

}  // namespace

template <int D>
void link_facets(Wall<D>& wall) {
  const std::size_t nodes = wall.node.size() / D;
  for (const std::uint32_t k : wall.facet)
    if (k >= nodes)
      throw std::invalid_argument("a facet has node " + std::to_string(k) + " of " + std::to_string(nodes));
  for (std::size_t f = 0; f < wall.facets(); ++f)
    if (!(extent_of(wall, f) > 0))
      throw std::invalid_argument((D == 2 ? "segment " : "triangle ") + std::to_string(f) +
                                  (D == 2 ? " has no length" : " has no area"));
  group_facets(wall.facet, D, nodes, wall.node_start, wall.node_facet);
  if constexpr (D == 3) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> known;
    wall.edge.clear();
    wall.facet_edge.clear();
    for (std::size_t f = 0; f < wall.facets(); ++f)
      for (std::size_t k = 0; k < 3; ++k) {
        const auto [low, high] = std::minmax(wall.facet[3 * f + k], wall.facet[3 * f + (k + 1) % 3]);
        const auto [place, is_new] = known.try_emplace({low, high}, static_cast<std::uint32_t>(known.size()));
        if (is_new) wall.edge.insert(wall.edge.end(), {low, high});
        wall.facet_edge.push_back(place->second);
      }
    group_facets(wall.facet_edge, 3, known.size(), wall.edge_start, wall.edge_facet);
  }
}

template <int D>
Vector<D> nearest_on_facet(const Wall<D>& wall, std::size_t f, const Vector<D>& x) {
  const auto on_segment = [&](const Vector<D>& a, const Vector<D>& b) {
    const Vector<D> t = b - a;
    return a + std::clamp(dot(x - a, t) / dot(t, t), 0.0, 1.0) * t;
  };
  std::array<Vector<D>, static_cast<std::size_t>(D)> p;
  for (std::size_t k = 0; k < p.size(); ++k) p[k] = load<D>(wall.node.data(), wall.facet[D * f + k]);
  if constexpr (D == 2) {
    return on_segment(p[0], p[1]);
  } else {
    Vector<3> normal = arm_times_force(p[1] - p[0], p[2] - p[0]);
    normal = (1 / norm(normal)) * normal;
    const auto inside = [&](std::size_t k) {
      return dot(x - p[k], arm_times_force(normal, p[(k + 1) % 3] - p[k])) >= 0;
    };
    if (inside(0) && inside(1) && inside(2)) return x - dot(x - p[0], normal) * normal;
    Vector<3> best{};
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k < 3; ++k) {
      const Vector<3> at = on_segment(p[k], p[(k + 1) % 3]);
      if (const double distance = norm(x - at); distance < least) {
        least = distance;
        best = at;
      }
    }
    return best;
  }
}

template <int D>
void rebuild_wall_contacts(const std::vector<Wall<D>>& walls, const ListSettings& settings,
                           const std::vector<std::uint32_t>& origin, State<D>& state) {
  const std::vector<WallContact> former = std::move(state.wall_contact);
  const std::vector<double> former_history = std::move(state.wall_history);
  const std::size_t memory = settings.history_size;
  state.wall_contact.clear();
  state.wall_history.clear();
  state.wall_facet.clear();
  // First former contact of each former grain: the list is ordered by grain.
  std::vector<std::uint32_t> first(state.size() + 1, 0);
  for (const WallContact& contact : former) ++first[contact.grain + 1];
  for (std::size_t i = 0; i < state.size(); ++i) first[i + 1] += first[i];
  const double largest =
      state.radius.empty() ? 0 : *std::max_element(state.radius.begin(), state.radius.end());
  std::vector<std::optional<FacetGrid<D>>> grids(walls.size());
  for (std::size_t w = 0; w < walls.size(); ++w)
    if (!walls[w].is_plane()) grids[w].emplace(walls[w], largest + settings.skin + walls[w].reach);
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.inverse_mass[i] == 0) continue;
    const Vector<D> x = load<D>(state.position.data(), i);
    for (std::size_t w = 0; w < walls.size(); ++w) {
      const Wall<D>& wall = walls[w];
      const double reach = state.radius[i] + settings.skin + wall.reach;
      const auto near_begin = static_cast<std::uint32_t>(state.wall_facet.size());
      if (wall.is_plane()) {
        if (dot(x - wall.point, wall.normal) >= reach + settings.plane_range) continue;
      } else {
        for (const std::uint32_t f : grids[w]->near(x))
          if (norm(x - nearest_on_facet(wall, f, x)) < reach) state.wall_facet.push_back(f);
        if (state.wall_facet.size() == near_begin) continue;
      }
      const auto near_end = static_cast<std::uint32_t>(state.wall_facet.size());
      const std::size_t at = state.wall_contact.size(), slots = wall.is_plane() ? 1 : kWallContacts;
      for (std::size_t k = 0; k < slots; ++k)
        state.wall_contact.push_back(
            {static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(w), kNoElement, near_begin, near_end});
      state.wall_history.resize(state.wall_history.size() + slots * memory, 0.0);
      std::size_t slot = 0;
      for (std::uint32_t k = first[origin[i]]; k < first[origin[i] + 1]; ++k) {
        if (former[k].wall != w) continue;
        state.wall_contact[at + slot].element = former[k].element;
        std::copy_n(former_history.data() + memory * k, memory,
                    state.wall_history.data() + memory * (at + slot));
        ++slot;
      }
    }
  }
  state.wall_history.resize(state.wall_history.size() + 8, 0.0);
}

template void link_facets(Wall<2>&);
template void link_facets(Wall<3>&);
template Vector<2> nearest_on_facet(const Wall<2>&, std::size_t, const Vector<2>&);
template Vector<3> nearest_on_facet(const Wall<3>&, std::size_t, const Vector<3>&);
template void rebuild_wall_contacts(const std::vector<Wall<2>>&, const ListSettings&,
                                    const std::vector<std::uint32_t>&, State<2>&);
template void rebuild_wall_contacts(const std::vector<Wall<3>>&, const ListSettings&,
                                    const std::vector<std::uint32_t>&, State<3>&);

}  // namespace estuary::grains
