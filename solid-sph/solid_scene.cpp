#include "solid_scene.hpp"

#include <algorithm>
#include <cmath>

namespace estuary::solid {
namespace {

// From the mid-line of a shell.
double distance_to(const BodyScene& body, double x, double y) {
  const Polygon& line = body.loops.front();
  double nearest = 1e300;
  for (std::size_t k = 0; k < line.size(); ++k) {
    if (k + 1 == line.size() && !(body.shell && body.shell->closed)) break;
    const auto &a = line[k], &b = line[(k + 1) % line.size()];
    const double dx = b[0] - a[0], dy = b[1] - a[1];
    const double share = std::clamp(((x - a[0]) * dx + (y - a[1]) * dy) / (dx * dx + dy * dy), 0.0, 1.0);
    nearest = std::min(nearest, std::hypot(a[0] + share * dx - x, a[1] + share * dy - y));
  }
  return nearest;
}

bool near_a_body(const SolidScene& scene, double x, double y) {
  for (const BodyScene& body : scene.bodies) {
    if (body.shape == Shape::points) {
      for (std::size_t k = 0; k + 2 < body.points.size(); k += 3)
        if (std::hypot(body.points[k] - x, body.points[k + 1] - y) < 2 * scene.spacing) return true;
      continue;
    }
    if (body.shape == Shape::polyline) {
      if (distance_to(body, x, y) < 0.5 * scene.spacing) return true;
      continue;
    }
    const auto loops = body.outline(scene.spacing);
    // Points on the contour count: a hair around it is tried as well.
    const double slip = 1e-6 * scene.spacing;
    for (const double dx : {0.0, -slip, slip})
      for (const double dy : {0.0, -slip, slip})
        if (contains(loops, x + dx, y + dy)) return true;
    // The polygon of a disc differs from the circle by less than this.
    if (body.shape == Shape::disc &&
        std::hypot(x - body.centre[0], y - body.centre[1]) < body.radius + 0.1 * scene.spacing)
      return true;
  }
  return false;
}

void read_method(SceneTable& solid, SolidScene& result) {
  // With particles on the contour the linear correction is already exact where a quadratic one would be
  // needed.
  const bool on_contour = result.placement == Placement::on_contour;
  result.order = on_contour ? Order::linear : Order::quadratic;
  if (solid.has("correction"))
    result.order = static_cast<Order>(
        std::find(kOrderNames.begin(), kOrderNames.end(), solid.choice("correction", kOrderNames)) -
        kOrderNames.begin());
  constexpr std::array<std::string_view, 2> formulations{"total_lagrangian", "updated_lagrangian"};
  result.updated_lagrangian = solid.choice("formulation", formulations) == "updated_lagrangian";
  if (result.updated_lagrangian && (result.mode == Mode::steady || result.periodic || result.plastic()))
    solid.problem("formulation",
                  "\"updated_lagrangian\" is for transient runs of elastic bodies that are not periodic");
  constexpr std::array<std::string_view, 3> kernels{"cubic_spline", "quintic_spline", "wendland"};
  const std::string kernel = solid.choice("kernel", kernels);
  result.kernel = static_cast<Kernel>(std::find(kernels.begin(), kernels.end(), kernel) - kernels.begin());
  // Wide enough for the next particles on the diagonal in each.
  const double ratio = result.kernel == Kernel::quintic_spline ? 0.65 : 0.95;
  result.smoothing_ratio = solid.number_or("smoothing_ratio", ratio, {.minimum = 0.5, .maximum = 2.0});
  if (result.smoothing_ratio * support_ratio(result.kernel) < 1.45)
    solid.problem("smoothing_ratio", "reaches no diagonal neighbours: the kernel ends at " +
                                         std::to_string(support_ratio(result.kernel)) + " times it");
  result.stress_points = static_cast<int>(solid.integer_or("stress_points", 0, 0, 2));
  const bool between = result.stress_points > 0;
  if (between) {
    if (std::any_of(result.bodies.begin(), result.bodies.end(),
                    [](const BodyScene& body) { return body.shape == Shape::points; }))
      solid.problem("stress_points", "need a contour; a point list has none");
    if (!on_contour || result.clamp != Clamp::line)
      solid.problem("stress_points", "go with placement = \"on_contour\" and clamp = \"line\"");
    if (result.updated_lagrangian) solid.problem("stress_points", "are of the total Lagrangian form");
    if (result.order != Order::linear && result.order != Order::quadratic)
      solid.problem("stress_points", "need correction = \"linear\" or \"quadratic\"");
  }
  const double stabilisation = between ? 0.0 : on_contour ? 0.02 : quadratic_exact(result.order) ? 0.05 : 0.0;
  result.stabilisation = solid.number_or("stabilisation", stabilisation, {.minimum = 0.0, .maximum = 1.0});
  result.viscosity_linear = solid.number_or("viscosity_linear", 0.2, {.minimum = 0.0, .maximum = 10.0});
  result.viscosity_quadratic = solid.number_or("viscosity_quadratic", 0.4, {.minimum = 0.0, .maximum = 10.0});
  result.conservative_smoothing =
      solid.number_or("conservative_smoothing", 0.0, {.minimum = 0.0, .maximum = 0.5});
  if (result.conservative_smoothing > 0 && (result.mode == Mode::steady || between))
    solid.problem("conservative_smoothing", "is of transient runs without stress points");
  if (solid.has("artificial_stress") && !result.updated_lagrangian)
    solid.problem(
        "artificial_stress",
        "is of formulation = \"updated_lagrangian\"; the total Lagrangian form has no tensile instability");
  result.artificial_stress = solid.number_or("artificial_stress", 0.0, {.minimum = 0.0, .maximum = 1.0});
  if (solid.has("hourglass_viscosity") && !result.plastic())
    solid.problem("hourglass_viscosity",
                  "is of law = \"j2_plasticity\"; elastic bodies have `stabilisation`");
  result.hourglass_viscosity = solid.number_or("hourglass_viscosity", 0.0, {.minimum = 0.0, .maximum = 10.0});
  read_contact(solid, result);
  result.courant = solid.number_or("courant", 0.8, {.minimum = 1e-3, .maximum = 1.0});
  result.damping = solid.number_or("damping", 0.0, Range::not_negative());
  constexpr std::array<std::string_view, 2> methods{"newton", "relaxation"};
  result.steady.tolerance = 1e-6;
  bool relaxation = result.shells();
  std::int64_t steps = 0;
  if (auto steady = solid.table_if("steady")) {
    result.steady.tolerance = steady->number_or("tolerance", 1e-6, {.minimum = 1e-12, .maximum = 0.1});
    if (!relaxation || steady->has("method")) relaxation = steady->choice("method", methods) == "relaxation";
    steps = steady->integer_or("maximum_steps", 0, 0, 1'000'000'000);
    constexpr std::array<std::string_view, 2> verdicts{"fail", "accept"};
    result.accepts_unstable = steady->choice("unstable", verdicts) == "accept";
  }
  result.method = relaxation ? SteadyMethod::relaxation : SteadyMethod::newton;
  result.steady.maximum_steps = steps > 0 ? static_cast<std::uint64_t>(steps) : relaxation ? 2'000'000 : 1000;
}

void read_watches(SceneTable& root, const std::string& role, SolidScene& result) {
  for (SceneTable& table : root.tables("watch")) {
    if (table.text_or("participant", "") != role) continue;
    WatchScene watch;
    watch.name = table.text("name");
    if (table.has("body")) {
      const std::string name = table.text("body");
      const auto found = std::find_if(result.bodies.begin(), result.bodies.end(),
                                      [&](const BodyScene& body) { return body.name == name; });
      if (found == result.bodies.end())
        table.problem("body", "no [[solid.body]] has the name \"" + name + "\"");
      else
        watch.body = static_cast<std::size_t>(found - result.bodies.begin());
      if (table.has("point")) table.problem("point", "give either `point` or `body`");
    }
    if (table.has("point")) {
      const auto point = table.numbers("point", 2);
      if (point.size() == 2) {
        watch.point = {point[0], point[1]};
        if (!near_a_body(result, point[0], point[1]))
          table.problem("point", "lies outside of every body in its reference state");
      }
    }
    if (table.has("region")) {
      const auto corners = table.points("region", 2);
      if (corners.size() == 4 && corners[2] > corners[0] && corners[3] > corners[1])
        watch.region = {corners[0], corners[1], corners[2], corners[3]};
      else
        table.problem("region", "wants the lower left and the upper right corner [[x, y], [x, y]]");
      if (table.has("point") || table.has("body"))
        table.problem("region", "give one of `point`, `body` and `region`");
    }
    if (table.has("hold")) {
      const std::string name = table.text("hold");
      const auto found = std::find_if(result.holds.begin(), result.holds.end(),
                                      [&](const HoldScene& hold) { return hold.name == name; });
      if (name.empty() || found == result.holds.end())
        table.problem("hold", "no [[solid.hold]] has the name \"" + name + "\"");
      else
        watch.hold = static_cast<std::size_t>(found - result.holds.begin());
      if (table.has("point") || table.has("body") || table.has("region"))
        table.problem("hold", "give one of `point`, `body`, `region` and `hold`");
    }
    for (const char* key : {"line", "samples"})
      if (table.has(key)) table.problem(key, "the solid watches points and totals, not lines");
    result.watches.push_back(std::move(watch));
  }
}

}  // namespace

bool SolidScene::all_rigid() const {
  return std::all_of(bodies.begin(), bodies.end(),
                     [](const BodyScene& body) { return body.rigid.has_value(); });
}

ElasticConstants SolidScene::constants(std::size_t body) const {
  const MaterialScene& material = bodies[body].material;
  // Nothing of a rigid body is strained, and a fluid has a law of its own; any will do.
  if (bodies[body].rigid || bodies[body].fluid) return ElasticConstants::from(1.0, 0.0, plane);
  return ElasticConstants::from(material.young_modulus, material.poisson_ratio, plane);
}

bool SolidScene::shells() const {
  return std::any_of(bodies.begin(), bodies.end(),
                     [](const BodyScene& body) { return body.shell.has_value(); });
}

bool SolidScene::breaks() const {
  return std::any_of(bodies.begin(), bodies.end(), [](const BodyScene& body) { return body.rupture.any(); });
}

bool SolidScene::shell_at(const std::array<double, 2>& point) const {
  if (!impact()) return shells();
  return std::any_of(bodies.begin(), bodies.end(), [&](const BodyScene& body) {
    return body.shell && distance_to(body, point[0], point[1]) <= 0.5 * body.shell->thickness;
  });
}

bool SolidScene::fluids() const {
  return std::any_of(bodies.begin(), bodies.end(),
                     [](const BodyScene& body) { return body.fluid.has_value(); });
}

double SolidScene::wave_speed(std::size_t body) const {
  if (bodies[body].fluid) return bodies[body].fluid->sound_speed;
  return std::sqrt(constants(body).wave_modulus() / bodies[body].material.density);
}

double SolidScene::fastest_wave() const {
  double speed = 0;
  for (std::size_t body = 0; body < bodies.size(); ++body)
    if (!bodies[body].rigid) speed = std::max(speed, wave_speed(body));
  return speed;
}

double SolidScene::courant_step(const std::array<double, 2>& distance) const {
  return courant * std::min(distance[0], distance[1]) / fastest_wave();
}

SolverOptions SolidScene::solver_options() const {
  SolverOptions options;
  options.order = order;
  options.kernel = kernel;
  options.stabilisation = stabilisation;
  options.conservative_smoothing = conservative_smoothing;
  options.artificial_stress = artificial_stress;
  if (hourglass_viscosity > 0)
    for (std::size_t k = 0; k < bodies.size(); ++k)
      options.hourglass_time.push_back(bodies[k].rigid ? 0.0 : hourglass_viscosity * spacing / wave_speed(k));
  if (std::any_of(bodies.begin(), bodies.end(),
                  [](const BodyScene& body) { return !body.shell && body.rupture.any(); }))
    for (const BodyScene& body : bodies) {
      options.rupture.push_back(body.shell ? RuptureLimits{} : body.rupture);
      options.cracks.insert(options.cracks.end(), body.cracks.begin(), body.cracks.end());
    }
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    Material material{.constants = constants(k), .plane = plane, .viscosity = {}, .plasticity = {}};
    material.plasticity = bodies[k].material.plasticity;
    // An equilibrium has no velocity, so a steady run is compiled without viscosity.
    if (mode == Mode::transient && !bodies[k].rigid)
      material.viscosity = {.linear = viscosity_linear,
                            .quadratic = viscosity_quadratic,
                            .sound_speed = wave_speed(k),
                            .smoothing_length = 0,
                            .density = bodies[k].material.density};
    options.materials.push_back(std::move(material));
  }
  return options;
}

SolidScene read_solid_scene(Scene& scene, const std::string& role) {
  SolidScene result;
  SceneTable root = scene.root();
  if (root.integer_or("dimension", 2, 2, 3) != 2)
    root.problem("dimension", "this solid computes in two dimensions only; use dimension = 2");
  if (auto coupling = root.table_if("coupling")) {
    constexpr std::array<std::string_view, 2> modes{"steady", "transient"};
    result.mode = coupling->choice("mode", modes) == "transient" ? Mode::transient : Mode::steady;
    if (result.mode == Mode::transient) {
      result.window = coupling->number("window", Range::positive());
      result.end_time = coupling->number("end_time", Range::positive());
    }
  }
  result.coupled = role == "solid" && (root.has("fluid") || root.has("grains"));
  result.meets_surface = role == "fluid" && root.has("solid");
  SceneTable solid = root.table(role);
  solid.leave_to_others({"solver", "connect", "threads"});
  read_bodies(solid, result);
  read_method(solid, result);
  read_conditions(solid, result);
  if (result.updated_lagrangian && std::any_of(result.bodies.begin(), result.bodies.end(),
                                               [](const BodyScene& body) { return body.rigid.has_value(); }))
    solid.problem("formulation", "\"updated_lagrangian\" knows no rigid bodies");
  check_shells(solid, result);
  check_rupture(solid, result);
  check_impact(solid, result);
  read_watches(root, role, result);
  if (result.mode == Mode::steady)
    for (std::size_t k = 0; k < result.bodies.size(); ++k) {
      if (result.bodies[k].rigid) continue;
      const auto& clamped = result.bodies[k].box.clamped;
      const bool held = std::find(clamped.begin(), clamped.end(), true) != clamped.end() ||
                        std::any_of(result.holds.begin(), result.holds.end(), [&](const HoldScene& hold) {
                          return hold.place.every_body || hold.place.body == k;
                        });
      if (!held)
        solid.problem(
            "clamped",
            "a steady run needs a clamped side or a [[solid.hold]]: a free body has no unique equilibrium");
    }
  solid.refuse_unknown_keys();
  return result;
}

}  // namespace estuary::solid
