#include "body_filling.hpp"

#include <cmath>
#include <stdexcept>

#include "body_conditions.hpp"
#include "shell.hpp"
#include "stress_points.hpp"

namespace estuary::solid {

ShellSection shell_section(const SolidScene& scene, const BodyScene& body) {
  const ShellScene& shell = *body.shell;
  return {.thickness = shell.thickness,
          .young_modulus = shell.modulus(body.material, scene.plane),
          .shear_modulus = 0.5 * body.material.young_modulus / (1 + body.material.poisson_ratio),
          .shear_correction = shell.shear_correction,
          .density = body.material.density,
          .plasticity = body.material.plasticity,
          .plane_factor = scene.plane == Plane::strain ? 2 / std::sqrt(3.0) : 1.0,
          .hinge = shell.hinge,
          .shear_weight = shell.shear_weight,
          .rupture = body.rupture,
          .viscosity = shell.viscosity};
}

namespace {

Body from_points(const BodyScene& scene, double spacing, double smoothing_ratio) {
  Body body;
  body.spacing = {spacing, spacing};
  body.smoothing_length = smoothing_ratio * spacing;
  for (std::size_t k = 0; k + 2 < scene.points.size(); k += 3) {
    body.position.insert(body.position.end(), {scene.points[k], scene.points[k + 1]});
    body.volume.push_back(scene.points[k + 2]);
    body.mass.push_back((scene.fluid ? scene.fluid->density : scene.material.density) * scene.points[k + 2]);
  }
  body.energy_volume = body.volume;
  body.fixed.assign(body.size(), 0);
  body.edge.assign(body.size(), 0);
  body.member.assign(body.size(), 0);
  return body;
}

Body rigid_contour(const SolidScene& scene, const BodyScene& described) {
  Body body = place_on_contours(described.outline(scene.spacing), scene.spacing);
  body.smoothing_length = scene.smoothing_ratio * scene.spacing;
  body.fixed.assign(body.size(), 7);
  const RigidScene& rigid = *described.rigid;
  const auto mass = rigid.mass_and_inertia(described, scene.spacing);
  body.rigid.push_back({.member = 0,
                        .first = 0,
                        .last = static_cast<std::uint32_t>(body.size()),
                        .centre = {mass[2], mass[3]},
                        .mass = mass[0],
                        .inertia = mass[1],
                        .spring = rigid.spring,
                        .damper = rigid.damper,
                        .rest = rigid.rest,
                        .held = rigid.held});
  return body;
}

Body single(const SolidScene& scene, const BodyScene& body) {
  if (body.rigid) {
    try {
      return rigid_contour(scene, body);
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument("body \"" + body.name + "\": " + error.what());
    }
  }
  const double density = body.fluid ? body.fluid->density : body.material.density;
  switch (body.shape) {
    case Shape::box:
      return fill(body.box, density, scene.smoothing_ratio,
                  scene.order == Order::quadratic && scene.placement == Placement::cell_centres);
    case Shape::points:
      return from_points(body, scene.spacing, scene.smoothing_ratio);
    case Shape::disc:
    case Shape::polygon:
    case Shape::polyline:
      break;
  }
  try {
    if (body.shell)
      return fill_row(body.loops.front(), body.shell->closed, scene.spacing, shell_section(scene, body));
    return fill_outline(
        body.outline(scene.spacing),
        {.spacing = scene.spacing, .density = density, .smoothing_ratio = scene.smoothing_ratio});
  } catch (const std::invalid_argument& error) {
    throw std::invalid_argument("body \"" + body.name + "\": " + error.what());
  }
}

}  // namespace

Body build_body(const SolidScene& scene) {
  // A fluid has no contour of its own once it moves.
  const auto filled = [&](const BodyScene& described) {
    Body body = single(scene, described);
    if (!described.fluid) return body;
    body.outlines.clear();
    body.outline_member.clear();
    return body;
  };
  Body body = filled(scene.bodies.front());
  if (scene.bodies.size() > 1) {
    // From here on one list of particles; sides, spacings and columns of the first box mean nothing for the
    // others.
    const double spacing = scene.spacing;
    body.box = {};
    body.columns = {};
    body.spacing = {spacing, spacing};
    body.smoothing_length = scene.smoothing_ratio * spacing;
    for (std::size_t k = 1; k < scene.bodies.size(); ++k) append(body, filled(scene.bodies[k]));
  }
  if (scene.stress_points > 0) {
    std::vector<const Box*> boxes;
    for (const BodyScene& described : scene.bodies)
      boxes.push_back(described.shape == Shape::box ? &described.box : nullptr);
    add_stress_points(body, boxes, scene.stress_points);
  }
  mark_held(scene, body);
  return body;
}

}  // namespace estuary::solid
