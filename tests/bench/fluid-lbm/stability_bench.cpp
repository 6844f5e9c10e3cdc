// How far the collision operators go: the smallest relaxation time and the largest grid Reynolds number that
// a doubly periodic shear layer, a lid-driven cavity and a disc that moves with a fifth of the lattice's
// speed survive, found by bisection, and the symptom when they do not. Not a timing: prints a table.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <string>
#include <vector>

#include "flow.hpp"

namespace {

using namespace estuary::fluid;

struct Operator {
  const char* name;
  CollisionModel collision;
  double magic;
  double smagorinsky;
};

FlowSettings settings_of(const Operator& op, int n, double viscosity, bool periodic) {
  FlowSettings settings;
  settings.grid = {n, n, 1.0, 0.0, 0.0, periodic, periodic};
  for (int s = 0; s < 4; ++s) {
    settings.sides[static_cast<std::size_t>(s)].kind = periodic ? SideKind::periodic : SideKind::wall;
  }
  settings.collision = op.collision;
  const bool product =
      op.collision == CollisionModel::central_moment || op.collision == CollisionModel::recursive_regularised;
  settings.equilibrium = product ? EquilibriumModel::compressible : EquilibriumModel::incompressible;
  settings.rates = relaxation_rates(viscosity, op.magic);
  settings.magic_parameter = op.magic;
  if (op.smagorinsky > 0) {
    settings.viscosity = ViscosityModel::smagorinsky;
    settings.law.base_viscosity = viscosity;
    settings.law.smagorinsky_constant = op.smagorinsky;
  }
  return settings;
}

// Empty when the flow holds for `steps`, else what was seen first.
std::string symptom(Flow& flow, int steps) {
  for (int done = 0; done < steps; done += 100) {
    flow.run(100);
    Fields fields;
    flow.compute_fields(fields);
    if (const auto bad = find_bad_node(fields, flow.cells())) {
      return (bad->finite ? "speed above sound" : "not finite") + std::string(" at step ") +
             std::to_string(done + 100);
    }
  }
  return {};
}

// Minion, Brown, J. Comput. Phys. 138 (1997): u = tanh(80 (1/4 - |y - 1/2|)), v = 0.05 sin(2 pi (x + 1/4)).
std::string shear_layer(const Operator& op, double viscosity, double speed) {
  constexpr int n = 128;
  Flow flow(settings_of(op, n, viscosity, true));
  Fields fields;
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      const double at = (y + 0.5) / n;
      fields.velocity_x.push_back(speed * std::tanh(80 * (0.25 - std::abs(at - 0.5))));
      fields.velocity_y.push_back(0.05 * speed * std::sin(2 * std::numbers::pi * ((x + 0.5) / n + 0.25)));
      fields.excess.push_back(0);
    }
  }
  set_equilibrium(flow.populations(), fields, flow.settings().equilibrium);
  return symptom(flow, static_cast<int>(2 * n / speed));
}

std::string cavity(const Operator& op, double viscosity, double speed) {
  constexpr int n = 64;
  FlowSettings settings = settings_of(op, n, viscosity, false);
  settings.sides[top].velocity_x.assign(2 * n + 1, speed);
  settings.sides[top].velocity_y.assign(2 * n + 1, 0.0);
  Flow flow(settings);
  return symptom(flow, static_cast<int>(40 * n / speed));
}

// A disc of radius 10 that is set off at once through fluid at rest, over 16 radii: it covers nodes and
// leaves others to be filled in every step.
std::string moving_disc(const Operator& op, double viscosity, double speed) {
  Flow flow(settings_of(op, 200, viscosity, true));
  Grains disc;
  disc.centre = {20.2, 100.4};
  disc.radius = {10.0};
  disc.velocity = {speed, 0.0};
  disc.spin = {0.0};
  flow.place_bodies(disc, {WallRule::linear}, false);
  const int steps = static_cast<int>(160 / speed);
  for (int step = 1; step <= steps; ++step) {
    flow.run(1);
    disc.centre[0] += speed;
    flow.place_bodies(disc, {WallRule::linear}, true);
    if (step % 20 != 0) continue;
    Fields fields;
    flow.compute_fields(fields);
    if (const auto bad = find_bad_node(fields, flow.cells()))
      return (bad->finite ? "speed above sound" : "not finite") + std::string(" at step ") +
             std::to_string(step);
  }
  return {};
}

template <class Case>
void report(const char* name, const Operator& op, double speed, const Case& run) {
  // Exponents of the viscosity: one that holds, one that does not.
  double holds = -1;
  double fails = -7;
  std::string last = run(op, std::pow(10.0, fails), speed);
  if (last.empty()) {
    std::printf("%-14s %-26s %6.2f   every viscosity down to 1e-7\n", name, op.name, speed);
    return;
  }
  while (holds - fails > 0.05) {
    const double middle = 0.5 * (holds + fails);
    const std::string seen = run(op, std::pow(10.0, middle), speed);
    if (seen.empty()) {
      holds = middle;
    } else {
      fails = middle;
      last = seen;
    }
  }
  const double viscosity = std::pow(10.0, holds);
  std::printf("%-14s %-26s %6.2f   tau %.5f   grid Reynolds number %8.1f   below: %s\n", name, op.name, speed,
              3 * viscosity + 0.5, speed / viscosity, last.c_str());
  std::fflush(stdout);
}

}  // namespace

int main() {
  const std::vector<Operator> operators{
      {"bgk", CollisionModel::bgk, 0.25, 0},
      {"trt 3/16", CollisionModel::trt, 3.0 / 16.0, 0},
      {"trt 1/4", CollisionModel::trt, 0.25, 0},
      {"recursive-regularised", CollisionModel::recursive_regularised, 0.25, 0},
      {"central-moment", CollisionModel::central_moment, 0.25, 0},
      {"central-moment, C = 0.17", CollisionModel::central_moment, 0.25, 0.17}};
  for (const Operator& op : operators) {
    report("shear layer", op, 0.05, shear_layer);
    report("cavity", op, 0.1, cavity);
    report("fast lid", op, 0.2, cavity);
    report("moving disc", op, 0.2, moving_disc);
  }
  // The largest lid speed at a moderate viscosity.
  for (const Operator& op : operators) {
    double holds = 0.05;
    double fails = 1.0;
    std::string last;
    while (fails - holds > 0.01) {
      const double middle = 0.5 * (holds + fails);
      const std::string seen = cavity(op, 0.02, middle);
      (seen.empty() ? holds : fails) = middle;
      if (!seen.empty()) last = seen;
    }
    std::printf("%-14s %-26s lid up to %.2f (Mach %.2f)   above: %s\n", "cavity", op.name, holds,
                holds * std::sqrt(3.0), last.c_str());
    std::fflush(stdout);
  }
}
