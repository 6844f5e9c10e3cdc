// Walls: planes; polylines in the plane (a channel's bed, a hopper, the wet surface of a solid); meshes of
// triangles in space. They move and turn as prescribed and feel the grains. A polyline acts on the side to
// the left of its segments (walked from first to second node), a mesh on both sides.
//
// A grain touches a connected piece of a polyline or mesh once, however many facets and nodes it is made of.
// The distance from the grain's centre to the piece has critical points: where it is smallest (feet on
// facets; edges and nodes that stick out), and where it is so along some ways over the surface and largest
// along others (edges and nodes where the surface bends towards the grain, between two feet). The elastic
// force is
//     k sum over critical points of index x delta n,
// delta the overlap there, n the direction, index 1 for the smallest, -1 or more for the others: the gradient
// of k/2 sum index x delta^2. Where a foot appears or vanishes it meets the edge's or the node's term, so the
// force has no jump anywhere; on a flat piece it is that of a plane, and between the two sides of a notch
// that touch the grain apart from each other it is that of two contacts. (Sum over critical points with the
// sign of their index: Milnor, Morse Theory, 1963, paragraph 5; index of a vertex as 1 - Euler characteristic
// of its descending link: Banchoff, Amer. Math. Monthly 77 (1970) 475.)
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
  // A plane: a point on it and the unit normal into the grains' side. Not used for a polyline or mesh.
  Vector<D> point{}, normal{};
  // A polyline or mesh: nodes (D per node) and the D nodes of each facet (segment, triangle).
  std::vector<double> node, node_velocity;
  std::vector<std::uint32_t> facet;
  std::vector<std::uint32_t> node_start, node_facet;  // facets that meet at each node, by link_facets
  // Edges of a mesh, by link_facets: their two nodes; those of each facet (number k from its node k to the
  // next); the facets that meet at each.
  std::vector<std::uint32_t> edge, facet_edge, edge_start, edge_facet;
  Vector<D> velocity{};  // of the whole wall
  Vector<D> pivot{};     // about which it turns; goes along with `velocity`
  Spin<D> spin{};        // [rad/s]
  double reach = 0;      // how far its nodes may go between two rebuilds without a new list [m]

  [[nodiscard]] bool is_plane() const { return facet.empty(); }
  [[nodiscard]] std::size_t facets() const { return facet.size() / D; }
  /// Of the material point at `x`; what single nodes do besides comes on top [m/s].
  [[nodiscard]] Vector<D> velocity_at(const Vector<D>& x) const {
    return velocity + spin_times_arm(spin, x - pivot);
  }
};

/// Fills what follows from `facet`. Throws std::invalid_argument when a facet names a node that there is not
/// or has no length or area.
template <int D>
void link_facets(Wall<D>& wall);

/// The point of facet `f` nearest to x.
template <int D>
Vector<D> nearest_on_facet(const Wall<D>& wall, std::size_t f, const Vector<D>& x);

/// One contact of a grain with a wall.
template <int D>
struct WallTouch {
  Vector<D> normal{};                  // from the grain into the wall
  double overlap = 0;                  // [m]; 0 where there is none
  Vector<D> velocity{};                // of the wall there [m/s]
  std::uint32_t element = kNoElement;  // the facet by which the piece is known again
};

/// What a grain touches of a polyline or mesh, in the slots of its memory.
template <int D>
struct FacetTouches {
  std::array<WallTouch<D>, kWallContacts> slot;
  /// The slot that now holds the piece of each former one; kWallContacts where it is no longer touched.
  std::array<std::size_t, kWallContacts> now{};
};

/// The pieces that a grain of radius `r` at `x` touches among the facets `near`. A piece stays in the slot of
/// `former` (elements) that already knew one of its facets; of two that have become one the first.
template <int D>
FacetTouches<D> find_touches(const Wall<D>& wall, std::span<const std::uint32_t> near, const Vector<D>& x,
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
