// The state of a flow and how a time step goes: boundary rules, then collision and streaming.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "blocks.hpp"
#include "cells.hpp"
#include "collide.hpp"
#include "edge_links.hpp"
#include "fields.hpp"
#include "links.hpp"
#include "populations.hpp"
#include "refill.hpp"
#include "round_bodies.hpp"
#include "saturated_cells.hpp"
#include "sides.hpp"
#include "still_links.hpp"
#include "surface.hpp"
#include "wet_load.hpp"

namespace estuary::fluid {

struct FlowSettings {
  Grid grid;
  Sides sides;
  CollisionModel collision = CollisionModel::trt;
  EquilibriumModel equilibrium = EquilibriumModel::incompressible;
  Rates rates;
  ForceModel force = ForceModel::none;
  ViscosityModel viscosity = ViscosityModel::constant;
  std::array<double, 3> acceleration{};  // body force per mass
  double magic_parameter = 3.0 / 16.0;   // where the viscosity varies
  ViscosityLaw law;
  Storage storage = Storage::double_precision;
  bool drop_solid_nodes = true;  // from memory, where that saves a tenth of it; changes no bit of any result
  RefillRule refill = RefillRule::extrapolated_nonequilibrium;  // behind moving discs and spheres
  Ranks* ranks = nullptr;  // that share the grid, as the grid itself says; outlive the flow

  [[nodiscard]] StepChoice step() const {
    return {grid.dimension(), collision, equilibrium, force, viscosity, storage};
  }
  /// What velocities gain from the body force beyond the populations' momentum.
  [[nodiscard]] std::array<double, 3> velocity_shift() const {
    if (force != ForceModel::guo) return {};
    return {0.5 * acceleration[0], 0.5 * acceleration[1], 0.5 * acceleration[2]};
  }
};

struct MoveCounts {
  std::size_t covered = 0;
  std::size_t uncovered = 0;
  std::size_t orphans = 0;  // uncovered without a fluid node to start from
};

/// Links to walls between the nodes, and those whose rule lacked a fluid node behind the first: in gaps.
struct WallCounts {
  std::size_t links = 0;
  std::size_t fallbacks = 0;   // by the rule with the next fewer nodes, at last half-way (wall_links.hpp)
  std::size_t unresolved = 0;  // no cut found on the link: taken as half-way
};

/// All in lattice units except positions of surfaces [m] and velocities of surfaces [m/s].
class Flow {
public:
  explicit Flow(const FlowSettings& settings);

  [[nodiscard]] const Grid& grid() const { return settings_.grid; }
  [[nodiscard]] const FlowSettings& settings() const { return settings_; }
  [[nodiscard]] Sides& sides() { return settings_.sides; }
  /// The body force from now on [lattice units].
  void set_acceleration(const std::array<double, 3>& acceleration) {
    settings_.acceleration = acceleration;
    parameters_.acceleration = acceleration;
  }
  [[nodiscard]] Populations& populations() { return populations_; }
  [[nodiscard]] const Populations& populations() const { return populations_; }
  [[nodiscard]] const Cells& cells() const { return cells_; }

  /// Fixed obstacles: closed outlines, walked clockwise. To be called before the first step.
  /// With a rule their walls follow it everywhere, and edges are not treated (edge_links.hpp). `bodies`
  /// numbers the body that each node belongs to, for forces on single ones.
  void set_obstacles(std::size_t nodes, std::vector<std::uint32_t> connectivity,
                     std::span<const double> positions, std::optional<WallRule> rule = {},
                     std::vector<std::uint32_t> bodies = {});
  /// The wet surface, not yet anywhere, and where its links close gradually (edge_links.hpp).
  void set_wet_surface(std::size_t nodes, std::vector<std::uint32_t> connectivity,
                       EdgeLinks::Extent closing = EdgeLinks::Extent::edges);
  /// Moves the wet surface and gives populations to the nodes it leaves. Does nothing when it is where it
  /// was.
  MoveCounts move_wet_surface(std::span<const double> positions, std::span<const double> velocities,
                              double velocity_scale);
  /// Grains in the fluid, lattice units, as partially saturated cells.
  void place_grains(const Grains& grains) {
    expect_other_walls();
    saturated_.place(grains, cells_);
  }
  [[nodiscard]] SaturatedCells& grains() { return saturated_; }
  [[nodiscard]] const SaturatedCells& grains() const { return saturated_; }
  /// Discs and spheres with walls between the nodes, lattice units; `fill` gives populations to nodes they
  /// leave. Their number stays.
  MoveCounts place_bodies(const Grains& bodies, const std::vector<WallRule>& rules, bool fill);
  [[nodiscard]] RoundBodies& bodies() { return bodies_; }
  [[nodiscard]] const RoundBodies& bodies() const { return bodies_; }
  /// Fixed solid nodes with walls half-way on their links, as from an image. `solid` has one entry per node
  /// (Grid::index): 0 in the fluid, one more than the number of the body elsewhere. To be called before the
  /// first step, and after `set_obstacles`.
  /// `other_walls`: a wet surface, bodies or grains will be there as well; refused without.
  void set_solid_nodes(const std::vector<std::uint16_t>& solid, bool other_walls = false);
  /// What the flow can be given back later: everything but the surfaces and the sides' values.
  struct State {
    std::vector<double> populations;
    std::vector<double> body_memory;  // of one-point wall rules
    std::vector<double> outline_memory;
    std::vector<double> grain_loads;  // of partially saturated cells, in the last step
    Parity parity = Parity::odd;
    bool rules_applied = false;
    bool sides_complete = false;
    bool rows_complete = true;  // of a slab (halo.hpp)
  };
  void copy_to(State& state) const;
  /// The same for a checkpoint, to be called by all ranks: the first one gets the state of the whole grid,
  /// laid out as in one process that holds it.
  void gather(State& state);
  /// And back: of a state that the first rank has, all get their part. `state` as `copy_to` made it.
  void scatter(State& state);
  /// Length of the populations that `gather` gives.
  [[nodiscard]] std::size_t values_of_whole_state() const;
  /// The wet surface has to be given as it was when the state was copied; no node is given new populations.
  void give_back(const State& state, std::span<const double> positions, std::span<const double> velocities,
                 double velocity_scale);

  /// That share a step.
  [[nodiscard]] int threads() const;
  /// Steps with fixed surfaces and sides.
  void run(std::size_t steps);
  /// The boundary rules alone; afterwards fields, loads and forces can be read. The next step does not repeat
  /// them, so looking at a flow does not change how it goes on.
  void apply_boundaries();

  /// Density and velocities, half of a body force included, with boundaries applied.
  void compute_fields(Fields& fields);

  [[nodiscard]] const Surface* wet_surface() const { return wet_ ? &*wet_ : nullptr; }
  [[nodiscard]] const Surface* obstacles() const { return obstacles_ ? &*obstacles_ : nullptr; }
  /// What the step of one node reads and writes of populations.
  [[nodiscard]] double bytes_per_update() const {
    return 2.0 * populations_.lattice().count *
           (populations_.storage() == Storage::single_precision ? sizeof(float) : sizeof(double));
  }
  /// Momentum exchange on the surfaces, after `apply_boundaries`.
  [[nodiscard]] Force wet_force() const;
  /// Adds `weight` times the force on the wet surface at its nodes, two components each.
  void add_wet_node_forces(double weight, std::vector<double>& force) const;
  [[nodiscard]] Force obstacle_force() const;
  /// On the outlines and the solid nodes of one body; torque about node (0, 0, 0).
  [[nodiscard]] BodyLoad obstacle_load(std::uint32_t body) const;
  /// Of the last step, or the mean while bodies are measured.
  [[nodiscard]] BodyLoad body_load(std::size_t body) const;
  [[nodiscard]] BodyLoad solid_nodes_load() const;
  /// Adds up the bodies' loads in every step from now on.
  void measure_bodies(bool on) { measure_bodies_ = on; }
  [[nodiscard]] WallCounts wall_counts() const;
  [[nodiscard]] const Links& wet_links() const { return wet_links_; }
  [[nodiscard]] const Links& obstacle_links() const { return obstacle_links_; }

private:
  MoveCounts place(std::span<const double> positions, std::span<const double> velocities,
                   double velocity_scale, bool fill);
  void link_obstacles();
  template <class Visit>
  void visit_walls(const Populations::Packing& packing, Visit&& visit) const;
  // Throws std::logic_error where set_solid_nodes was told that there are none.
  void expect_other_walls() const;
  // The nodes that need memory where the solid's has been given up: fluid, and nodes that a rule for links
  // writes to. Empty where that saves too little.
  [[nodiscard]] std::vector<std::uint8_t> needed_nodes() const;
  void drop_solid_nodes();
  void apply_rules(Parity parity, bool sides_complete);
  // Where ranks share the grid: what the rules wrote beyond this one's slab goes there, before anything
  // moves.
  void settle();
  [[nodiscard]] bool looks_beside() const;

  FlowSettings settings_;
  Populations populations_;
  Cells cells_;
  CollideAndStream step_;
  std::unique_ptr<Halo> halo_;                         // null when the grid is not shared
  std::unique_ptr<const ViscosityTable> viscosities_;  // of a generalised Newtonian fluid
  CollisionParameters parameters_;
  bool rules_applied_ = false;   // since the last step or move
  bool sides_complete_ = false;  // since the last step
  bool measure_bodies_ = false;
  std::optional<Surface> obstacles_;
  std::optional<Surface> wet_;
  SolidRows rows_;
  Links obstacle_links_;
  Links wet_links_;
  EdgeLinks obstacle_edges_;
  EdgeLinks wet_edges_;
  SaturatedCells saturated_;
  RoundBodies bodies_;
  StillLinks solid_node_links_;
  StillLinks
      links_at_sides_;  // of solid nodes, those that an open side looks at or that cross a periodic one
  Blocks blocks_;
  WallLinks outline_links_;  // of obstacles with a rule
  std::optional<WallRule> outline_rule_;
  std::vector<std::uint32_t> outline_bodies_;  // per node of the obstacles' outlines
  std::vector<double> placed_;                 // positions and velocities as last given
  bool packs_alone_ = false;                   // one process would give up memory of solid nodes
  bool other_walls_ = true;                    // than those of solid nodes may be there
  std::vector<double> obstacle_bounds_;        // left, bottom, right, top in lattice coordinates
};

}  // namespace estuary::fluid
