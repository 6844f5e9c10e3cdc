// Walls: planes, and polylines in the plane (a channel's bed, a hopper, the wet surface of a solid). They
// move as prescribed and feel the grains. A polyline acts on the side to the left of its segments (walked
// from first to second node); a grain touches the insides of its segments and, at corners that stick out, its
// nodes.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "neighbours.hpp"
#include "state.hpp"

namespace estuary::grains {

template <int D>
struct Wall {
  std::string name;
  ContactConstants constants;
  // A plane: a point on it and the unit normal into the grains' side. Not used for a polyline.
  Vector<D> point{}, normal{};
  // A polyline: nodes (2 per node) and the two nodes of each segment; present position and velocity.
  std::vector<double> node, node_velocity;
  std::vector<std::uint32_t> segment;
  Vector<D> velocity{};  // of the whole wall
  double reach = 0;      // how far its nodes may go between two rebuilds without a new list [m]

  [[nodiscard]] bool is_plane() const { return segment.empty(); }
  [[nodiscard]] std::size_t segments() const { return segment.size() / 2; }
};

/// Where a wall's element is nearest to a point: direction from the grain to the wall, distance, and the
/// wall's velocity there. `share` divides a force at that point between the segment's two nodes.
template <int D>
struct NearestPoint {
  bool near = false;  // false where another element is the nearest one
  Vector<D> normal{};
  double distance = 0;
  Vector<D> velocity{};
  double share = 0;
};

/// Elements of a polyline: its segments, then its nodes.
template <int D>
NearestPoint<D> nearest_point(const Wall<D>& wall, std::uint32_t element, const Vector<D>& x);

/// Makes the list of grains within reach of a wall; contacts that stay keep their history.
template <int D>
void rebuild_wall_contacts(const Domain<D>& domain, const std::vector<Wall<D>>& walls,
                           const ListSettings& settings, const std::vector<std::uint32_t>& origin,
                           State<D>& state);

}  // namespace estuary::grains
