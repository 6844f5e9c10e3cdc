// The [solid] table of a scene and what the solid shares with the rest of it, read and checked.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "participant.hpp"
#include "scene.hpp"
#include "solver.hpp"

namespace estuary::solid {

struct SideLoadScene {
  Side side = Side::right;
  std::array<double, 2> force{};  // resultant [N/m]
  std::string ramp;               // expression of t; empty means constant
};

struct WatchScene {
  std::string name;
  std::optional<std::array<double, 2>> point;  // reference position [m]
};

enum class SteadyMethod { newton, relaxation };

/// How the forces received on the wet surface act through a time window.
enum class WindowLoad {
  mean,     // the mean of the values at the window's start and end, constant
  linear,   // from the value at the start to that at the end
  received  // the value received, constant: for a partner that sends window means
};

struct SolidScene {
  Box box;
  double density = 0;
  double young_modulus = 0;
  double poisson_ratio = 0;
  LawName law = LawName::saint_venant_kirchhoff;
  Plane plane = Plane::strain;
  Order order = Order::quadratic;
  double smoothing_ratio = 0.95;
  double stabilisation = 0;
  double viscosity_linear = 0;
  double viscosity_quadratic = 0;
  double courant = 0.8;
  double damping = 0;
  std::array<double, 2> gravity{};
  std::array<bool, 2> held{};  // components of the displacement that stay zero
  std::vector<Side> wet;
  std::vector<SideLoadScene> loads;
  std::vector<WatchScene> watches;
  SteadyMethod method = SteadyMethod::newton;
  EquilibriumSettings steady;
  WindowLoad window_load = WindowLoad::mean;
  Mode mode = Mode::steady;
  double window = 0;    // [s]
  double end_time = 0;  // [s]

  [[nodiscard]] ElasticConstants constants() const {
    return ElasticConstants::from(young_modulus, poisson_ratio, plane);
  }
  [[nodiscard]] double wave_speed() const;
  /// Largest step by courant * spacing / wave speed [s].
  [[nodiscard]] double courant_step(const std::array<double, 2>& spacing) const;
  [[nodiscard]] SolverOptions solver_options() const;
};

/// Notes every problem in `scene`; the result counts only when there are none.
SolidScene read_solid_scene(Scene& scene, const std::string& role);

/// Derived numbers, warnings, what is left out, memory and variant of a scene without problems.
Plan plan_of(const SolidScene& scene);

}  // namespace estuary::solid
