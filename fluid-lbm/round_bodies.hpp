// Discs and spheres whose walls lie between the nodes: fixed obstacles, bodies on a prescribed way, or
// grains. Their nodes are no fluid; links to them follow a rule of wall_links.hpp; nodes they leave are
// filled (refill.hpp).
#pragma once

#include <vector>

#include "cells.hpp"
#include "populations.hpp"
#include "saturated_cells.hpp"
#include "wall_links.hpp"

namespace estuary::fluid {

struct RoundMove {
  std::vector<Node> uncovered;
  std::size_t covered = 0;
};

class RoundBodies {
public:
  explicit RoundBodies(const Grid& grid, RelaxationParts relaxation = {}, Ranks* ranks = nullptr);

  /// Marks the nodes inside and finds the links; gives back false when nothing changed. Outside of a
  /// parallel region.
  bool place(const Grains& bodies, const std::vector<WallRule>& rules, Cells& cells,
             const Populations& layout, RoundMove& move);
  [[nodiscard]] bool empty() const { return bodies_.count() == 0; }
  [[nodiscard]] const Grains& bodies() const { return bodies_; }
  [[nodiscard]] const WallLinks& links() const { return links_; }
  [[nodiscard]] WallLinks& links() { return links_; }

  /// Velocity of the body that covers a point, or that is nearest to it, there [lattice units], and the
  /// normal into the fluid.
  struct Wall {
    std::array<double, 3> normal{};
    std::array<double, 3> velocity{};
  };
  [[nodiscard]] Wall nearest(Node node) const;

  /// Adds this step's loads, after the rules; every thread of a parallel region calls it.
  void add_loads(const Populations& populations, Parity parity);
  /// Mean since `restart_loads`.
  [[nodiscard]] GrainLoads mean_loads() const;
  [[nodiscard]] BodyLoad mean_load(std::size_t body) const;
  void restart_loads();

private:
  struct Cut {
    double q = 2;
    std::uint32_t body = 0;
  };
  struct Candidate {
    Node node;
    std::array<Cut, most_velocities> cuts;
  };
  void mark(Cells& cells, RoundMove& move);
  void find_links(const Cells& cells, const Populations& layout);
  [[nodiscard]] std::array<double, 3> offset(std::size_t body, Node node) const;
  [[nodiscard]] std::array<double, 3> velocity_at(std::size_t body, const std::array<double, 3>& arm) const;

  Grid grid_;
  Ranks* ranks_;
  Grains bodies_;
  std::vector<WallRule> rules_;
  WallLinks links_;
  std::vector<std::vector<Span>> rows_;
  std::vector<std::int32_t> candidate_of_;
  std::vector<Candidate> candidates_;
  std::vector<BodyLoad> sums_;
  std::vector<BodyLoad> of_step_;  // where ranks share the grid
  std::size_t steps_ = 0;
};

}  // namespace estuary::fluid
