// The sample of a scene: groups of grains, their grading, deposit and cement.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scene_sections.hpp"

namespace estuary::grains {
namespace {

Grading read_grading(SceneTable& group) {
  Grading grading;
  if (group.has("radius")) {
    grading.minimum = grading.maximum = group.number("radius", Range::positive());
    return grading;
  }
  auto table = group.table_if("grading");
  if (!table) {
    group.problem("radius", "give `radius`, or a table `grading`");
    return grading;
  }
  constexpr std::array<std::string_view, 2> laws{"uniform", "beta"};
  grading.law = table->choice("law", laws) == "beta" ? Grading::Law::beta : Grading::Law::uniform;
  grading.minimum = table->number("minimum_radius", Range::positive());
  grading.maximum = table->number("maximum_radius", Range::positive());
  if (grading.maximum < grading.minimum) table->problem("maximum_radius", "is smaller than `minimum_radius`");
  if (grading.law == Grading::Law::beta) {
    grading.a = table->number_or("a", 2, {1e-3, 1e3});
    grading.b = table->number_or("b", 2, {1e-3, 1e3});
  }
  constexpr std::array<std::string_view, 2> measures{"number", "volume"};
  grading.by_volume = table->choice("by", measures) == "volume";
  return grading;
}

}  // namespace

void read_groups(SceneTable& grains, GrainsScene& result) {
  const std::size_t d = result.axes();
  for (SceneTable& table : grains.tables("group")) {
    GroupScene group;
    if (table.has("positions")) {
      group.kind = GroupScene::Kind::positions;
      group.positions = table.points("positions", d);
      if (table.has("radii")) {
        group.radii = table.numbers("radii", group.positions.size() / d);
        for (const double r : group.radii)
          if (!(r > 0)) {
            table.problem("radii", "radii must be positive");
            break;
          }
      } else {
        group.grading = read_grading(table);
      }
    } else if (table.has("lattice")) {
      group.kind = GroupScene::Kind::lattice;
      constexpr std::array<std::string_view, 2> kinds{"square", "triangular"};
      group.triangular = table.choice("lattice", kinds) == "triangular";
      group.from = table.numbers("from", d);
      group.pitch = table.number("pitch", Range::positive());
      group.stretch = vector_or(table, "stretch", d, 1);
      for (const double factor : group.stretch)
        if (!(factor > 0)) table.problem("stretch", "factors must be positive");
      for (const double n : table.numbers("counts", d)) {
        if (!(n >= 1) || n != std::floor(n) || n > 1e8)
          table.problem("counts", "are whole numbers from 1 on");
        group.counts.push_back(static_cast<std::int64_t>(std::clamp(n, 1.0, 1e8)));
      }
      group.grading = read_grading(table);
    } else if (table.has("count")) {
      group.kind = GroupScene::Kind::spread;
      group.count = table.integer("count", 1, 100'000'000);
      group.from = table.numbers("from", d);
      group.to = table.numbers("to", d);
      for (std::size_t c = 0; c < std::min(group.from.size(), group.to.size()); ++c)
        if (!(group.to[c] > group.from[c])) table.problem("to", "must lie beyond `from`");
      group.grading = read_grading(table);
    } else if (table.has("file")) {
      group.kind = GroupScene::Kind::file;
      group.file = table.file("file");
    } else {
      table.problem("", "a group needs `positions`, `lattice`, `count` (spread over a box) or `file`");
    }
    group.density = table.number_or("density", result.density, Range::positive());
    group.velocity = vector_or(table, "velocity", d, 0);
    group.spin = vector_or(table, "spin", d == 2 ? 1 : 3, 0);
    group.random_velocity = table.number_or("random_velocity", 0, Range::not_negative());
    group.seed = table.integer_or("seed", 1, 0, 1'000'000'000);
    group.held = table.boolean_or("held", false);
    result.groups.push_back(std::move(group));
  }
  if (result.groups.empty()) grains.problem("", "there are no grains: add at least one [[grains.group]]");
}

void read_deposit(SceneTable& grains, GrainsScene& result) {
  auto table = grains.table_if("deposit");
  if (!table) return;
  DepositScene& deposit = result.deposit;
  deposit.active = true;
  if (table->has("friction")) deposit.friction = table->number("friction", Range::not_negative());
  if (table->has("restitution")) deposit.restitution = table->number("restitution", {1e-6, 1});
  deposit.gravity = table->numbers("gravity", result.axes());
  deposit.end_time = table->number("end_time", Range::positive());
  deposit.hold = table->boolean_or("hold", false);
  deposit.tolerance = table->number_or("tolerance", 1e-3, {1e-9, 1});
  if (table->has("target_porosity")) {
    deposit.target_porosity = table->number("target_porosity", {0.05, 0.95});
    deposit.porosity_tolerance = table->number_or("porosity_tolerance", 0.005, {1e-5, 0.2});
    if (deposit.friction)
      table->problem("friction", "is what is sought for `target_porosity`; give one of the two");
  }
}

void read_cement(SceneTable& grains, bool all_held, GrainsScene& result) {
  auto table = grains.table_if("cement");
  if (!table) return;
  CementScene& cement = result.cement;
  constexpr std::array<std::string_view, 3> models{"bridges", "coating", "random"};
  const std::string model = table->choice("model", models);
  if (model == "bridges") {
    cement.model = CementScene::Model::bridges;
    cement.diameter_ratio = table->number("diameter_ratio", {1e-3, 0.999});
    cement.distance_ratio = table->number_or("distance_ratio", 0.05, {0, 1});
  } else if (model == "coating") {
    cement.model = CementScene::Model::coating;
    cement.thickness_ratio = table->number("thickness_ratio", {0, 1});
  } else {
    cement.model = CementScene::Model::random;
    cement.saturation = table->number("saturation", {0, 0.99});
    cement.seed = table->integer_or("seed", 1, 0, 1'000'000'000);
  }
  // Those of the models not chosen may stay, so that --set changes the model alone.
  table->leave_to_others({"diameter_ratio", "distance_ratio", "thickness_ratio", "saturation", "seed"});
  cement.voxel = table->number("voxel", Range::positive());
  cement.from = table->has("from") ? table->numbers("from", result.axes()) : result.from;
  cement.to = table->has("to") ? table->numbers("to", result.axes()) : result.to;
  if (cement.from.size() != result.axes() || cement.to.size() != result.axes()) {
    table->problem("", "give the box that is cemented: `from` and `to`, or [grains.box]");
    return;
  }
  double voxels = 1;
  for (std::size_t c = 0; c < result.axes(); ++c) {
    if (!(cement.to[c] > cement.from[c])) table->problem("to", "must lie beyond `from`");
    voxels *= std::max(1.0, (cement.to[c] - cement.from[c]) / cement.voxel);
  }
  if (voxels > 1e7) table->problem("voxel", fmt::format("makes {:.2g} voxels: at most 1e7", voxels));
  if (!all_held && cement.model != CementScene::Model::coating)
    table->problem("model",
                   "bridges and random cement stay where they are: hold every group (`held`), or "
                   "[grains.deposit] with `hold`; moving grains can be coated and bonded");
}

}  // namespace estuary::grains
