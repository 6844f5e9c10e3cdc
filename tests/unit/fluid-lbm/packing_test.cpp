// Memory without the solid's nodes, as among the pores of a picture.
#include <gtest/gtest.h>
#include <omp.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "flow_cases.hpp"

namespace estuary::fluid {
namespace {

// Blobs and single nodes at random, most of the box; the outermost nodes as they come.
std::vector<std::uint16_t> grains_of(const Grid& grid) {
  std::mt19937 random(7);
  std::vector<std::uint16_t> solid(grid.size(), 0);
  std::uniform_int_distribution<int> any(0, 1 << 30);
  const int depth = grid.layers();
  const int blobs = static_cast<int>(grid.size()) / (depth > 1 ? 140 : 84);
  for (int blob = 0; blob < blobs; ++blob) {
    const int x0 = any(random) % grid.nx;
    const int y0 = any(random) % grid.ny;
    const int z0 = any(random) % depth;
    const int radius = blob % 9;
    for (int z = std::max(z0 - radius, 0); z <= std::min(z0 + radius, depth - 1); ++z) {
      for (int y = std::max(y0 - radius, 0); y <= std::min(y0 + radius, grid.ny - 1); ++y) {
        for (int x = std::max(x0 - radius, 0); x <= std::min(x0 + radius, grid.nx - 1); ++x) {
          const int square = (x - x0) * (x - x0) + (y - y0) * (y - y0) + (z - z0) * (z - z0);
          if (square <= radius * radius) solid[grid.index(x, y, z)] = 1;
        }
      }
    }
  }
  return solid;
}

Grid grid_of(int nx, int ny, int nz = 0) {
  Grid grid{nx, ny, 1.0, 0.0, 0.0};
  grid.nz = nz;
  return grid;
}

FlowSettings settings_of(const Grid& grid, bool all_periodic, Storage storage) {
  const bool space = grid.nz > 0;
  FlowSettings settings;
  settings.grid = grid;
  settings.rates = relaxation_rates(0.02, 3.0 / 16.0);
  settings.storage = storage;
  const int sides = side_count(settings.grid.dimension());
  if (all_periodic) {
    settings.grid.periodic_x = settings.grid.periodic_y = true;
    settings.grid.periodic_z = space;
    for (int s = 0; s < sides; ++s) settings.sides[static_cast<std::size_t>(s)].kind = SideKind::periodic;
    settings.force = storage == Storage::double_precision ? ForceModel::guo : ForceModel::none;
    settings.acceleration = {1e-5, -2e-5, space ? 1e-5 : 0.0};
    return settings;
  }
  const auto nodes = static_cast<std::size_t>(settings.grid.rows());
  Side& inlet = settings.sides[left];
  inlet.kind = SideKind::velocity;
  inlet.velocity_x.assign(nodes, 0.03);
  inlet.velocity_y.assign(nodes, 0.0);
  inlet.velocity_z.assign(space ? nodes : 0, 0.0);
  settings.sides[right].kind = SideKind::outflow;
  settings.sides[right].relaxation = 0.25;
  settings.sides[right].excess.assign(nodes, 0.0);
  // A sliding wall as well.
  Side& lid = settings.sides[top];
  const auto points =
      static_cast<std::size_t>((2 * settings.grid.nx + 1) * (space ? 2 * settings.grid.nz + 1 : 1));
  lid.velocity_x.assign(points, 0.02);
  lid.velocity_y.assign(points, 0.0);
  lid.velocity_z.assign(space ? points : 0, 0.0);
  return settings;
}

struct Result {
  struct Moment {
    Fields fields;
    BodyLoad load;
  };
  std::vector<Moment> moments;
  bool packed = false;
  int threads = 0;
};

// A body where nothing sees it. Where there may be others, solid nodes next to the fluid keep their memory.
void place_body_in_a_grain(Flow& flow, const std::vector<std::uint16_t>& solid) {
  const Grid& grid = flow.grid();
  const int reach = grid.nz > 0 ? 1 : 0;
  for (int z = reach; z < grid.layers() - reach; ++z) {
    for (int y = 1; y + 1 < grid.ny; ++y) {
      for (int x = 1; x + 1 < grid.nx; ++x) {
        bool inside = true;
        for (int dz = -reach; dz <= reach; ++dz)
          for (int dy = -1; dy <= 1; ++dy)
            for (int dx = -1; dx <= 1; ++dx)
              inside = inside && solid[grid.index(x + dx, y + dy, z + dz)] != 0;
        if (!inside) continue;
        const double centre[] = {double(x), double(y), double(z)};
        const int dimension = grid.dimension();
        const auto turns = static_cast<std::size_t>(dimension == 3 ? 3 : 1);
        const auto axes = static_cast<std::size_t>(dimension);
        flow.place_bodies(
            {dimension, {centre, centre + axes}, {0.3}, std::vector(axes, 0.0), std::vector(turns, 0.0)},
            {WallRule::linear}, false);
        return;
      }
    }
  }
  FAIL() << "no node inside the grains";
}

Result run(FlowSettings settings, bool drop, int threads, bool other_walls = false) {
  omp_set_num_threads(threads);
  settings.drop_solid_nodes = drop;
  Flow flow(settings);
  const std::vector<std::uint16_t> solid = grains_of(settings.grid);
  flow.set_solid_nodes(solid, other_walls);
  if (other_walls) place_body_in_a_grain(flow, solid);
  Fields start;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-0.01, 0.01);
  for (std::size_t n = 0; n < settings.grid.size(); ++n) {
    start.velocity_x.push_back(any(random));
    start.velocity_y.push_back(any(random));
    if (settings.grid.nz > 0) start.velocity_z.push_back(any(random));
    start.excess.push_back(any(random));
  }
  set_equilibrium(flow.populations(), start, settings.equilibrium);
  Result result;
  const auto look = [&] {
    Result::Moment& moment = result.moments.emplace_back();
    flow.compute_fields(moment.fields);
    moment.load = flow.solid_nodes_load();
  };
  // Saved, gone on with and looked at after odd and after even steps.
  Flow::State state;
  flow.run(15);
  flow.copy_to(state);
  flow.run(6);
  flow.give_back(state, {}, {}, 1.0);
  flow.run(10);
  look();
  flow.run(1);
  look();
  flow.copy_to(state);
  flow.run(5);
  flow.give_back(state, {}, {}, 1.0);
  flow.run(3);
  look();
  result.packed = flow.populations().packed();
  result.threads = flow.threads();
  return result;
}

void expect_same(const Result& one, const Result& other, const std::string& which) {
  ASSERT_EQ(one.moments.size(), other.moments.size());
  for (std::size_t n = 0; n < one.moments.size(); ++n) {
    const Result::Moment& a = one.moments[n];
    const Result::Moment& b = other.moments[n];
    EXPECT_EQ(a.fields.velocity_x, b.fields.velocity_x) << which << ' ' << n;
    EXPECT_EQ(a.fields.velocity_y, b.fields.velocity_y) << which << ' ' << n;
    EXPECT_EQ(a.fields.velocity_z, b.fields.velocity_z) << which << ' ' << n;
    EXPECT_EQ(a.fields.excess, b.fields.excess) << which << ' ' << n;
    EXPECT_EQ(a.load.force, b.load.force) << which << ' ' << n;
    EXPECT_EQ(a.load.torque, b.load.torque) << which << ' ' << n;
  }
  EXPECT_NE(one.moments.front().load.torque[2], 0.0) << which;
}

// Every kind of side, both lattices and precisions: not a bit of the flow or of the loads changes against a
// step along whole rows.
TEST(Packing, ChangesNoBit) {
  const int threads_before = omp_get_max_threads();
  for (const bool space : {false, true}) {
    const Grid grid = space ? grid_of(31, 19, 17) : grid_of(71, 53);
    for (const bool all_periodic : {false, true}) {
      for (const Storage storage : {Storage::double_precision, Storage::single_precision}) {
        const FlowSettings settings = settings_of(grid, all_periodic, storage);
        const std::string which = variant_name(settings.step()) + (all_periodic ? " periodic" : "");
        const Result rows = run(settings, false, 1, true);
        const auto& velocity = rows.moments.front().fields.velocity_x;
        EXPECT_GT(*std::max_element(velocity.begin(), velocity.end()), 1e-4);
        const Result packed = run(settings, true, 1);
        EXPECT_TRUE(packed.packed) << which;
        expect_same(packed, rows, which);
        const Result beside = run(settings, true, 1, true);
        EXPECT_TRUE(beside.packed) << which;
        expect_same(beside, rows, which + " with other walls");
      }
    }
  }
  omp_set_num_threads(threads_before);
}

// Nor do threads that share the groups of blocks; enough nodes for three of them.
TEST(Packing, ChangesNoBitOnThreads) {
  const int threads_before = omp_get_max_threads();
  for (const bool all_periodic : {false, true}) {
    const FlowSettings settings = settings_of(grid_of(311, 93), all_periodic, Storage::double_precision);
    const Result rows = run(settings, false, 1, true);
    for (const int threads : {2, 3}) {
      const std::string which = std::to_string(threads) + (all_periodic ? " threads, periodic" : " threads");
      const Result packed = run(settings, true, threads);
      EXPECT_TRUE(packed.packed) << which;
      EXPECT_EQ(packed.threads, threads);
      expect_same(packed, rows, which);
    }
    expect_same(run(settings, false, 3), rows, "3 threads, not packed");
  }
  omp_set_num_threads(threads_before);
}

// Nor with any variant of the step in double precision.
TEST(Packing, ChangesNoBitOfAnyVariant) {
  const int threads_before = omp_get_max_threads();
  int variants = 0;
  for (const bool space : {false, true}) {
    FlowSettings settings =
        settings_of(space ? grid_of(23, 15, 9) : grid_of(47, 37), true, Storage::double_precision);
    settings.law.smagorinsky_constant = 0.17;
    settings.law.base_viscosity = settings.law.consistency = 0.02;
    settings.law.index = 0.7;
    settings.law.smallest = 1e-3;
    settings.law.largest = 1;
    for (const auto collision : {CollisionModel::trt, CollisionModel::bgk,
                                 CollisionModel::recursive_regularised, CollisionModel::central_moment}) {
      for (const auto equilibrium : {EquilibriumModel::incompressible, EquilibriumModel::compressible}) {
        for (const auto force : {ForceModel::none, ForceModel::guo, ForceModel::unshifted}) {
          for (const auto viscosity : {ViscosityModel::constant, ViscosityModel::smagorinsky,
                                       ViscosityModel::generalised_newtonian}) {
            settings.collision = collision;
            settings.equilibrium = equilibrium;
            settings.force = force;
            settings.viscosity = viscosity;
            if (!collide_and_stream(settings.step())) continue;
            ++variants;
            const std::string which = variant_name(settings.step());
            const Result packed = run(settings, true, 1);
            EXPECT_TRUE(packed.packed) << which;
            expect_same(packed, run(settings, false, 1, true), which);
          }
        }
      }
    }
  }
  EXPECT_EQ(variants, 80);
  omp_set_num_threads(threads_before);
}

// What moves among the grains: walls between the nodes, partially saturated cells, or a wet surface.
enum class Mover { none, walls, saturated, wet };

struct Moved {
  std::vector<Fields> fields;
  std::vector<BodyLoad> loads;  // on the mover and on the grains, by turns
  std::size_t covered = 0;
  std::size_t uncovered = 0;
  std::size_t over_dropped = 0;  // nodes that it lay on and that have no memory
  int threads = 0;
};

// A disc or sphere of radius 5.3 (3.4 in space) that goes a tenth of a spacing a step, half as fast upwards.
Moved move(FlowSettings settings, bool drop, Mover mover, WallRule rule, int threads = 1) {
  omp_set_num_threads(threads);
  settings.drop_solid_nodes = drop;
  Flow flow(settings);
  const Grid& grid = settings.grid;
  const bool space = grid.nz > 0;
  const auto axes = static_cast<std::size_t>(grid.dimension());
  flow.set_solid_nodes(grains_of(grid), true);
  const double radius = space ? 3.4 : 5.3;
  const std::vector<double> speed = space ? std::vector{0.1, 0.05, 0.03} : std::vector{0.1, 0.05};
  cases::Outline outline = cases::disc(0, 0, radius, 60);
  if (mover == Mover::wet) flow.set_wet_surface(outline.nodes(), outline.connectivity);
  if (mover == Mover::saturated) flow.grains().restart_loads();
  Moved moved;
  constexpr int steps = 90;
  for (int step = 0; step <= steps; ++step) {
    std::vector<double> centre{(space ? 16.2 : 8.2) + 0.1 * step, (space ? 10.7 : 8.7) + 0.05 * step};
    if (space) centre.push_back(6.1 + 0.03 * step);
    const Grains body{grid.dimension(), centre, {radius}, speed, std::vector(space ? 3UL : 1UL, 0.01)};
    MoveCounts counts;
    if (mover == Mover::walls) counts = flow.place_bodies(body, {rule}, true);
    if (mover == Mover::saturated) flow.place_grains(body);
    if (mover == Mover::wet) {
      outline = cases::disc(centre[0], centre[1], radius, 60);
      std::vector<double> velocities;
      for (std::size_t n = 0; n < outline.nodes(); ++n) velocities.insert(velocities.end(), {0.1, 0.05});
      counts = flow.move_wet_surface(outline.positions, velocities, 1.0);
    }
    moved.covered += step > 0 ? counts.covered : 0;
    moved.uncovered += counts.uncovered;
    flow.run(1);
    if (step % 15 != 0) continue;  // after odd and after even steps
    flow.compute_fields(moved.fields.emplace_back());
    BodyLoad& load = moved.loads.emplace_back();
    if (mover == Mover::walls) load = flow.body_load(0);
    if (mover == Mover::saturated) {
      const GrainLoads loads = flow.grains().mean_loads();
      std::copy(loads.force.begin(), loads.force.end(), load.force.begin());
    }
    if (mover == Mover::wet) load.force = {flow.wet_force().x, flow.wet_force().y, flow.wet_force().moment};
    moved.loads.push_back(flow.solid_nodes_load());
    for (int z = 0; z < grid.layers(); ++z) {
      for (int y = 0; y < grid.ny; ++y) {
        for (int x = 0; x < grid.nx; ++x) {
          const double at[] = {double(x), double(y), double(z)};
          double square = 0;
          for (std::size_t a = 0; a < axes; ++a) square += (at[a] - centre[a]) * (at[a] - centre[a]);
          if (square < radius * radius && !flow.populations().holds(flow.populations().node(x, y, z)))
            ++moved.over_dropped;
        }
      }
    }
  }
  moved.threads = flow.threads();
  return moved;
}

void expect_same(const Moved& one, const Moved& other, const std::string& which) {
  ASSERT_EQ(one.fields.size(), other.fields.size());
  EXPECT_EQ(one.covered, other.covered) << which;
  EXPECT_EQ(one.uncovered, other.uncovered) << which;
  for (std::size_t n = 0; n < one.fields.size(); ++n) {
    EXPECT_EQ(one.fields[n].velocity_x, other.fields[n].velocity_x) << which << ' ' << n;
    EXPECT_EQ(one.fields[n].velocity_y, other.fields[n].velocity_y) << which << ' ' << n;
    EXPECT_EQ(one.fields[n].velocity_z, other.fields[n].velocity_z) << which << ' ' << n;
    EXPECT_EQ(one.fields[n].excess, other.fields[n].excess) << which << ' ' << n;
  }
  for (std::size_t n = 0; n < one.loads.size(); ++n) {
    EXPECT_EQ(one.loads[n].force, other.loads[n].force) << which << ' ' << n;
    EXPECT_EQ(one.loads[n].torque, other.loads[n].torque) << which << ' ' << n;
  }
}

// What moves covers and leaves nodes of the pores, lies on grains without memory and drives the fluid between
// them: the same bits as with every node's memory.
TEST(Packing, ChangesNoBitOfWhatMovesAmongGrains) {
  const int threads_before = omp_get_max_threads();
  for (const bool space : {false, true}) {
    const Grid grid = space ? grid_of(31, 19, 17) : grid_of(71, 53);
    for (const bool all_periodic : {false, true}) {
      for (const Storage storage : {Storage::double_precision, Storage::single_precision}) {
        if (all_periodic && storage == Storage::single_precision) continue;
        const FlowSettings settings = settings_of(grid, all_periodic, storage);
        const Moved alone = move(settings, false, Mover::none, WallRule::linear);
        const auto expect = [&](Mover mover, WallRule rule) {
          const std::string which = variant_name(settings.step()) + (all_periodic ? " periodic, " : ", ") +
                                    std::to_string(int(mover)) + ' ' + std::to_string(int(rule));
          const Moved rows = move(settings, false, mover, rule);
          const Moved packed = move(settings, true, mover, rule);
          EXPECT_EQ(rows.over_dropped, 0U) << which;
          EXPECT_GT(packed.over_dropped, 0U) << which;
          if (mover != Mover::saturated) {
            EXPECT_GT(packed.covered, 10U) << which;
            EXPECT_GT(packed.uncovered, 10U) << which;
          }
          const std::size_t last = packed.loads.size() - 2;
          EXPECT_GT(std::abs(packed.loads[last].force[0]), 1e-5) << which;
          const auto& with = packed.fields.back().velocity_x;
          const auto& without = alone.fields.back().velocity_x;
          std::size_t moved = 0;
          for (std::size_t n = 0; n < with.size(); ++n) moved += std::abs(with[n] - without[n]) > 1e-3;
          EXPECT_GT(moved, 40U) << which;
          expect_same(packed, rows, which);
        };
        for (const WallRule rule : {WallRule::linear, WallRule::halfway, WallRule::quadratic,
                                    WallRule::central_linear, WallRule::yin_zhang, WallRule::one_point})
          expect(Mover::walls, rule);
        expect(Mover::saturated, WallRule::linear);
        if (!space) expect(Mover::wet, WallRule::linear);
      }
    }
  }
  const FlowSettings settings = settings_of(grid_of(311, 93), true, Storage::double_precision);
  const Moved packed = move(settings, true, Mover::walls, WallRule::quadratic, 3);
  EXPECT_EQ(packed.threads, 3);
  expect_same(packed, move(settings, false, Mover::walls, WallRule::quadratic), "3 threads");
  omp_set_num_threads(threads_before);
}

// Bodies need the memory of solid nodes beside the fluid.
TEST(Packing, RefusesOtherWallsWhenToldOfNone) {
  Flow flow(settings_of(grid_of(71, 53), true, Storage::double_precision));
  flow.set_solid_nodes(grains_of(flow.grid()));
  EXPECT_THROW(flow.place_bodies({2, {5, 5}, {0.3}, {0, 0}, {0}}, {WallRule::linear}, false),
               std::logic_error);
  EXPECT_THROW(flow.set_wet_surface(2, {0, 1, 1, 0}), std::logic_error);
}

// Where there is little to save nothing is moved.
TEST(Packing, LeavesOpenFlowsAlone) {
  FlowSettings settings = settings_of(grid_of(71, 53), true, Storage::double_precision);
  Flow flow(settings);
  std::vector<std::uint16_t> solid(settings.grid.size(), 0);
  for (int n = 0; n < 12; ++n)
    solid[settings.grid.index(5 * n % settings.grid.nx, 3 * n % settings.grid.ny)] = 1;
  flow.set_solid_nodes(solid);
  EXPECT_FALSE(flow.populations().packed());
}

}  // namespace
}  // namespace estuary::fluid
