// Links between fluid nodes and the walls of rigid bodies, with a choice of rules, in two and three
// dimensions.
//
// The wall cuts the link from node x along c_i at the fraction q. With f* the populations after the
// collision, `in` the opposite of i and W = 6 w_i rho c_in.u_wall, what comes back is
//   halfway         f*_i(x) + W                                               (Ladd 1994; q is ignored)
//   linear          q < 1/2:  2q f*_i(x) + (1 - 2q) f*_i(x - c_i) + W
//                   q >= 1/2: f*_i(x)/(2q) + (1 - 1/(2q)) f*_in(x) + W/(2q)   (Bouzidi, Firdaouss, Lallemand,
//                                                                             Phys. Fluids 13 (2001))
//   quadratic       q < 1/2:  q(2q+1) f*_i(x) + (1-4q^2) f*_i(x-c_i) - q(1-2q) f*_i(x-2c_i) + W
//                   q >= 1/2: [f*_i(x) + W]/(q(2q+1)) + (2q-1)/q f*_in(x) + (1-2q)/(1+2q) f*_in(x-c_i)
//                                                                             (the same)
//   central-linear  f*_i(x) + (1-2q)/(1+2q) [f*_i(x-c_i) - f*_in(x)] + 2 W/(1+2q)
//                                                  (Ginzburg, Verhaeghe, d'Humieres 2008: CLI)
//   yin-zhang       f*_i(x) + 6 w_i rho c_in.u_m, u_m the velocity half-way on the link, interpolated between
//                   the wall and x (q >= 1/2) or x - c_i                      (Yin, Zhang, J. Comput. Phys.
//                   231
//                                                                             (2012))
//   one-point       k f*_i(x) + (1-k) f*_in(x) + k W + (2kq-1) D+ + (1-k) D- + 2k (C - L) <F_i - D->
//                   with k = 1 for q < 1/2, else 1/(2q); D+ and D- the change that the last collision made
//                   to the even and the odd part of the pair (f_i, f_in) at x; F_i = 3 w_i rho c_i.a;
//                   L = tau- - 1/2 and C = 3 q^2 / (4 (tau+ - 1/2)).
//                   Of the class of one-node rules of Zhao, Yong, J. Comput. Phys. 329 (2017), and Marson,
//                   Thorimbert, Chopard, Ginzburg, Latt, Phys. Rev. E 103 (2021), with this project's
//                   coefficients: by D+ the wall's velocity is met at q for any relaxation time, and by C
//                   Poiseuille flow along an axis of the lattice is exact for any q, relaxation time and
//                   magic parameter. Where the viscosity varies C = L. <> is a mean over the last steps, the
//                   more the larger its weight: taken at once it is unstable at small relaxation times. A
//                   link's first step has no D and does without.
// A rule that lacks a fluid node behind x falls back: quadratic to linear, the others to half-way; counted.
// One-point needs none.
// Interpolation does not keep a node's mass; what its links gain beyond the wall's motion is taken from its
// population at rest (in the manner of Kao, Yang 2008).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "cells.hpp"
#include "populations.hpp"
#include "ranks.hpp"
#include "wall_memory.hpp"

namespace estuary::fluid {

enum class WallRule { linear, halfway, quadratic, central_linear, yin_zhang, one_point };

/// Relaxation times less one half of the even and the odd part; zero where they vary from node to node.
struct RelaxationParts {
  double even = 0;
  double odd = 0;
};

/// Force and torque on one body, lattice units; about its centre.
struct BodyLoad {
  std::array<double, 3> force{};
  std::array<double, 3> torque{};
  void operator+=(const BodyLoad& other) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      force[axis] += other.force[axis];
      torque[axis] += other.torque[axis];
    }
  }
};

struct WallLinkCounts {
  std::size_t links = 0;
  std::size_t fallbacks = 0;  // by a rule with fewer nodes
};

class WallLinks {
public:
  WallLinks() = default;
  /// Where ranks share the grid, every one knows all links and reflects at those of its own nodes.
  explicit WallLinks(RelaxationParts relaxation, Ranks* ranks = nullptr)
      : relaxation_(relaxation), ranks_(ranks) {}

  void clear();
  /// Adds the link of `node` along direction i; links of one node one after another. `arm` goes from the
  /// body's centre to where the wall cuts the link.
  void add(Node node, int i, double q, WallRule rule, const std::array<double, 3>& velocity,
           std::uint32_t body, const std::array<double, 3>& arm, const Cells& cells,
           const Populations& layout);
  /// After the last `add`: sorts the links by body for the loads.
  void finish(std::size_t bodies);
  [[nodiscard]] bool empty() const { return rules_.empty(); }
  [[nodiscard]] const WallLinkCounts& counts() const { return counts_; }
  /// A rule looks at more than its own node's populations, as the quadratic one and Yin-Zhang's do.
  [[nodiscard]] bool looks_beside() const { return looks_beside_; }

  /// Writes the incoming populations: once per step, by every thread of a parallel region.
  /// `acceleration` is the body force per mass.
  void reflect(Populations& populations, Parity parity, bool compressible,
               const std::array<double, 3>& acceleration = {});
  /// What one-point rules need of a step's populations, once all rules are applied; every thread calls it.
  void note(const Populations& populations, Parity parity) {
    if (!memory_.empty()) memory_.note(populations, parity);
  }
  [[nodiscard]] WallMemory& memory() { return memory_; }
  [[nodiscard]] const WallMemory& memory() const { return memory_; }
  /// Momentum exchange (Wen, Zhang, Tu, Wang, Fang, J. Comput. Phys. 266 (2014)), from the populations as
  /// `reflect` left them.
  [[nodiscard]] BodyLoad load(const Populations& populations, Parity parity, std::size_t body) const;
  /// On all bodies.
  [[nodiscard]] BodyLoad load(const Populations& populations, Parity parity) const;
  /// On each body, to be asked for by all ranks at once.
  void loads(const Populations& populations, Parity parity, std::vector<BodyLoad>& of_body) const;
  /// The memory's values, of all ranks' links.
  [[nodiscard]] std::vector<double> save_memory() const;

private:
  [[nodiscard]] BodyLoad load_of_link(const Populations& populations, Parity parity, std::size_t link) const;
  // Locations after an even [0] and an odd [1] step.
  struct Rule {
    std::array<std::ptrdiff_t, 2> leaving;
    std::array<std::ptrdiff_t, 2> incoming;
    std::array<std::ptrdiff_t, 2> second;
    std::array<std::ptrdiff_t, 2> third;
    double weight_leaving = 1;
    double weight_second = 0;
    double weight_third = 0;
    double wall = 0;         // mass that the moving wall adds half-way on the link, at density 1
    double wall_weight = 1;  // of that in the rule
    // Yin-Zhang: u_m = wall part + share of the velocity at a node.
    std::ptrdiff_t velocity_node = -1;
    double velocity_share = 0;
    int direction = 0;
    // One-point: number in the memory, weights of the changes and of the force along the link.
    std::ptrdiff_t memory = -1;
    double weight_even = 0;
    double weight_odd = 0;
    double weight_excess = 0;
    double mean_rate = 0;
  };
  struct Place {
    std::uint32_t body = 0;
    int direction = 0;
    std::array<double, 3> velocity{};
    std::array<double, 3> arm{};
    std::int32_t owner = 0;  // rank of the node
  };
  std::vector<Rule> rules_;
  std::vector<Place> places_;
  std::vector<std::size_t> first_of_node_;
  std::vector<std::ptrdiff_t> nodes_;
  std::vector<std::size_t> first_of_body_;
  std::vector<std::uint32_t> by_body_;
  WallLinkCounts counts_;
  RelaxationParts relaxation_;
  Ranks* ranks_ = nullptr;
  bool looks_beside_ = false;
  // Of each body: the rank that has all its links, or -1 where several have some.
  std::vector<std::int32_t> owner_of_body_;
  WallMemory memory_;
};

}  // namespace estuary::fluid
