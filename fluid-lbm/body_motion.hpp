// Places the discs and spheres with walls between the nodes: the scene's obstacles, on their way over time,
// and grains when they are "interpolated".
#pragma once

#include "flow.hpp"
#include "fluid_scene.hpp"

namespace estuary::fluid {

class BodyMotion {
public:
  explicit BodyMotion(const FluidScene& scene);
  /// No obstacle moves.
  [[nodiscard]] bool fixed() const { return fixed_; }
  [[nodiscard]] std::size_t obstacle_count() const { return scene_.round_obstacles.size(); }
  /// `grains` (lattice units, may be none) follow the obstacles. With `fill` nodes that are left get
  /// populations.
  void place(double time, const Grains& grains, Flow& flow, bool fill) const;

private:
  const FluidScene& scene_;
  bool fixed_ = true;
};

}  // namespace estuary::fluid
