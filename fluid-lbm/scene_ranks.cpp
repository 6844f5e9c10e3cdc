#include <fmt/format.h>

#include <algorithm>

#include "scene_parts.hpp"

namespace estuary::fluid {
namespace {

// A slab has to be thicker than what its neighbours want to know of it, from both sides.
constexpr int fewest_layers = 2 * Populations::halo;

bool has_rule(const FluidScene& scene, WallRule rule) {
  return scene.outline_rule == rule ||
         (scene.has_grains && scene.grain_method == GrainMethod::interpolated && scene.grain_rule == rule) ||
         std::any_of(scene.round_obstacles.begin(), scene.round_obstacles.end(),
                     [rule](const RoundObstacle& obstacle) { return obstacle.rule == rule; });
}

}  // namespace

void read_ranks(SceneTable& fluid, FluidScene& result, Plan& plan) {
  result.ranks = static_cast<int>(fluid.integer_or("ranks", 1, 1, 100'000));
  if (result.ranks == 1) {
    plan.left_out.emplace_back("MPI: one process holds the whole lattice");
    return;
  }
  const Grid& grid = result.flow.grid;
  if (grid.nx == 0) return;  // a problem was noted
  const char* const layers = grid.nz > 0 ? "planes of nodes along z" : "rows of nodes along y";
  if (grid.slab_layers() < fewest_layers * result.ranks) {
    fluid.problem("ranks", fmt::format("{} ranks need {} {} each, the grid has {}: at most {} ranks",
                                       result.ranks, fewest_layers, layers, grid.slab_layers(),
                                       std::max(1, grid.slab_layers() / fewest_layers)));
    return;
  }
  if (has_rule(result, WallRule::yin_zhang) && result.flow.equilibrium == EquilibriumModel::compressible) {
    fluid.problem("ranks",
                  "wall_rule = \"yin-zhang\" with the compressible equilibrium works on one rank only: take "
                  "another wall_rule, or leave `ranks` out");
  }
  plan.derived.emplace_back(
      "ranks", fmt::format("{}, each with {} {}", result.ranks, grid.slab_layers() / result.ranks, layers));
}

}  // namespace estuary::fluid
