// Walls: planes, and polylines in the plane (a channel's bed, a hopper, the wet surface of a solid). They
// move as prescribed and feel the grains. A polyline acts on the side to the left of its segments (walked
// from first to second node).
//
// A grain touches a connected piece of a polyline once, however many segments and nodes it is made of. With
// the points of the polyline where the distance to the grain's centre is smallest (feet on segments, nodes
// that stick out) and largest (nodes where the line bends towards the grain, between two feet), the elastic
// force is
//     k ( sum over smallest delta n - sum over largest delta n ),   delta the overlap there, n the direction:
// the gradient of k/2 (sum delta^2 - sum delta^2). Where a foot appears or vanishes it meets the node's term,
// so the force has no jump anywhere, on a straight line it is that of a plane, and between the two sides of a
// notch that touch the grain apart from each other it is that of two contacts. (Sum over critical points with
// the sign of their index: Milnor, Morse Theory, 1963, paragraph 5.)
#pragma once

#include <array>
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
  std::vector<std::uint32_t> node_start, node_segment;  // segments that meet at each node, by link_nodes
  Vector<D> velocity{};                                 // of the whole wall
  double reach = 0;  // how far its nodes may go between two rebuilds without a new list [m]

  [[nodiscard]] bool is_plane() const { return segment.empty(); }
  [[nodiscard]] std::size_t segments() const { return segment.size() / 2; }
};

/// Fills `node_start` and `node_segment`.
template <int D>
void link_nodes(Wall<D>& wall);

/// One contact of a grain with a wall.
template <int D>
struct WallTouch {
  Vector<D> normal{};                  // from the grain into the wall
  double overlap = 0;                  // [m]; 0 where there is none
  Vector<D> velocity{};                // of the wall there [m/s]
  std::uint32_t element = kNoElement;  // the segment by which the piece is known again
};

/// What a grain touches of a polyline, in the slots of its memory.
struct PolylineTouches {
  std::array<WallTouch<2>, kWallContacts> slot;
  /// The slot that now holds the piece of each former one; kWallContacts where it is no longer touched.
  std::array<std::size_t, kWallContacts> now{};
};

/// The pieces that a grain of radius `r` at `x` touches among the segments `near`. A piece stays in the slot
/// of `former` (elements) that already knew one of its segments; of two that have become one the first.
PolylineTouches find_touches(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x,
                             double r, const std::array<std::uint32_t, kWallContacts>& former);

/// Divides `force` on the piece of segment `element` between the polyline's nodes, adding to `node_force` (2
/// per node). The parts add up to `force`.
void share_between_nodes(const Wall<2>& wall, std::span<const std::uint32_t> near, const Vector<2>& x,
                         double r, std::uint32_t element, const Vector<2>& force,
                         std::vector<double>& node_force);

/// Makes the list of grains within reach of a wall; contacts that stay keep their history.
template <int D>
void rebuild_wall_contacts(const std::vector<Wall<D>>& walls, const ListSettings& settings,
                           const std::vector<std::uint32_t>& origin, State<D>& state);

}  // namespace estuary::grains
