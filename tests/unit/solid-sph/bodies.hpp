// Bodies and states that several tests share.
#pragma once

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "solver.hpp"

namespace estuary::solid::test {

struct Material {
  double density = 1000, young = 1e6, poisson = 0.3;
  Plane plane = Plane::strain;
  Plasticity plasticity{};
};

inline Box box_of(double length, double height, double spacing) {
  Box box;
  box.to = {length, height};
  box.spacing = spacing;
  return box;
}

struct Case {
  Order order = Order::linear;
  double stabilisation = 0;
  LawName law = LawName::saint_venant_kirchhoff;
  double viscosity_linear = 0, viscosity_quadratic = 0;
  double smoothing_ratio = 0.95;
  Kernel kernel = Kernel::cubic_spline;
};

struct Assembled {
  Body body;
  std::unique_ptr<Solver> solver;
  double wave_speed = 0;
};

inline std::unique_ptr<Assembled> assemble(const Box& box, const Material& material, const Case& options) {
  auto result = std::make_unique<Assembled>();
  result->body = fill(box, material.density, options.smoothing_ratio, options.order == Order::quadratic);
  SolverOptions solver;
  solid::Material made{.constants = ElasticConstants::from(material.young, material.poisson, material.plane),
                       .plane = material.plane,
                       .viscosity = {},
                       .plasticity = material.plasticity};
  result->wave_speed = std::sqrt(made.constants.wave_modulus() / material.density);
  made.viscosity = {.linear = options.viscosity_linear,
                    .quadratic = options.viscosity_quadratic,
                    .sound_speed = result->wave_speed,
                    .smoothing_length = result->body.smoothing_length,
                    .density = material.density};
  solver.materials.push_back(made);
  solver.order = options.order;
  solver.kernel = options.kernel;
  solver.stabilisation = options.stabilisation;
  result->solver = make_solver(options.law, result->body, solver);
  return result;
}

inline std::vector<double> random_field(std::size_t count, double amplitude, unsigned seed) {
  std::mt19937 generator(seed);
  std::uniform_real_distribution<double> uniform(-amplitude, amplitude);
  std::vector<double> values(count);
  for (double& v : values) v = uniform(generator);
  return values;
}

/// u = (A - I) X + c
inline std::vector<double> affine(const Body& body, const Tensor<double>& a, double cx, double cy) {
  std::vector<double> u(2 * body.size());
  for (std::size_t i = 0; i < body.size(); ++i) {
    const double x = body.position[2 * i], y = body.position[2 * i + 1];
    u[2 * i] = (a.xx - 1) * x + a.xy * y + cx;
    u[2 * i + 1] = a.yx * x + (a.yy - 1) * y + cy;
  }
  return u;
}

inline void no_monitor(double, const std::string&) {}

}  // namespace estuary::solid::test
