// Shells of a solid scene: their section, what goes with them and what does not.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "solid_scene.hpp"

namespace estuary::solid {

void read_shell(SceneTable& table, BodyScene& body) {
  ShellScene& shell = body.shell.emplace();
  shell.thickness = table.number("thickness", Range::positive());
  shell.closed = table.boolean_or("closed", false);
  shell.shear_correction = table.number_or("shear_correction", 5.0 / 6.0, {.minimum = 0.1, .maximum = 1.0});
  constexpr std::array<std::string_view, 3> hinges{"growing", "section", "skin"};
  const std::string hinge = table.choice("hinge", hinges);
  shell.hinge = hinge == "section" ? Hinge::section : hinge == "skin" ? Hinge::skin : Hinge::growing;
  shell.shear_weight = table.number_or("shear_weight", 1.0, {.minimum = 0.0, .maximum = 1.0});
  for (const char* key : {"hinge", "shear_weight"})
    if (table.has(key) && body.material.plasticity.yield.empty())
      table.problem(key, "is of a shell with a `yield_stress`");
  if (auto viscosity = table.table_if("viscosity")) {
    const Range range{.minimum = 0.0, .maximum = 10.0};
    shell.viscosity.linear = viscosity->number_or("linear", 0, range);
    shell.viscosity.quadratic = viscosity->number_or("quadratic", 0, range);
    shell.viscosity.shear = viscosity->number_or("shear", 0, range);
    shell.viscosity.bending = viscosity->number_or("bending", 0, range);
    shell.viscosity.normal_filter =
        viscosity->number_or("normal_filter", 0, {.minimum = 0.0, .maximum = 0.5});
    if (viscosity->keys().empty())
      viscosity->problem(
          "", "give at least one of `linear`, `quadratic`, `shear`, `bending` and `normal_filter`");
  }
  const Plasticity& plasticity = body.material.plasticity;
  if (plasticity.reference_rate > 0 || plasticity.damage_limit > 0)
    table.problem(plasticity.damage_limit > 0 ? "damage" : "reference_rate", "has no meaning for shells");
  if (body.shape != Shape::polyline) table.problem("kind", "a shell is a `polyline` with a `thickness`");
  if (shell.closed && body.shape == Shape::polyline && body.loops.front().size() < 3)
    table.problem("closed", "a closed shell needs at least three points");
}

void check_shells(SceneTable& solid, const SolidScene& scene) {
  if (scene.mode == Mode::steady &&
      std::any_of(scene.bodies.begin(), scene.bodies.end(), [](const BodyScene& body) {
        return body.shell && (body.shell->viscosity.any() || body.shell->viscosity.normal_filter > 0);
      }))
    solid.problem("viscosity", "is of transient runs");
  if (!scene.shells()) return;
  if (scene.wet_contour && std::any_of(scene.bodies.begin(), scene.bodies.end(),
                                       [](const BodyScene& body) { return !body.shell; }))
    solid.problem("wet", "is of shells alone or of no shell: leave the other bodies to another process");
  if (scene.impact()) {  // other bodies are there, and their keys
    if (solid.has("particles_across"))
      solid.problem("particles_across", "a shell is one row of particles; give `spacing`");
    return;
  }
  if (std::any_of(scene.bodies.begin(), scene.bodies.end(),
                  [](const BodyScene& body) { return !body.shell; }))
    solid.problem(
        "kind", "shells go into one scene with other bodies only with [solid.contact] method = \"pinball\"");
  if (solid.has("particles_across"))
    solid.problem("particles_across", "a shell is one row of particles; give `spacing`");
  for (const char* key : {"placement", "clamp", "periodic", "correction", "kernel", "smoothing_ratio",
                          "stabilisation", "stress_points", "formulation", "viscosity_linear",
                          "viscosity_quadratic", "conservative_smoothing", "hourglass_viscosity", "contact"})
    if (solid.has(key)) solid.problem(key, "has no meaning for shells");
  if (scene.mode == Mode::steady && scene.method != SteadyMethod::relaxation)
    solid.problem("steady", "a shell's equilibrium is found by method = \"relaxation\"");
  if (solid.has("law") && !scene.plastic())
    solid.problem("law", "a shell is elastic, or law = \"j2_plasticity\" with a `yield_stress`");
}

double ShellScene::modulus(const MaterialScene& material, Plane plane) const {
  return plane == Plane::strain
             ? material.young_modulus / (1 - material.poisson_ratio * material.poisson_ratio)
             : material.young_modulus;
}

void plan_shear_rupture(const SolidScene& scene, Plan& plan) {
  for (const BodyScene& body : scene.bodies) {
    const double limit = body.rupture.shear;
    if (!body.shell || !(limit > 0)) continue;
    const double shear_modulus = 0.5 * body.material.young_modulus / (1 + body.material.poisson_ratio),
                 stiffness = body.shell->shear_correction * shear_modulus * body.shell->thickness;
    std::string text = fmt::format("{:.4g} N/m, k G h times the shear strain {:g}", stiffness * limit, limit);
    const std::vector<double>& yield = body.material.plasticity.yield;
    if (!yield.empty() && body.shell->shear_weight > 0) {
      const double bears = yield.front() * body.shell->thickness / std::sqrt(3 * body.shell->shear_weight);
      text = stiffness * limit < bears
                 ? text + fmt::format(", {:.3g} of what the section bears", stiffness * limit / bears)
                 : fmt::format("{:.4g} N/m, at which the section flows from a shear strain of {:.3g} to {:g}",
                               bears, bears / stiffness, limit);
    }
    plan.derived.emplace_back("\"" + body.name + "\" breaks under a shear force of", text);
  }
}

void plan_shells(const SolidScene& scene, Plan& plan) {
  double particles = 0;
  for (const BodyScene& body : scene.bodies) {
    const Polygon& line = body.loops.front();
    double length = 0;
    double links = 0;
    for (std::size_t k = 0; k + (body.shell->closed ? 0 : 1) < line.size(); ++k) {
      const auto &a = line[k], &b = line[(k + 1) % line.size()];
      const double piece = std::hypot(b[0] - a[0], b[1] - a[1]);
      length += piece;
      links += std::max(1.0, std::round(piece / scene.spacing));
    }
    particles += links + (body.shell->closed ? 0 : 1);
    const double h = body.shell->thickness;
    plan.derived.emplace_back(
        "shell \"" + body.name + "\"",
        fmt::format("length {:.4g} m, {:.4g} thicknesses, {} links, bending stiffness {:.4g} N m", length,
                    length / h, links, body.shell->modulus(body.material, scene.plane) * h * h * h / 12));
    if (scene.mode == Mode::transient && h < 0.5 * scene.spacing)
      plan.warnings.push_back(fmt::format(
          "the shell is thinner than its spacing: the turning of its fibres asks for steps {:.0f} times "
          "shorter than its waves",
          std::sqrt(1 + 3 * std::pow(scene.spacing / h, 2))));
  }
  plan.derived.emplace_back("particles", fmt::format("{}", particles));
  if (scene.mode == Mode::transient)
    plan.expected_updates = particles *
                            std::ceil(scene.window / scene.courant_step({scene.spacing, scene.spacing})) *
                            std::round(scene.end_time / scene.window);
  plan.left_out.emplace_back("two-dimensional stresses (every body is a shell)");
  plan.memory_bytes = particles * 500;
  plan.variant = scene.plane == Plane::strain ? "2d-shell-plane-strain" : "2d-shell-plane-stress";
}

}  // namespace estuary::solid
