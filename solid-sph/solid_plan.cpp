// What a person should know about a solid scene before running it.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

}  // namespace

Plan plan_of(const SolidScene& scene) {
  const Box& box = scene.box;
  const auto columns = count_columns(box);
  const double particles = static_cast<double>(columns[0]) * static_cast<double>(columns[1]);
  const std::array<double, 2> spacing = actual_spacing(box);
  const double support = 2 * scene.smoothing_ratio * std::sqrt(spacing[0] * spacing[1]);
  const double neighbours = interior_neighbours(spacing, support);
  const double dt = scene.courant_step(spacing);
  const auto across = std::min(columns[0], columns[1]);

  Plan plan;
  const auto add = [&](const char* name, std::string value) {
    plan.derived.emplace_back(name, std::move(value));
  };
  add("particles", fmt::format("{} ({} x {}, spacing {:.4g} x {:.4g} m)", particles, columns[0], columns[1],
                               spacing[0], spacing[1]));
  add("neighbours of an inner particle", fmt::format("{} within {:.4g} m", neighbours, support));
  add("wave speed", fmt::format("{:.4g} m/s", scene.wave_speed()));
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
  if (scene.poisson_ratio > 0.49)
    plan.warnings.push_back(
        fmt::format("poisson_ratio = {} is close to incompressible: pressures oscillate and bending locks",
                    scene.poisson_ratio));
  if (scene.order == Order::linear && box.placement == Placement::cell_centres && across < 20)
    plan.warnings.push_back(
        fmt::format("correction = \"linear\" with {} particles across makes bending too soft "
                    "(about 5 % at 10); \"quadratic\" does not",
                    across));
  if (scene.stabilisation == 0 && (scene.order == Order::quadratic || box.placement == Placement::on_contour))
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
  if (scene.stabilisation == 0) plan.left_out.emplace_back("stabilisation (coefficient 0)");
  if (scene.gravity[0] == 0 && scene.gravity[1] == 0) plan.left_out.emplace_back("gravity");
  if (scene.damping == 0 && scene.mode == Mode::transient) plan.left_out.emplace_back("mass damping");
  if (scene.wet.empty()) plan.left_out.emplace_back("wet surface (no wet side)");

  const double per_pair = 4 + 16 + 16 + 16 + (scene.stabilisation > 0 ? 8 : 0) + (viscous ? 8 : 0);
  plan.memory_bytes = particles * (220 + neighbours * per_pair);
  if (scene.mode == Mode::steady && scene.method == SteadyMethod::newton)
    plan.memory_bytes +=
        particles * (4 * (neighbours + 1) * (neighbours + 1) + 12 * 12 * (2.5 * neighbours + 5) + 2000);
  const char* law = scene.law == LawName::hooke_almansi ? "hooke-almansi"
                    : scene.law == LawName::neo_hooke   ? "neo-hooke"
                                                        : "svk";
  plan.variant = fmt::format("2d-{}-plane-{}-{}{}{}", law, scene.plane == Plane::strain ? "strain" : "stress",
                             scene.order == Order::linear ? "linear" : "quadratic",
                             scene.stabilisation > 0 ? "-stabilised" : "", viscous ? "-viscous" : "");
  return plan;
}

}  // namespace estuary::solid
