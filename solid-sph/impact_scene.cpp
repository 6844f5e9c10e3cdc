// Scenes whose bodies meet by impulses: fluids, contact, and what goes with them.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>

#include "body_filling.hpp"
#include "expression.hpp"
#include "impact.hpp"
#include "outline_filling.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {
namespace {

// Of two bodies that meet, the one that comes first here gives way: fluids, then shells and solids by their
// modulus, of equal ones the shell, then rigid bodies; of still equal ones the later one.
std::vector<double> hardness_of(const SolidScene& scene) {
  const std::size_t n = scene.bodies.size();
  const auto rank = [&](std::size_t k) {
    const BodyScene& body = scene.bodies[k];
    const bool elastic = !body.fluid && !body.rigid;
    return std::tuple(body.fluid ? 0
                      : elastic  ? 1
                                 : 2,
                      elastic ? body.material.young_modulus : 0.0, body.shell ? 0 : 1);
  };
  std::vector<std::size_t> order(n);
  for (std::size_t k = 0; k < n; ++k) order[k] = n - 1 - k;
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return rank(a) < rank(b); });
  std::vector<double> hardness(n);
  for (std::size_t place = 0; place < n; ++place) hardness[order[place]] = static_cast<double>(place);
  return hardness;
}

}  // namespace

void read_fluid(SceneTable& table, double shared_density, BodyScene& body) {
  FluidMaterial& fluid = body.fluid.emplace();
  fluid.density = shared_density > 0 ? table.number_or("density", shared_density, Range::positive())
                                     : table.number("density", Range::positive());
  body.material.density = fluid.density;
  fluid.sound_speed = table.number("sound_speed", Range::positive());
  constexpr std::array<std::string_view, 3> equations{"acoustic", "linear_density", "tait"};
  const std::string equation = table.choice("equation_of_state", equations);
  fluid.equation_of_state = equation == "tait"             ? EquationOfState::tait
                            : equation == "linear_density" ? EquationOfState::linear_density
                                                           : EquationOfState::acoustic;
  if (table.has("tension_limit")) fluid.tension_limit = table.number("tension_limit", Range::not_negative());
  fluid.viscosity = table.number_or("viscosity", 0, Range::not_negative());
  constexpr std::array<std::string_view, 2> dissipations{"viscosity", "riemann"};
  fluid.riemann = table.choice("dissipation", dissipations) == "riemann";
  if (fluid.riemann)
    fluid.limiter = table.number_or("riemann_limiter", 3.0, {.minimum = 0.0, .maximum = 1e6});
  for (const char* key : {"viscosity_linear", "viscosity_quadratic", "density_diffusion"})
    if (fluid.riemann && table.has(key)) table.problem(key, "is of dissipation = \"viscosity\"");
  fluid.linear = table.number_or("viscosity_linear", 1.0, {.minimum = 0.0, .maximum = 10.0});
  fluid.quadratic = table.number_or("viscosity_quadratic", 2.0, {.minimum = 0.0, .maximum = 10.0});
  fluid.diffusion = table.number_or("density_diffusion", 0.1, {.minimum = 0.0, .maximum = 1.0});
  for (const char* key : {"young_modulus", "poisson_ratio", "yield_stress", "hardening_modulus"})
    if (table.has(key) && body.shape != Shape::polyline && shared_density > 0) {
      table.leave_to_others({key});
      table.problem(key, "means nothing for a fluid");
    }
  if (body.shape == Shape::polyline)
    table.problem("kind", "a fluid needs an area: `box`, `disc`, `polygon`, `image` or `points`");
  if (table.has("clamped")) table.problem("clamped", "is of solids; a fluid meets rigid bodies");
}

void read_contact(SceneTable& solid, SolidScene& scene) {
  const auto rigid = std::count_if(scene.bodies.begin(), scene.bodies.end(),
                                   [](const BodyScene& body) { return body.rigid.has_value(); });
  scene.pinball = scene.fluids() || scene.meets_surface;
  auto contact = solid.table_if("contact");
  if (!contact) return;
  scene.contact = true;
  constexpr std::array<std::string_view, 2> methods{"penalty", "pinball"};
  if (contact->has("method") || !scene.pinball)
    scene.pinball = contact->choice("method", methods) == "pinball";
  if ((scene.fluids() || scene.meets_surface) && !scene.pinball)
    contact->problem("method", "a fluid, and what meets a wet surface, do so by method = \"pinball\"");
  if (scene.bodies.size() < 2 && !scene.meets_surface) contact->problem("", "needs several [[solid.body]]");
  if (scene.mode == Mode::steady || scene.updated_lagrangian)
    contact->problem("", "is of transient runs in the total Lagrangian form");
  if (scene.pinball) {
    constexpr std::array<std::string_view, 2> normals{"contour", "centre_line"};
    scene.normals = contact->choice("normals", normals) == "centre_line" ? ContactNormals::centre_line
                                                                         : ContactNormals::contour;
    scene.friction = contact->number_or("friction", 0, {.minimum = 0.0, .maximum = 10.0});
    scene.penetration_correction =
        contact->number_or("penetration_correction", 0, {.minimum = 0.0, .maximum = 1.0});
    for (const char* key : {"stiffness", "rigid_modulus"})
      if (contact->has(key)) {
        contact->leave_to_others({key});
        contact->problem(key, "is of method = \"penalty\"");
      }
  } else {
    scene.contact_stiffness = contact->number_or("stiffness", 1.0, {.minimum = 1e-3, .maximum = 1e3});
    scene.contact_modulus = contact->number_or("rigid_modulus", 0.0, Range::positive());
    if (rigid > 1 && !(scene.contact_modulus > 0))
      contact->problem(
          "", "rigid bodies meet each other with `rigid_modulus` [Pa]: pressure per depth in spacings");
  }
  for (const BodyScene& body : scene.bodies)
    if (body.shape == Shape::points && !body.fluid)
      contact->problem("", "\"" + body.name + "\" has no contour to touch");
}

void check_impact(SceneTable& solid, const SolidScene& scene) {
  if (!scene.impact()) return;
  if (scene.mode == Mode::steady)
    solid.problem("kind", "fluids, and bodies that meet by impulses, move: use a transient scene");
  if (scene.fluids() && scene.kernel != Kernel::cubic_spline)
    solid.problem("kernel", "of a fluid is the cubic spline");
  for (const char* key : {"stress_points", "formulation", "periodic", "conservative_smoothing"})
    if (solid.has(key)) solid.problem(key, "does not go with bodies that meet by impulses");
  if (scene.meets_surface && solid.has("wet"))
    solid.problem("wet", "is of the scene's solid; what meets its surface brings none");
  for (const HoldScene& hold : scene.holds) {
    if (hold.place.every_body ? scene.fluids() : scene.bodies[hold.place.body].fluid.has_value())
      solid.problem("hold", "is of solids, not of a fluid; name the `body` it holds");
    if (!hold.displacement[0].empty() || !hold.displacement[1].empty())
      solid.problem("hold",
                    "with a `displacement` does not go with bodies that meet by impulses; use a rigid body");
  }
  for (const LoadScene& load : scene.loads)
    if (scene.bodies[load.place.body].fluid)
      solid.problem("load", "is of solids and rigid bodies; push a fluid with one of those");
}

std::unique_ptr<Solver> make_impact_solver(const SolidScene& scene, const Body& body,
                                           const SolverOptions& options) {
  ImpactOptions impact;
  impact.fluid.spacing = scene.spacing;
  impact.fluid.smoothing_ratio = scene.smoothing_ratio;
  impact.fluid.variable_smoothing = scene.variable_smoothing;
  if (is_moving_least_squares(scene.order)) impact.fluid.gradients = scene.order;
  impact.friction = scene.friction;
  impact.contact.friction = scene.friction > 0;
  impact.held = scene.held;
  impact.contact.normals = scene.normals;
  impact.contact.penetration_correction = scene.penetration_correction;
  const std::vector<double> hardness = hardness_of(scene);
  for (std::size_t k = 0; k < scene.bodies.size(); ++k) {
    const BodyScene& described = scene.bodies[k];
    impact.is_fluid.push_back(described.fluid ? 1 : 0);
    if (scene.shells())
      impact.sections.push_back(described.shell ? shell_section(scene, described) : ShellSection{});
    impact.fluid.materials.push_back(described.fluid.value_or(FluidMaterial{}));
    impact.contact.members.push_back(
        {.hardness = hardness[k],
         .half_thickness = described.shell ? 0.5 * described.shell->thickness : 0.0,
         .two_sided = described.shell.has_value(),
         .fluid = described.fluid.has_value(),
         .radius = described.shell ? 0.5 * described.shell->thickness : 0.0});
  }
  if (scene.meets_surface && !body.member.empty() && body.member.back() == scene.bodies.size()) {
    // The last member, and the hardest: it yields to nothing.
    impact.surface_first = static_cast<std::uint32_t>(
        std::lower_bound(body.member.begin(), body.member.end(), body.member.back()) - body.member.begin());
    impact.is_fluid.push_back(0);
    if (scene.shells()) impact.sections.emplace_back();
    impact.fluid.materials.emplace_back();
    impact.contact.members.push_back({.hardness = static_cast<double>(scene.bodies.size())});
  }
  impact.make_solid = [&](const Body& part) { return make_solver(scene.law, part, options); };
  return std::make_unique<ImpactSolver>(body, std::move(impact));
}

void plan_impact(const SolidScene& scene, Plan& plan) {
  double particles = 0, step = 1e300;
  for (const BodyScene& body : scene.bodies) {
    const auto loops = body.outline(scene.spacing);
    double area = 0, contour = 0;
    for (std::size_t l = 0; l < loops.size(); ++l) {
      area += (l == 0 ? 1 : -1) * std::abs(signed_area(loops[l]));
      for (std::size_t k = 0; k < loops[l].size(); ++k) {
        const auto &a = loops[l][k], &b = loops[l][(k + 1) % loops[l].size()];
        contour += std::hypot(b[0] - a[0], b[1] - a[1]);
      }
    }
    if (body.rigid || body.shell) {
      if (body.shell)
        for (std::size_t k = 0; k + 1 < body.loops.front().size(); ++k)
          contour += std::hypot(body.loops.front()[k + 1][0] - body.loops.front()[k][0],
                                body.loops.front()[k + 1][1] - body.loops.front()[k][1]);
      particles += std::round(contour / scene.spacing);
      continue;
    }
    const double own =
        body.shape == Shape::points
            ? static_cast<double>(body.points.size()) / 3
            : std::round(area / (scene.spacing * scene.spacing) + 0.5 * contour / scene.spacing);
    particles += own;
    const auto k = static_cast<std::size_t>(&body - scene.bodies.data());
    step = std::min(step, 0.5 * scene.courant * scene.spacing / scene.wave_speed(k));
    if (!body.fluid) continue;
    double speed = 0;
    try {
      std::array<double, 2> v{};
      for (std::size_t c = 0; c < 2; ++c)
        if (!body.velocity[c].empty())
          v[c] = Expression(body.velocity[c])(body.box.from[0], body.box.from[1], 0, 0);
      speed = std::hypot(v[0], v[1]);
    } catch (const std::invalid_argument&) {  // noted elsewhere
    }
    plan.derived.emplace_back(
        "fluid \"" + body.name + "\"",
        fmt::format("about {} particles, {:.4g} kg/m, bulk modulus {:.4g} Pa{}", own,
                    area * body.fluid->density, body.fluid->density * std::pow(body.fluid->sound_speed, 2),
                    speed > 0
                        ? fmt::format(", Mach number at the start {:.3g}", speed / body.fluid->sound_speed)
                        : ""));
    if (speed > body.fluid->sound_speed)
      plan.warnings.push_back("\"" + body.name +
                              "\" is faster than its sound: its shocks are beyond the range tested");
    if (body.fluid->linear == 0 && body.fluid->quadratic == 0 && !body.fluid->riemann)
      plan.warnings.push_back("\"" + body.name + "\" has no artificial viscosity: shocks ring");
    if (body.fluid->diffusion == 0 && !body.fluid->riemann)
      plan.left_out.push_back("density diffusion of \"" + body.name + "\"");
    if (body.fluid->viscosity == 0) plan.left_out.push_back("viscosity of \"" + body.name + "\"");
  }
  plan.derived.emplace_back("particles", fmt::format("about {}", particles));
  plan.derived.emplace_back("time step", fmt::format("about {:.3g} s", step));
  plan.expected_updates =
      particles * std::ceil(scene.window / step) * std::round(scene.end_time / scene.window);
  if (!scene.contact) plan.left_out.emplace_back("contact between bodies (no [solid.contact])");
  if (scene.friction == 0) plan.left_out.emplace_back("friction");
  if (scene.penetration_correction == 0) plan.left_out.emplace_back("correction of penetrations");
  plan.memory_bytes = particles * 1200;
  const bool fitted = scene.fluids() && is_moving_least_squares(scene.order);
  plan.variant =
      fmt::format("2d-impact{}{}{}", scene.fluids() ? "-fluid" : "",
                  scene.variable_smoothing ? "-variable-smoothing" : "",
                  fitted ? "-" + std::string(kOrderNames[static_cast<std::size_t>(scene.order)]) : "");
}

}  // namespace estuary::solid
