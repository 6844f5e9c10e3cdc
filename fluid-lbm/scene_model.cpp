#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <string_view>

#include "scene_parts.hpp"

namespace estuary::fluid {

using namespace std::string_view_literals;

namespace {

CollisionModel collision_of(const std::string& name) {
  if (name == "bgk") return CollisionModel::bgk;
  if (name == "recursive-regularised") return CollisionModel::recursive_regularised;
  if (name == "central-moment") return CollisionModel::central_moment;
  return CollisionModel::trt;
}

void read_rheology(SceneTable& fluid, FluidScene& result) {
  auto table = fluid.table_if("rheology");
  if (!table) return;
  static constexpr std::array models{"power-law"sv, "carreau-yasuda"sv, "bingham-papanastasiou"sv};
  ViscosityLaw& law = result.flow.law;
  result.flow.viscosity = ViscosityModel::generalised_newtonian;
  const std::string model = table->choice("model", models);
  if (model == "power-law") {
    law.rheology = Rheology::power_law;
    law.consistency = table->number("consistency", Range::positive());
    law.index = table->number("index", Range::positive());
  } else if (model == "carreau-yasuda") {
    law.rheology = Rheology::carreau_yasuda;
    law.zero_shear = table->number("zero_shear_viscosity", Range::positive());
    law.infinite_shear = table->number("infinite_shear_viscosity", Range::not_negative());
    law.time_constant = table->number("time_constant", Range::positive());
    law.index = table->number("index", Range::positive());
    law.yasuda = table->number_or("yasuda_exponent", 2.0, Range::positive());
  } else {
    law.rheology = Rheology::bingham_papanastasiou;
    law.infinite_shear = table->number("plastic_viscosity", Range::positive());
    law.yield_stress = table->number("yield_stress", Range::not_negative());
    law.time_constant = table->number("regularisation_time", Range::positive());
  }
  law.smallest = table->number_or("minimum_viscosity", 0.001 * result.units.viscosity, Range::positive());
  law.largest = table->number_or("maximum_viscosity", 1000 * result.units.viscosity, Range::positive());
  if (law.smallest >= law.largest) table->problem("maximum_viscosity", "has to be above minimum_viscosity");
}

void read_force(SceneTable& fluid, int dimension, FluidScene& result) {
  static constexpr std::array forcings{"guo"sv, "unshifted"sv};
  if (fluid.has("body_force")) {
    result.body_force = parse_expressions(fluid, "body_force", dimension);
    result.flow.force = ForceModel::guo;
  }
  if (!fluid.has("forcing")) return;
  if (fluid.choice("forcing", forcings) == "unshifted") result.flow.force = ForceModel::unshifted;
  if (!fluid.has("body_force")) fluid.problem("forcing", "there is no `body_force`");
}

}  // namespace

void read_model(SceneTable& fluid, int dimension, FluidScene& result, Plan& plan) {
  static constexpr std::array collisions{"trt"sv, "bgk"sv, "recursive-regularised"sv, "central-moment"sv};
  static constexpr std::array incompressible_first{"incompressible"sv, "compressible"sv};
  static constexpr std::array compressible_only{"compressible"sv};
  FlowSettings& flow = result.flow;
  flow.collision = collision_of(fluid.choice("collision", collisions));
  const bool product_form = flow.collision == CollisionModel::recursive_regularised ||
                            flow.collision == CollisionModel::central_moment;
  const std::string equilibrium = product_form ? fluid.choice("equilibrium", compressible_only)
                                               : fluid.choice("equilibrium", incompressible_first);
  flow.equilibrium =
      equilibrium == "compressible" ? EquilibriumModel::compressible : EquilibriumModel::incompressible;
  flow.magic_parameter = fluid.number_or("magic_parameter", 3.0 / 16.0, {1e-6, 10.0, false});
  if (flow.collision != CollisionModel::trt && fluid.has("magic_parameter")) {
    fluid.problem("magic_parameter", flow.collision == CollisionModel::bgk
                                         ? "BGK has no magic parameter; use collision = \"trt\""
                                         : "only collision = \"trt\" has a magic parameter");
  }
  read_force(fluid, dimension, result);
  read_rheology(fluid, result);
  if (fluid.has("smagorinsky")) {
    flow.law.smagorinsky_constant = fluid.number("smagorinsky", {0.0, 1.0, false});
    if (flow.viscosity == ViscosityModel::generalised_newtonian) {
      fluid.problem("smagorinsky", "goes with a constant viscosity only, not with [fluid.rheology]");
    } else if (flow.law.smagorinsky_constant > 0) {
      flow.viscosity = ViscosityModel::smagorinsky;
    }
  }
  if (flow.viscosity != ViscosityModel::constant && flow.force == ForceModel::unshifted) {
    fluid.problem("forcing", "the unshifted force goes with a constant viscosity only");
  }
  static constexpr std::array storages{"double"sv, "float"sv};
  if (fluid.choice("storage", storages) == "float") flow.storage = Storage::single_precision;
  if (flow.storage == Storage::single_precision &&
      (flow.viscosity != ViscosityModel::constant || flow.force != ForceModel::none)) {
    fluid.problem("storage", "\"float\" goes with a constant viscosity and without a body force only");
  }
  if (product_form && flow.force == ForceModel::unshifted) {
    fluid.problem("forcing", "the unshifted force goes with BGK and TRT only");
  }
  static constexpr std::array methods{"partially-saturated"sv, "interpolated"sv};
  if (fluid.choice("grains", methods) == "interpolated") result.grain_method = GrainMethod::interpolated;
  static constexpr std::array refills{"extrapolated-nonequilibrium"sv, "equilibrium"sv};
  if (fluid.choice("refill", refills) == "equilibrium") flow.refill = RefillRule::equilibrium;
  result.grain_rule = read_wall_rule(fluid, WallRule::linear);
  const bool varies = flow.viscosity != ViscosityModel::constant;
  result.viscous_traction = fluid.boolean_or("viscous_traction", !varies);
  if (result.viscous_traction && varies && result.has_solid) {
    fluid.problem("viscous_traction", "is not available where the viscosity varies; set it to false");
  }
  if (result.has_solid && dimension == 3) {
    fluid.problem("size", "a solid's wet surface is known in two dimensions only");
  }
  static constexpr std::array closings{"edges"sv, "everywhere"sv};
  result.close_everywhere = fluid.has("gradual_links")
                                ? fluid.choice("gradual_links", closings) == "everywhere"
                                : result.mode == Mode::steady;
  static constexpr std::array loads{"fitted"sv, "momentum-exchange"sv};
  result.exchange_loads = fluid.choice("loads", loads) == "momentum-exchange";
  result.match_force = fluid.boolean_or(
      "match_force", result.viscous_traction && result.mode == Mode::steady && !result.exchange_loads);
  if (result.match_force && !result.viscous_traction)
    fluid.problem("match_force", "the load can be matched to the total force only with viscous_traction");
  if (result.exchange_loads && result.match_force)
    fluid.problem("match_force", "loads by momentum exchange have the total force already");
  if (result.exchange_loads && !result.viscous_traction)
    fluid.problem("loads",
                  "momentum exchange does not tell pressure from viscous traction: set viscous_traction");
  if (varies && result.has_grains && result.grain_method == GrainMethod::partially_saturated) {
    plan.warnings.emplace_back(
        "partially saturated cells weigh with the constant viscosity where the viscosity varies");
  }
}

std::array<double, 3> evaluate_body_force(const FluidScene& scene, double time) {
  std::array<double, 3> force{};
  for (std::size_t axis = 0; axis < scene.body_force.size(); ++axis) {
    force[axis] = scene.units.acceleration_to_lattice() * scene.body_force[axis](0, 0, 0, time);
  }
  return force;
}

}  // namespace estuary::fluid
