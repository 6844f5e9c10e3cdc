// Which pieces of a polyline or mesh a grain touches, and how deep.
#include <algorithm>
#include <cmath>

#include "critical_points.hpp"

namespace estuary::grains {

template <int D>
FacetTouches<D> find_touches(const Wall<D>& wall, std::span<const std::uint32_t> near, const Vector<D>& x,
                             double r, const std::array<std::uint32_t, kWallContacts>& former) {
  FacetTouches<D> result;
  result.now.fill(kWallContacts);
  const CriticalPoints<D>& found = critical_points(wall, near, x, r);
  if (found.points.empty()) return result;
  const auto piece_of = [&](std::uint32_t element) {
    for (std::size_t n = 0; n < near.size(); ++n)
      if (near[n] == element) return found.piece[n];
    return kNoElement;
  };
  // One pass per piece: `done` is the label of the last one; labels are facets and ascend.
  std::array<bool, kWallContacts> taken{};
  std::array<std::uint32_t, kWallContacts> waiting{};
  std::size_t waits = 0;
  std::array<std::uint32_t, kWallContacts> piece_in;
  piece_in.fill(kNoElement);
  std::uint32_t label = 0;
  for (bool more = true; more;) {
    std::uint32_t next = kNoElement;
    for (const CriticalPoint<D>& point : found.points)
      if (point.piece >= label) next = std::min(next, point.piece);
    more = next != kNoElement;
    if (!more) break;
    label = next + 1;
    std::size_t home = kWallContacts;
    for (std::size_t k = 0; k < kWallContacts; ++k) {
      if (former[k] == kNoElement || piece_of(former[k]) != next) continue;
      if (home == kWallContacts) home = k;
      result.now[k] = home;
    }
    if (home != kWallContacts) {
      piece_in[home] = next;
      taken[home] = true;
    } else if (waits < kWallContacts) {
      waiting[waits++] = next;
    }
  }
  for (std::size_t w = 0; w < waits; ++w)
    for (std::size_t k = 0; k < kWallContacts; ++k) {
      if (taken[k]) continue;
      taken[k] = true;
      piece_in[k] = waiting[w];
      break;
    }
  for (std::size_t k = 0; k < kWallContacts; ++k) {
    if (!taken[k]) continue;
    WallTouch<D>& touch = result.slot[k];
    Vector<D> push{};
    double weight = 0, deepest = 0;
    for (const CriticalPoint<D>& point : found.points) {
      if (point.piece != piece_in[k]) continue;
      const double part = point.index * point.overlap;
      push = push + part * point.normal;
      touch.velocity = touch.velocity + part * point.velocity;
      weight += part;
      if (part <= deepest) continue;
      deepest = part;
      touch.element = point.element;
    }
    touch.overlap = norm(push);
    // Pushed from opposite sides with the same strength: no direction, no force.
    if (!(touch.overlap > 0) || !(weight > 0)) {
      touch = {};
      continue;
    }
    touch.normal = (1 / touch.overlap) * push;
    touch.velocity = (1 / weight) * touch.velocity;
  }
  return result;
}

template FacetTouches<2> find_touches(const Wall<2>&, std::span<const std::uint32_t>, const Vector<2>&,
                                      double, const std::array<std::uint32_t, kWallContacts>&);
template FacetTouches<3> find_touches(const Wall<3>&, std::span<const std::uint32_t>, const Vector<3>&,
                                      double, const std::array<std::uint32_t, kWallContacts>&);

}  // namespace estuary::grains
