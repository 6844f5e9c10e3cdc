// Rupture in a scene: limits of a body's links, and what does not go with them.
#include "solid_scene.hpp"

namespace estuary::solid {

void read_rupture(SceneTable& table, BodyScene& body) {
  auto rupture = table.table_if("rupture");
  if (!rupture) return;
  body.rupture.stretch = rupture->number_or("stretch", 0, Range::not_negative());
  body.rupture.shear = rupture->number_or("shear", 0, Range::not_negative());
  body.rupture.plastic_strain = rupture->number_or("plastic_strain", 0, Range::not_negative());
  body.rupture.energy = rupture->number_or("energy", 0, Range::not_negative());
  if (!body.rupture.any())
    rupture->problem("", "give at least one of `stretch`, `shear`, `plastic_strain` and `energy` [J/m2]");
  const std::vector<double> points =
      rupture->has("crack") ? rupture->points("crack", 2) : std::vector<double>{};
  for (std::size_t k = 0; k + 3 < points.size(); k += 2)
    body.cracks.push_back({points[k], points[k + 1], points[k + 2], points[k + 3]});
  if (rupture->has("crack") && body.cracks.empty() && !points.empty())
    rupture->problem("crack", "needs at least two points");
  if (!body.cracks.empty() && body.shape == Shape::polyline)
    rupture->problem("crack", "is of solids: a line that no link crosses");
  if (body.rupture.plastic_strain > 0 && body.material.plasticity.yield.empty())
    rupture->problem("plastic_strain", "is of a body with a `yield_stress`");
  if (body.rupture.shear > 0 && body.shape != Shape::polyline)
    rupture->problem("shear", "is of shells, whose links have a transverse shear strain");
}

void check_rupture(SceneTable& solid, SolidScene& scene) {
  if (solid.has("isolated_particles") && !scene.breaks())
    solid.problem("isolated_particles", "is of bodies with `rupture`");
  constexpr std::array<std::string_view, 2> fates{"fly_on", "remove"};
  scene.remove_isolated = solid.choice("isolated_particles", fates) == "remove";
  if (!scene.breaks()) return;
  if (scene.mode == Mode::steady) solid.problem("rupture", "is of transient runs");
  if (scene.updated_lagrangian || scene.stress_points > 0 || scene.periodic ||
      scene.hourglass_viscosity > 0 || scene.conservative_smoothing > 0)
    solid.problem(
        "rupture",
        "does not go with updated_lagrangian, stress points, a periodic body, conservative smoothing "
        "or hourglass viscosity");
  if (!scene.shells() && (scene.wet_contour || !scene.wet.empty()))
    solid.problem("wet",
                  "does not go with `rupture`, but of shells: the contour of a solid would have to open");
}

}  // namespace estuary::solid
