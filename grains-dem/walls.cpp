#include "walls.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::grains {
namespace {

NearestPoint<2> nearest_on_polyline(const Wall<2>& wall, std::uint32_t element, const Vector<2>& x) {
  NearestPoint<2> result;
  const std::size_t segments = wall.segments();
  const auto node = [&](std::size_t k) { return load<2>(wall.node.data(), k); };
  // Fraction along segment s, of its length, where x projects.
  const auto along = [&](std::size_t s) {
    const Vector<2> a = node(wall.segment[2 * s]), b = node(wall.segment[2 * s + 1]);
    const Vector<2> t = b - a;
    return dot(x - a, t) / dot(t, t);
  };
  if (element < segments) {
    const double fraction = along(element);
    if (fraction < 0 || fraction > 1) return result;
    const std::size_t first = wall.segment[2 * element], second = wall.segment[2 * element + 1];
    const Vector<2> a = node(first), t = node(second) - a;
    const double length = norm(t);
    // Left of the segment is where grains are.
    const Vector<2> inward{-t[1] / length, t[0] / length};
    result.near = true;
    result.share = fraction;
    result.distance = dot(x - a, inward);
    // A grain behind a thin wall touches its other side.
    result.normal = -1.0 * inward;
    result.velocity = wall.velocity + (1 - fraction) * load<2>(wall.node_velocity.data(), first) +
                      fraction * load<2>(wall.node_velocity.data(), second);
    return result;
  }
  const std::size_t k = element - segments;
  // A node is nearest where x projects beyond it on every segment that meets there.
  for (std::size_t s = 0; s < segments; ++s) {
    const bool begins = wall.segment[2 * s] == k, ends = wall.segment[2 * s + 1] == k;
    if (!begins && !ends) continue;
    const double fraction = along(s);
    if (begins ? fraction >= 0 : fraction <= 1) return result;
  }
  const Vector<2> apart = node(k) - x;
  result.distance = norm(apart);
  if (result.distance == 0) return result;
  result.near = true;
  result.normal = (1 / result.distance) * apart;
  result.velocity = wall.velocity + load<2>(wall.node_velocity.data(), k);
  return result;
}

}  // namespace

template <int D>
NearestPoint<D> nearest_point(const Wall<D>& wall, std::uint32_t element, const Vector<D>& x) {
  if constexpr (D == 2)
    if (!wall.is_plane()) return nearest_on_polyline(wall, element, x);
  (void)element;
  NearestPoint<D> result;
  result.near = true;
  result.normal = -1.0 * wall.normal;
  result.distance = dot(x - wall.point, wall.normal);
  result.velocity = wall.velocity;
  return result;
}

template <int D>
void rebuild_wall_contacts(const Domain<D>& domain, const std::vector<Wall<D>>& walls,
                           const ListSettings& settings, const std::vector<std::uint32_t>& origin,
                           State<D>& state) {
  (void)domain;
  const std::vector<WallContact> former = std::move(state.wall_contact);
  const std::vector<double> former_history = std::move(state.wall_history);
  const std::size_t memory = settings.history_size;
  state.wall_contact.clear();
  state.wall_history.clear();
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
      const auto note = [&](std::uint32_t element) {
        state.wall_contact.push_back({static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(w), element});
        const std::size_t at = state.wall_history.size();
        state.wall_history.resize(at + memory, 0.0);
        for (std::uint32_t k = first[origin[i]]; k < first[origin[i] + 1]; ++k)
          if (former[k].wall == w && former[k].element == element)
            std::copy_n(former_history.data() + memory * k, memory, state.wall_history.data() + at);
      };
      if (wall.is_plane()) {
        if (dot(x - wall.point, wall.normal) < reach) note(0);
        continue;
      }
      if constexpr (D == 2) {
        // Any element whose box comes near: which of them is nearest is asked at every step.
        for (std::size_t s = 0; s < wall.segments(); ++s) {
          const Vector<2> a = load<2>(wall.node.data(), wall.segment[2 * s]);
          const Vector<2> b = load<2>(wall.node.data(), wall.segment[2 * s + 1]);
          const Vector<2> t = b - a;
          const double fraction = std::clamp(dot(x - a, t) / dot(t, t), 0.0, 1.0);
          if (norm(x - a - fraction * t) < reach) note(static_cast<std::uint32_t>(s));
        }
        for (std::size_t k = 0; k < wall.node.size() / 2; ++k)
          if (norm(x - load<2>(wall.node.data(), k)) < reach)
            note(static_cast<std::uint32_t>(wall.segments() + k));
      }
    }
  }
  state.wall_history.resize(state.wall_history.size() + 8, 0.0);
}

template NearestPoint<2> nearest_point(const Wall<2>&, std::uint32_t, const Vector<2>&);
template NearestPoint<3> nearest_point(const Wall<3>&, std::uint32_t, const Vector<3>&);
template void rebuild_wall_contacts(const Domain<2>&, const std::vector<Wall<2>>&, const ListSettings&,
                                    const std::vector<std::uint32_t>&, State<2>&);
template void rebuild_wall_contacts(const Domain<3>&, const std::vector<Wall<3>>&, const ListSettings&,
                                    const std::vector<std::uint32_t>&, State<3>&);

}  // namespace estuary::grains
