#include "walls.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::grains {

template <int D>
void link_nodes(Wall<D>& wall) {
  const std::size_t nodes = wall.node.size() / 2;
  wall.node_start.assign(nodes + 1, 0);
  for (const std::uint32_t k : wall.segment) ++wall.node_start[k + 1];
  for (std::size_t k = 0; k < nodes; ++k) wall.node_start[k + 1] += wall.node_start[k];
  wall.node_segment.resize(wall.segment.size());
  std::vector<std::uint32_t> next(wall.node_start.begin(), wall.node_start.end() - 1);
  for (std::size_t s = 0; s < wall.segments(); ++s)
    for (const std::uint32_t k : {wall.segment[2 * s], wall.segment[2 * s + 1]})
      wall.node_segment[next[k]++] = static_cast<std::uint32_t>(s);
}

template <int D>
void rebuild_wall_contacts(const std::vector<Wall<D>>& walls, const ListSettings& settings,
                           const std::vector<std::uint32_t>& origin, State<D>& state) {
  const std::vector<WallContact> former = std::move(state.wall_contact);
  const std::vector<double> former_history = std::move(state.wall_history);
  const std::size_t memory = settings.history_size;
  state.wall_contact.clear();
  state.wall_history.clear();
  state.wall_segment.clear();
  // First former contact of each former grain: the list is ordered by grain.
  std::vector<std::uint32_t> first(state.size() + 1, 0);
  for (const WallContact& contact : former) ++first[contact.grain + 1];
  for (std::size_t i = 0; i < state.size(); ++i) first[i + 1] += first[i];
  for (std::size_t i = 0; i < state.size(); ++i) {
    if (state.inverse_mass[i] == 0) continue;
    const Vector<D> x = load<D>(state.position.data(), i);
    for (std::size_t w = 0; w < walls.size(); ++w) {
      const Wall<D>& wall = walls[w];
      const double reach = state.radius[i] + settings.skin + wall.reach;
      const auto near_begin = static_cast<std::uint32_t>(state.wall_segment.size());
      if (wall.is_plane()) {
        if (dot(x - wall.point, wall.normal) >= reach) continue;
      } else if constexpr (D == 2) {
        for (std::size_t s = 0; s < wall.segments(); ++s) {
          const Vector<2> a = load<2>(wall.node.data(), wall.segment[2 * s]);
          const Vector<2> b = load<2>(wall.node.data(), wall.segment[2 * s + 1]);
          const Vector<2> t = b - a;
          const double fraction = std::clamp(dot(x - a, t) / dot(t, t), 0.0, 1.0);
          if (norm(x - a - fraction * t) < reach) state.wall_segment.push_back(static_cast<std::uint32_t>(s));
        }
        if (state.wall_segment.size() == near_begin) continue;
      }
      const auto near_end = static_cast<std::uint32_t>(state.wall_segment.size());
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

template void link_nodes(Wall<2>&);
template void link_nodes(Wall<3>&);
template void rebuild_wall_contacts(const std::vector<Wall<2>>&, const ListSettings&,
                                    const std::vector<std::uint32_t>&, State<2>&);
template void rebuild_wall_contacts(const std::vector<Wall<3>>&, const ListSettings&,
                                    const std::vector<std::uint32_t>&, State<3>&);

}  // namespace estuary::grains
