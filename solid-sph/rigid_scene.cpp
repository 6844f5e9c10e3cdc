// Rigid bodies of a solid scene: mass, springs, dampers, what is held or driven.
#include <algorithm>
#include <cmath>
#include <numbers>

#include "expression.hpp"
#include "solid_scene.hpp"

namespace estuary::solid {
namespace {

constexpr std::array<std::string_view, 3> kFreedoms{"x", "y", "rotation"};
constexpr std::array<std::string_view, 10> kRigidKeys{
    "mass",        "inertia",       "spring", "damper",          "rotation_spring", "rotation_damper",
    "spring_rest", "rotation_rest", "motion", "angular_velocity"};

void read_pair(SceneTable& table, std::string_view key, Range range, std::array<double, 3>& into) {
  if (!table.has(key)) return;
  const auto values = table.numbers(key, 2);
  for (std::size_t c = 0; c < values.size() && c < 2; ++c) {
    if (values[c] < range.minimum) table.problem(key, "must not be negative");
    into[c] = values[c];
  }
}

void read_drive(SceneTable& table, std::string_view key, std::size_t freedom, RigidScene& rigid) {
  if (!table.has(key)) return;
  rigid.motion[freedom] = table.expression(key);
  check_expression(table, key, rigid.motion[freedom]);
  if (rigid.held[freedom]) table.problem(key, "is held; take it out of `held`, or do not move it");
  rigid.held[freedom] = true;
}

}  // namespace

Kind read_kind(SceneTable& table) {
  constexpr std::array<std::string_view, 4> kinds{"deformable", "rigid", "shell", "fluid"};
  const std::string kind = table.choice("kind", kinds);
  if (kind != "rigid")
    for (const std::string_view key : kRigidKeys)
      if (table.has(key)) {
        table.leave_to_others({key});
        table.problem(key, "is of a body with kind = \"rigid\"");
      }
  return static_cast<Kind>(std::find(kinds.begin(), kinds.end(), kind) - kinds.begin());
}

void read_rigid(SceneTable& table, const SolidScene& scene, double shared_density, BodyScene& body) {
  RigidScene& rigid = body.rigid.emplace();
  for (const char* key : {"young_modulus", "poisson_ratio", "yield_stress"})
    if (table.has(key) && scene.bodies.empty() && shared_density == 0) {
      table.leave_to_others({key});
      table.problem(key, "means nothing for a rigid body");
    }
  if (body.shape == Shape::points || body.shape == Shape::polyline)
    table.problem("kind", "a rigid body needs an outline: `box`, `disc` or `polygon`");
  if (scene.placement != Placement::on_contour || scene.clamp != Clamp::line || scene.periodic)
    table.problem("kind", "a rigid body is its contour: no `placement`, `clamp` or `periodic`");
  if (table.has("clamped")) table.problem("clamped", "is of deformable bodies; use `held`");
  if (table.has("mass")) {
    if (table.has("density")) table.problem("density", "give either `mass` [kg/m] or `density`");
    rigid.mass = table.number("mass", Range::positive());
  } else if (shared_density > 0) {
    body.material.density = table.number_or("density", shared_density, Range::positive());
  } else {
    body.material.density = table.number("density", Range::positive());
  }
  rigid.inertia = table.number_or("inertia", 0, Range::positive());
  read_pair(table, "spring", Range::not_negative(), rigid.spring);
  read_pair(table, "damper", Range::not_negative(), rigid.damper);
  read_pair(table, "spring_rest", Range::any(), rigid.rest);
  rigid.spring[2] = table.number_or("rotation_spring", 0, Range::not_negative());
  rigid.damper[2] = table.number_or("rotation_damper", 0, Range::not_negative());
  rigid.rest[2] = table.number_or("rotation_rest", 0);
  for (const std::string& word : table.texts_or_empty("held")) {
    const auto found = std::find(kFreedoms.begin(), kFreedoms.end(), word);
    if (found == kFreedoms.end())
      table.problem("held", "\"x\", \"y\" and \"rotation\" can be held, not \"" + word + "\"");
    else
      rigid.held[static_cast<std::size_t>(found - kFreedoms.begin())] = true;
  }
  if (auto motion = table.table_if("motion"))
    for (std::size_t c = 0; c < 3; ++c) read_drive(*motion, kFreedoms[c], c, rigid);
  rigid.angular_velocity = table.number_or("angular_velocity", 0);
  if (scene.mode == Mode::steady)
    for (std::size_t c = 0; c < 3; ++c)
      if (!rigid.held[c] && !(rigid.spring[c] > 0))
        table.problem("", "a steady run needs a spring or a hold of \"" + std::string(kFreedoms[c]) +
                              "\": a free body has no unique equilibrium");
}

std::vector<double> RigidScene::mass_and_inertia(const BodyScene& body, double spacing) const {
  const AreaMoments area = area_moments(body.outline(spacing));
  // A disc exactly, not its polygon.
  const bool disc = body.shape == Shape::disc;
  const double polar = disc ? 0.5 * std::numbers::pi * std::pow(body.radius, 4) : area.polar;
  const double m = mass > 0 ? mass : body.material.density * area.area;
  return {m, inertia > 0 ? inertia : m * polar / area.area, area.centroid[0], area.centroid[1]};
}

}  // namespace estuary::solid
