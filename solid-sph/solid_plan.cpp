// What a person should know about a solid scene before running it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "solid_scene.hpp"

namespace estuary::solid {
namespace {

// Neighbours of a particle away from edges.
double interior_neighbours(const std::array<double, 2>& spacing, double support) {
  double count = -1;
  const int reach = static_cast<int>(support / std::min(spacing[0], spacing[1])) + 1;
  for (int i = -reach; i <= reach; ++i)
    for (int j = -reach; j <= reach; ++j)
      if (std::hypot(i * spacing[0], j * spacing[1]) < support) ++count;
  return count;
}

// Of the rectangle round the outline [m].
double thinner_side(const BodyScene& body) {
  std::array<double, 2> low{1e300, 1e300}, high{-1e300, -1e300};
  for (const auto& point : body.loops.front())
    for (std::size_t c = 0; c < 2; ++c) {
      low[c] = std::min(low[c], point[c]);
      high[c] = std::max(high[c], point[c]);
    }
  return std::min(high[0] - low[0], high[1] - low[1]);
}

void plan_rigid(const SolidScene& scene, const BodyScene& body, Plan& plan) {
  const auto mass = body.rigid->mass_and_inertia(body, scene.spacing);
  plan.derived.emplace_back("rigid \"" + body.name + "\"",
                            fmt::format("mass {:.6g} kg/m, inertia {:.6g} kg m2/m, centre ({:.6g}, {:.6g}) m",
                                        mass[0], mass[1], mass[2], mass[3]));
  constexpr std::array<const char*, 3> names{"x", "y", "rotation"};
  std::string periods;
  for (std::size_t c = 0; c < 3; ++c) {
    const double spring = body.rigid->spring[c], inertia = c == 2 ? mass[1] : mass[0];
    if (body.rigid->held[c] || !(spring > 0)) continue;
    const double rate = std::sqrt(spring / inertia);
    periods += fmt::format("{}{} {:.5g} Hz, damping ratio {:.4g}", periods.empty() ? "" : "; ", names[c],
                           rate / (2 * std::numbers::pi), 0.5 * body.rigid->damper[c] / (inertia * rate));
  }
  if (!periods.empty()) plan.derived.emplace_back("its oscillations in vacuum", periods);
}

}  // namespace

Plan plan_of(const SolidScene& scene) {
  const Box& box = scene.bodies.front().box;
  Plan plan;
  plan_shear_rupture(scene, plan);
  if (scene.impact()) {
    plan_impact(scene, plan);
    return plan;
  }
  if (scene.shells()) {
    plan_shells(scene, plan);
    return plan;
  }
  double particles = 0;
  double across = 1e300;
  for (const BodyScene& body : scene.bodies) {
    if (body.rigid) {
      double contour = 0;
      for (const Polygon& loop : body.outline(scene.spacing))
        for (std::size_t k = 0; k < loop.size(); ++k) {
          const auto &a = loop[k], &b = loop[(k + 1) % loop.size()];
          contour += std::hypot(b[0] - a[0], b[1] - a[1]);
        }
      particles += std::round(contour / scene.spacing);
      plan_rigid(scene, body, plan);
    } else if (body.shape == Shape::box) {
      const auto columns = count_columns(body.box);
      particles += static_cast<double>(columns[0]) * static_cast<double>(columns[1]);
      across = std::min(across, static_cast<double>(std::min(columns[0], columns[1])));
    } else if (body.shape == Shape::points) {
      particles += static_cast<double>(body.points.size()) / 3;
    } else {
      double area = 0;
      const auto loops = body.outline(scene.spacing);
      for (std::size_t l = 0; l < loops.size(); ++l)
        area += (l == 0 ? 1 : -1) * std::abs(signed_area(loops[l])) / (scene.spacing * scene.spacing);
      particles += std::round(area);
    }
  }
  const std::array<double, 2> spacing =
      scene.single_box() ? actual_spacing(box) : std::array<double, 2>{scene.spacing, scene.spacing};
  const double support =
      support_ratio(scene.kernel) * scene.smoothing_ratio * std::sqrt(spacing[0] * spacing[1]);
  const double neighbours = interior_neighbours(spacing, support);
  const double dt = scene.courant_step(spacing);

  const auto add = [&](const char* name, std::string value) {
    plan.derived.emplace_back(name, std::move(value));
  };
  if (scene.single_box()) {
    const auto columns = count_columns(box);
    add("particles", fmt::format("{} ({} x {}, spacing {:.4g} x {:.4g} m)", particles, columns[0], columns[1],
                                 spacing[0], spacing[1]));
  } else {
    add("particles", fmt::format("about {} in {} bodies, spacing {:.4g} m", particles, scene.bodies.size(),
                                 scene.spacing));
  }
  if (scene.all_rigid()) {
    if (scene.mode == Mode::transient) {
      add("steps per window", "at least 16");
      plan.expected_updates = particles * 16 * std::round(scene.end_time / scene.window);
    }
    plan.left_out.emplace_back("stresses (every body is rigid)");
    plan.memory_bytes = particles * 400;
    plan.variant = "2d-rigid";
    return plan;
  }
  add("neighbours of an inner particle", fmt::format("{} within {:.4g} m", neighbours, support));
  add("wave speed", fmt::format("{:.4g} m/s", scene.fastest_wave()));
  if (scene.mode == Mode::transient) {
    const double steps = std::ceil(scene.window / dt);
    add("time step", fmt::format("at most {:.3g} s", dt));
    add("steps per window", fmt::format("at least {}", steps));
    plan.expected_updates = particles * steps * std::round(scene.end_time / scene.window);
  } else {
    add("equilibrium",
        fmt::format("{} to a relative tolerance of {:g}",
                    scene.method == SteadyMethod::newton ? "Newton's method" : "dynamic relaxation",
                    scene.steady.tolerance));
  }

  if (across < 4)
    plan.warnings.push_back(
        fmt::format("only {} particles across the thinner side: expect bending errors above 1 %; "
                    "use particles_across = 5 or more",
                    across));
  for (const BodyScene& body : scene.bodies)
    if (body.material.poisson_ratio > 0.49 && scene.law != LawName::neo_hooke_isochoric)
      plan.warnings.push_back(fmt::format(
          "poisson_ratio = {} is close to incompressible: law = \"neo_hooke_isochoric\" is made for it",
          body.material.poisson_ratio));
  if (scene.raised > 0)
    add("particles_across",
        fmt::format("raised to {}: an odd number locks nearly incompressible bodies in bending",
                    scene.raised));
  if (const BodyScene& first = scene.bodies.front();
      scene.raised == 0 && first.shape == Shape::polygon && scene.nearly_incompressible(first)) {
    const double number = thinner_side(first) / scene.spacing;
    if (std::abs(number - std::round(number)) < 1e-6 && std::fmod(std::round(number), 2.0) == 1)
      plan.warnings.push_back(fmt::format(
          "{:.0f} spacings across: a straight strip with an odd number locks in bending when nearly "
          "incompressible; use an even one",
          number));
  }
  if (scene.order == Order::linear && scene.placement == Placement::cell_centres && across < 20)
    plan.warnings.push_back(
        fmt::format("correction = \"linear\" with {} particles across makes bending too soft "
                    "(about 5 % at 10); \"quadratic\" does not",
                    across));
  if (scene.stress_points == 1 && scene.stabilisation == 0)
    plan.warnings.emplace_back(
        "one stress point per cell of a box leaves an alternating mode without stiffness; two see it");
  if (scene.stress_points == 0 && scene.stabilisation == 0 &&
      (scene.order == Order::quadratic || scene.placement == Placement::on_contour))
    plan.warnings.emplace_back("stabilisation = 0: sawtooth modes have no stiffness");
  if (scene.mode == Mode::transient && scene.law != LawName::neo_hooke && scene.viscosity_linear == 0 &&
      scene.stabilisation == 0)
    plan.warnings.push_back(
        "neither artificial viscosity nor stabilisation: large compressions may grow unstable");
  if (scene.courant > 0.9) plan.warnings.push_back("courant above 0.9 may be unstable in large deformation");

  const bool viscous =
      scene.mode == Mode::transient && (scene.viscosity_linear > 0 || scene.viscosity_quadratic > 0);
  if (!viscous)
    plan.left_out.push_back(scene.mode == Mode::steady
                                ? "artificial viscosity (an equilibrium has no velocity)"
                                : "artificial viscosity (both coefficients are 0)");
  if (scene.stress_points > 0)
    add("stress points", scene.stress_points == 2
                             ? "two in every cell of a box, one in every triangle of other outlines"
                             : "one in every cell of a box and every triangle of other outlines");
  if (scene.stabilisation == 0) plan.left_out.emplace_back("stabilisation (coefficient 0)");
  if (scene.gravity[0] == 0 && scene.gravity[1] == 0) plan.left_out.emplace_back("gravity");
  if (scene.bodies.size() > 1 && !scene.contact)
    plan.left_out.emplace_back("contact between bodies (no [solid.contact])");
  if (scene.damping == 0 && scene.mode == Mode::transient) plan.left_out.emplace_back("mass damping");
  if (scene.wet.empty() && !scene.wet_contour) plan.left_out.emplace_back("wet surface (no wet side)");

  const double per_pair = 4 + 16 + 16 + 16 + (scene.stabilisation > 0 ? 8 : 0) + (viscous ? 8 : 0);
  plan.memory_bytes = particles * (1 + scene.stress_points) * (220 + neighbours * per_pair);
  if (scene.mode == Mode::steady && scene.method == SteadyMethod::newton)
    plan.memory_bytes +=
        particles * (4 * (neighbours + 1) * (neighbours + 1) + 12 * 12 * (2.5 * neighbours + 5) + 2000);
  constexpr std::array<const char*, 5> kLaws{SaintVenantKirchhoff::name, HookeAlmansi::name, NeoHooke::name,
                                             NeoHookeIsochoric::name, J2Plasticity::name};
  const char* law = kLaws[static_cast<std::size_t>(scene.law)];
  if (scene.updated_lagrangian) {
    plan.variant = "2d-updated-lagrangian-hypoelastic";
    plan.warnings.emplace_back(
        "formulation = \"updated_lagrangian\" is there for comparison: in tension its particles clump and "
        "fracture "
        "numerically; its law is hypoelastic (Jaumann)");
    return plan;
  }
  std::string order(scene.order == Order::none ? "uncorrected"
                                               : kOrderNames[static_cast<std::size_t>(scene.order)]);
  std::replace(order.begin(), order.end(), '_', '-');
  plan.variant =
      fmt::format("2d-{}-plane-{}-{}{}{}{}", law, scene.plane == Plane::strain ? "strain" : "stress", order,
                  scene.stress_points > 0 ? "-stress-points" : "",
                  scene.stabilisation > 0 ? "-stabilised" : "", viscous ? "-viscous" : "");
  return plan;
}

}  // namespace estuary::solid
