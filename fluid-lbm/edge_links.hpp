// Links near sharp edges of a body, closed gradually as the body comes near.
//
// Where a body ends in an edge (the tip of a fin), an interpolated bounce-back rule sees only whether a link
// is cut or not: while the edge moves through a cell the flow hardly changes, and it jumps when the edge
// passes a node. The drag of a fin 2.5 nodes thick jumps by 10 % with its height. A coupled solution may then
// not exist.
//
// So near an edge the links from a fluid node x closer than one spacing to the surface, to the fluid nodes n
// behind it, are closed gradually. With s the distances from the surface in spacings, e how near the edge is
// (1 within two spacings, 0 beyond three and a half, taken at n), and B = e max(0, 1 - s), the share
//
//   b / (1 + (1 - b) c)   with   b = (B_x - B_n) / (1 - B_n)   where positive,   c = 1 / (tau - 1/2) - 1
//
// of what n would receive from x is replaced by the rule of links.hpp at n, for a wall at q = s_n / (s_n -
// s_x) behind x, where a linear profile has the wall's velocity. When the surface passes x, b is 1 and q is
// 1: the closed link that follows. Both parts are exact for a linear profile at a flat wall. The closed share
// keeps the mass of n as in links.hpp; x is then a node of which only the part 1 - B belongs to the fluid.
//
// c is kept between 0 and 4. Why not b itself: a small share holds the fluid back nearly as much as a closed
// link does, the more so the smaller its viscosity, so that the flow would see most of the edge's way through
// a cell in the first part of it. A weight of this form is known from partially saturated cells (Noble,
// Torczynski 1998, with c = 1 / (tau - 1/2)). This c was fitted to the lift of a bent bar at tau = 0.7 and
// 0.9, which grows more evenly with it wherever the bar's tip stands between the nodes, though not quite
// (README of the coupler, FSI1). The bound: near tau = 1/2 it would be a jump again.
//
// A corner can also cut a link between two fluid nodes twice, and lie between them with a chord of length h.
// The share h / (h + e s) of such a link, s the smaller distance of its two nodes, follows the rule of
// links.hpp for its own first cut; the shares above apply to the rest. When the surface passes one of the
// nodes, this share is 1 and the rule is again that of the closed link that follows.
// Smooth walls have no edges and keep the plain rule; an edge is where a convex outline turns by more than
// about 35 degrees within one and a half spacings.
//
// At a smooth wall the plain rule's force jumps too when the wall passes a node, by about 1e-4 of the whole,
// which an iteration to equilibrium with a tolerance of 1e-4 may trip over. With `everywhere` e is 1 along
// the whole surface. A closed link keeps the mass of n but not of x, so that is for steady flows through a
// domain, not for long transients in a closed one.
//
// The scheme is this project's own; tests/unit/fluid-lbm/edge_links_test.cpp shows what it does to the jumps.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "cells.hpp"
#include "links.hpp"
#include "populations.hpp"
#include "surface.hpp"

namespace estuary::fluid {

class EdgeLinks {
public:
  enum class Extent : std::uint8_t { edges, everywhere };
  EdgeLinks() = default;
  /// `relaxation_time` of the shear stress [steps], above one half.
  EdgeLinks(Extent extent, double relaxation_time, Ranks* ranks = nullptr)
      : everywhere_(extent == Extent::everywhere),
        holding_(std::clamp(1 / (relaxation_time - 0.5) - 1, 0.0, 4.0)),
        ranks_(ranks) {}

  /// Finds the edges of the surface and the links to close there. Costs nothing more without an edge.
  void build(const Surface& surface, const Cells& cells, const Populations& layout);

  /// Partly closes the links, after every surface has reflected: replaces populations that fluid nodes
  /// exchange, until the next step or `reopen`. Every thread of a parallel region calls it.
  void close(Populations& populations, Parity parity, bool compressible);
  void reopen(Populations& populations, Parity parity) const;
  /// What the closed shares take from the fluid, by momentum exchange as in links.hpp.
  [[nodiscard]] Force force(std::span<const std::uint32_t> bodies = {}, std::uint32_t body = 0) const;
  /// Adds `weight` times the same at the nodes of the surface, as in links.hpp.
  void add_node_forces(double weight, std::vector<double>& force) const;
  [[nodiscard]] std::size_t count() const { return closings_.size(); }

private:
  struct Edge {
    double x = 0;
    double y = 0;
    double strength = 0;  // 0..1
  };
  // A node near an edge and the point of the surface nearest to it.
  struct NearNode {
    Node node;
    double distance = 0;
    double edge = 0;        // how near an edge is, 0..1
    double strength = 0;    // of the closing, 0..1
    double velocity_x = 0;  // of that point of the surface
    double velocity_y = 0;
    std::uint32_t surface_node = 0;  // of the nearest segment, its first
    std::uint32_t surface_end = 0;   // its last
    double along = 0;                // the point's place between them
    std::int32_t last_seen = -1;     // into seen_
  };
  // A segment near a node, and the one seen there before.
  struct Seen {
    std::uint32_t segment = 0;  // into near_insets_
    std::int32_t before = -1;
  };
  // The part of a link that lies in the body, as fractions of the link.
  struct Chord {
    double begin = 0;
    double end = 0;
  };
  // A partly closed link, seen from the node that keeps to the fluid.
  struct Closing {
    Node node;
    int direction = 0;  // towards the other node
    double share = 0;
    double velocity_x = 0;  // of the wall [lattice units]
    double velocity_y = 0;
    std::uint32_t surface_node = 0;  // as in NearNode
    std::uint32_t surface_end = 0;
    double along = 0;
    // Locations after an even [0] and an odd [1] step, and the rule's weights.
    std::array<std::ptrdiff_t, 2> leaving;
    std::array<std::ptrdiff_t, 2> second;  // leaves the node the other way
    std::array<std::ptrdiff_t, 2> behind;  // comes in from the node behind
    std::array<std::ptrdiff_t, 2> incoming;
    double weight_leaving = 0;
    double weight_second = 0;
    double weight_behind = 0;
    double weight_wall = 0;
    double wall = 0;   // mass that the moving wall adds half-way on the link, at density 1
    double place = 1;  // of the wall on the link [fraction]
  };
  [[nodiscard]] Force force_of(std::size_t closing) const;
  // Of all closings, in their order.
  [[nodiscard]] const std::vector<Force>& forces() const;
  void find_edges(const Surface& surface);
  void find_near_nodes(const Surface& surface, const Cells& cells);
  void find_near_segments(const Surface& surface);
  void see(std::uint32_t segment, int x, int y, const Surface& surface, const Cells& cells);
  [[nodiscard]] const NearNode* find(const Grid& grid, int x, int y) const;
  [[nodiscard]] Chord chord_of(const NearNode& from, int direction) const;
  void add(const NearNode& from, const NearNode& to, int direction, const Cells& cells,
           const Populations& layout);

  bool everywhere_ = false;
  double holding_ = 0;  // c above
  Ranks* ranks_ = nullptr;
  mutable std::vector<Force> forces_;
  std::vector<Edge> edges_;
  std::vector<Segment> near_segments_;  // that a link near an edge may meet
  std::vector<Segment> near_insets_;    // the same, moved into the solid by `surface_inset`
  std::vector<NearNode> near_nodes_;
  std::vector<Seen> seen_;
  std::vector<std::int32_t> near_node_of_;  // per node, -1 without; empty until there is an edge
  std::vector<Closing> closings_;
  std::vector<double> open_values_;    // what `close` replaced
  std::vector<double> closed_values_;  // and by what
  std::vector<double> gained_;         // mass taken back from the population at rest
};

}  // namespace estuary::fluid
