// Links between a fluid node and a node inside a solid, and the rule that reflects populations there.
//
// Source: Bouzidi, Firdaouss, Lallemand, Phys. Fluids 13 (2001), linear interpolation, with the wall's
// velocity; the wall cuts the link at the fraction q, counted from the fluid node:
//   q <  1/2   f_in = 2q f*_i(x) + (1 - 2q) f*_i(x - c_i)                         + 6 w_i rho c_in.u_wall
//   q >= 1/2   f_in = f*_i(x) / (2q) + (1 - 1/(2q)) f*_in(x)                      + (3/q) w_i rho c_in.u_wall
// with `in` the opposite of i. Exact for a linear velocity profile at any q. For q < 1/2 a second fluid node
// is needed behind x; where there is none the wall is taken to lie half-way, and counted.
//
// The interpolation does not keep the mass of the node x: at q = 1 a fin in a channel lost 0.6 % of the flow.
// What the links of a node gain or lose beyond the wall's own motion is therefore taken from its population
// at rest, which moves no momentum and leaves the position of the wall as it is (in the manner of Kao, Yang,
// J. Comput. Phys. 227 (2008)).
//
// Force: momentum exchange, Galilean invariant form of Wen, Zhang, Tu, Wang, Fang, J. Comput. Phys. 266
// (2014).
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "cells.hpp"
#include "populations.hpp"
#include "ranks.hpp"
#include "surface.hpp"

namespace estuary::fluid {

/// Force [lattice units] and moment about node (0, 0) on a surface. Three numbers next to each other.
struct Force {
  double x = 0;
  double y = 0;
  double moment = 0;
  friend Force operator+(const Force& a, const Force& b) {
    return {a.x + b.x, a.y + b.y, a.moment + b.moment};
  }
  friend Force operator*(double factor, const Force& force) {
    return {factor * force.x, factor * force.y, factor * force.moment};
  }
};

struct LinkCounts {
  std::size_t links = 0;
  std::size_t halfway = 0;     // q < 1/2 without a second fluid node
  std::size_t unresolved = 0;  // no crossing found on the link: taken as half-way
};

class Links {
public:
  /// Where ranks share the grid, every one finds all links and reflects at those of its own nodes.
  explicit Links(const Grid& grid, Ranks* ranks = nullptr);

  /// Finds the links of fluid nodes to nodes that are solid because of `reason`, and their cuts with the
  /// surface. Costs as many operations as the surface is long.
  void build(const Surface& surface, const Cells& cells, std::uint8_t reason, const Populations& layout);
  void clear();

  /// Writes the incoming populations and corrects those at rest: once per step. Every thread of a parallel
  /// region calls it.
  void reflect(Populations& populations, Parity parity, bool compressible) const;
  /// On the surface, from the populations as `reflect` left them; with `bodies`, which name the body of each
  /// node of the surface, on one of them.
  [[nodiscard]] Force force(const Populations& populations, std::span<const std::uint32_t> bodies = {},
                            std::uint32_t body = 0) const;
  /// Adds `weight` times the same force to the nodes of the surface, two components each: every link's to
  /// both ends of the segment that it meets, so that the moment stays.
  void add_node_forces(const Populations& populations, double weight, std::vector<double>& force) const;
  [[nodiscard]] const LinkCounts& counts() const { return counts_; }

  struct Place {
    Node node;
    int direction = 0;
    double q = 0.5;
    double velocity_x = 0;  // of the wall [lattice units]
    double velocity_y = 0;
    std::uint32_t surface_node = 0;  // first node of the segment that is cut
    std::uint32_t surface_end = 0;   // its last one
    double along = 0;                // where it is cut, 0 at the first node
  };
  [[nodiscard]] const std::vector<Place>& places() const { return places_; }

private:
  [[nodiscard]] Force force_of(std::size_t link, const Populations& populations) const;
  // Of all links, in their order.
  const std::vector<Force>& forces(const Populations& populations) const;
  // What the rule needs, ready to use after an even [0] and an odd [1] step.
  struct Rule {
    std::array<std::ptrdiff_t, 2> leaving;
    std::array<std::ptrdiff_t, 2> second;
    std::array<std::ptrdiff_t, 2> incoming;
    double weight_leaving = 1;
    double weight_second = 0;
    double wall = 0;         // mass that the moving wall adds half-way on the link, at density 1
    double wall_weight = 1;  // of that in the rule
  };
  struct Cut {
    double q = 2;
    double along = 0;  // along the segment
    std::uint32_t segment = 0;
  };
  struct Candidate {
    Node node;
    std::array<Cut, D2Q9::count> cuts;
  };
  void visit(Node node, const Segment& segment, std::uint32_t number, const Cells& cells,
             std::uint8_t reason);
  void add(const Candidate& candidate, int direction, const Surface& surface, const Cells& cells,
           const Populations& layout);

  Grid grid_;
  Ranks* ranks_;
  mutable std::vector<Force> forces_;
  std::vector<std::int32_t> candidate_of_;  // per node, -1 without
  std::vector<Candidate> candidates_;
  std::vector<Place> places_;
  std::vector<Rule> rules_;                 // links of one node next to each other
  std::vector<std::size_t> first_of_node_;  // and one past the last
  LinkCounts counts_;
};

}  // namespace estuary::fluid
